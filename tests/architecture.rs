//! The shape of the house, read from the sources: rooms import only downwards, `unsafe` stands only where C
//! enters, and no file outgrows one idea.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

/// Each room with the rooms that it may use.
const ROOMS: [(&str, &[&str]); 11] = [
    ("control", &[]),
    ("grid", &[]),
    ("fmi", &[]),
    ("scenario", &["control", "grid"]),
    ("models", &["control", "grid", "fmi", "scenario"]),
    ("package", &["fmi", "scenario", "models"]),
    ("harness", &["fmi", "models", "scenario", "package"]),
    ("federation", &["harness"]),
    ("check", &["harness"]),
    ("report", &[]),
    (
        "cli",
        &[
            "control",
            "grid",
            "fmi",
            "scenario",
            "models",
            "package",
            "harness",
            "federation",
            "check",
            "report",
        ],
    ),
];

/// Rooms where C enters.
const UNSAFE_ROOMS: [&str; 3] = ["fmi", "harness", "federation"];

/// Generated files, which no one reads from top to bottom.
const GENERATED: [&str; 2] = ["src/fmi/bindings.rs", "src/fmi/three/bindings.rs"];

const LONGEST_FILE: usize = 400;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Lines of code: no comment lines, nothing from `#[cfg(test)]` to the end.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .take_while(|(_, line)| line.trim() != "#[cfg(test)]")
        .filter(|(_, line)| !line.trim_start().starts_with("//"))
        .map(|(number, line)| (number + 1, line))
}

/// The rooms that a line of code names: `crate::ROOM`, `crate::{ROOM, ...}`, or `super::...::ROOM` paths out of it.
fn rooms_named(line: &str) -> Vec<&'static str> {
    ROOMS
        .iter()
        .map(|(room, _)| *room)
        .filter(|room| {
            line.match_indices("crate::").any(|(at, _)| {
                let rest = &line[at + "crate::".len()..];
                let starts = |text: &str| {
                    text.strip_prefix(room)
                        .is_some_and(|r| !r.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
                };
                match rest.strip_prefix('{') {
                    Some(list) => list.split(',').any(|item| starts(item.trim())),
                    None => starts(rest),
                }
            })
        })
        .collect()
}

#[test]
fn rooms_import_only_downwards() {
    let mut found = Vec::new();
    let mut uses = 0;
    for (room, allowed) in ROOMS {
        for file in sources(&root().join("src").join(room)) {
            let text = fs::read_to_string(&file).unwrap();
            for (number, line) in code(&text) {
                for named in rooms_named(line) {
                    uses += 1;
                    if named != room && !allowed.contains(&named) {
                        found.push(format!("{}:{number}: {room} uses {named}: {line}", file.display()));
                    }
                }
                assert!(
                    !line.contains("super::super::super"),
                    "{}:{number}: a path that climbs out of its room hides from this test",
                    file.display()
                );
            }
        }
    }
    assert!(uses > 20, "the test reads {uses} uses of rooms; it no longer sees the sources");
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn every_room_is_a_folder_that_this_test_knows() {
    for entry in fs::read_dir(root().join("src")).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            assert!(ROOMS.iter().any(|(room, _)| *room == name), "src/{name} is no room of the map");
        } else {
            assert!(["lib.rs", "main.rs"].contains(&name.as_str()), "src/{name} stands in no room");
        }
    }
}

#[test]
fn unsafe_stands_only_where_c_enters() {
    for (room, _) in ROOMS.iter().filter(|(room, _)| !UNSAFE_ROOMS.contains(room)) {
        let files = sources(&root().join("src").join(room));
        for file in &files {
            let text = fs::read_to_string(file).unwrap();
            for (number, line) in code(&text) {
                assert!(
                    !line.contains("unsafe ") && !line.contains("unsafe{"),
                    "{}:{number}: {line}",
                    file.display()
                );
            }
        }
        let head = fs::read_to_string(root().join("src").join(room).join("mod.rs")).unwrap();
        assert!(head.contains("#![forbid(unsafe_code)]"), "src/{room}/mod.rs does not forbid unsafe code");
    }
}

#[test]
fn files_stay_readable() {
    for folder in ["src", "tests", "benches", "xtask/src"] {
        for file in sources(&root().join(folder)) {
            if GENERATED.iter().any(|generated| file.ends_with(generated)) {
                continue;
            }
            let text = fs::read_to_string(&file).unwrap();
            let lines = text.lines().count();
            assert!(lines <= LONGEST_FILE, "{} has {lines} lines; one idea a file", file.display());
            // A test may say first for which features it is.
            let says = match folder {
                "tests" => text.lines().any(|line| line.starts_with("//!")),
                _ => text.starts_with("//!"),
            };
            assert!(says, "{} does not say what it is for", file.display());
        }
    }
}

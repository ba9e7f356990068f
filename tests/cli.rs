//! `bess` as a person and a script meet it: exit codes, messages, files.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

fn bess(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bess")).args(arguments).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Ends with this code, says all of these on standard error, and writes nothing.
fn refused(arguments: &[&str], code: i32, parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let output = bess(folder.path(), arguments);
    let said = text(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(output.status.code(), Some(code), "{said}");
    for part in parts {
        assert!(said.contains(part), "{said} does not say {part}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "something was written");
}

#[test]
fn a_run_leaves_its_three_files_and_is_quiet_when_piped() {
    let folder = tempfile::tempdir().unwrap();
    let output = bess(folder.path(), &["run", "case1", "--set", "stop_s=22", "-o", "out"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    assert!(!table.contains('\u{1b}'), "escape codes in a pipe: {table}");
    assert!(table.contains("controller on") && table.contains("faster than real time"), "{table}");
    let mut files: Vec<String> = std::fs::read_dir(folder.path().join("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files, ["report.html", "summary.json", "trajectory.csv"]);
    let trajectory = std::fs::read_to_string(folder.path().join("out/trajectory.csv")).unwrap();
    assert!(trajectory.starts_with("time,controller.omega_set[1],"));
    // 22 s in steps of 10 ms, both ends, and the header.
    assert_eq!(trajectory.lines().count(), 2202);
}

#[test]
fn what_the_user_got_wrong_ends_with_2() {
    refused(&["run", "case9"], 2, &["case9", "case1"]);
    refused(&["run", "case1", "--set", "bess[2].K_P=0"], 2, &["bess[2].K_P", "found 0", "greater than 0"]);
    refused(&["run", "case1", "--set", "control.etta=1"], 2, &["unknown field `etta`", "`eta`"]);
    refused(
        &["run", "case1", "--set", "events=[{\"at_s\":3,\"set\":{\"grid.dP_lod[12]\":1}}]"],
        2,
        &["event at 3.0 s", "dP_lod[12]", "dP_load[12]"],
    );
    refused(&["run", "case1", "--grid", "absent.fmu"], 2, &["absent.fmu"]);
    refused(&["export", "controller", "mine.json"], 2, &["mine.json"]);
    refused(
        &["export", "controller", "case1", "--fmi", "3", "--portable"],
        2,
        &["--portable is for FMI 2.0"],
    );
    refused(
        &["export", "system", "case1", "--fmi", "3"],
        2,
        &["--fmi 3", "FMUs of FMI 2.0", "each with --fmi 3"],
    );
    refused(&["export", "grid", "case1", "--fmi", "4"], 2, &["--fmi", "'4'", "possible values: 2, 3"]);
}

#[test]
fn a_missing_library_says_how_to_get_it() {
    refused(&["export", "controller", "case1", "--libraries", "."], 1, &["BessConsensus", "cargo xtask fmu"]);
}

#[test]
fn the_schema_accepts_the_scenario_that_show_prints() {
    let folder = tempfile::tempdir().unwrap();
    let shown = bess(folder.path(), &["show", "case1"]);
    std::fs::write(folder.path().join("mine.json"), &shown.stdout).unwrap();
    let bounds = bess(folder.path(), &["bounds", "mine.json"]);
    assert_eq!(text(&bounds.stdout), text(&bess(folder.path(), &["bounds", "case1"]).stdout));
    let schema: serde_json::Value = serde_json::from_slice(&bess(folder.path(), &["schema"]).stdout).unwrap();
    let document: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
    for key in document.as_object().unwrap().keys() {
        assert!(schema["properties"].get(key).is_some(), "the schema does not know {key}");
    }
}

/// The figures on the 57-bus grid, by an independent count: the certified times are the closed form of the
/// printed eigenvalues and norms, and the printed forms are 2^((1-eta)/2) looser.
#[test]
fn bounds_prints_the_closed_form() {
    let folder = tempfile::tempdir().unwrap();
    let printed = text(&bess(folder.path(), &["bounds", "case1"]).stdout);
    let number = |label: &str, column: usize| -> f64 {
        let line = printed.lines().find(|line| line.trim_start().starts_with(label)).unwrap();
        line.trim_start()[label.len()..]
            .split_whitespace()
            .filter_map(|w| w.parse().ok())
            .nth(column)
            .unwrap()
    };
    let norm = number("norm of K_P P - mean", 0);
    let lambda = number("lambda_2", 0);
    let expected = norm.sqrt() / (0.5 * lambda.powf(0.75));
    assert!((number("T_P", 0) - expected).abs() < 1e-4, "{printed}");
    assert!((number("T_P", 1) - expected * 2f64.powf(0.25)).abs() < 1e-4, "{printed}");
}

//! The Rust bindings of the FMI 2.0 headers: made anew with bindgen, compared with what is checked in.

use crate::{
    error::Failure,
    process::{cargo, output},
    workspace::Workspace,
};
use serde_json::Value;
use std::path::PathBuf;

/// What is checked in, from the workspace root.
const CHECKED_IN: &str = "src/fmi/bindings.rs";

/// Fails if the bindings that are checked in are not those that the headers give.
pub fn check(workspace: &Workspace) -> Result<(), Failure> {
    let fresh = generate(workspace)?;
    let path = workspace.root.join(CHECKED_IN);
    let checked_in = std::fs::read_to_string(&path).map_err(Failure::file("read", &path))?;
    match first_difference(&checked_in, &fresh) {
        None => Ok(()),
        Some((line, found, expected)) => Err(Failure::Other(format!(
            "{CHECKED_IN}:{line} is stale: found `{found}`, the headers give `{expected}`; \
             run `cargo xtask generate bindings`"
        ))),
    }
}

/// Writes the bindings into the source tree.
pub fn write(workspace: &Workspace) -> Result<(), Failure> {
    let path = workspace.root.join(CHECKED_IN);
    std::fs::write(&path, generate(workspace)?).map_err(Failure::file("write", &path))?;
    println!("{CHECKED_IN}");
    Ok(())
}

/// Has the root package's build script make the bindings, and reads them from its output folder.
fn generate(workspace: &Workspace) -> Result<String, Failure> {
    let mut check = cargo(workspace);
    check.args(["check", "--quiet", "--release", "--package", "bess-consensus", "--lib"]);
    check.args(["--no-default-features", "--features", "bindgen"]);
    check.args(["--message-format", "json-render-diagnostics"]);
    let out = build_script_folder(&output(&mut check)?).ok_or_else(|| {
        Failure::Other("cargo reports no build script output for bess-consensus; see build.rs".into())
    })?;
    let file = out.join("bindings.rs");
    std::fs::read_to_string(&file).map_err(Failure::file("read", &file))
}

/// OUT_DIR of the root package, from cargo's messages (one JSON object a line).
fn build_script_folder(messages: &str) -> Option<PathBuf> {
    messages.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()).find_map(|message| {
        let executed = message.get("reason")?.as_str()? == "build-script-executed";
        let package = message.get("package_id")?.as_str()?;
        let ours = package.contains("#bess-consensus@") || package.contains("/bess-consensus#");
        if executed && ours { Some(PathBuf::from(message.get("out_dir")?.as_str()?)) } else { None }
    })
}

/// The first line (from 1) in which two texts differ, with that line of each.
fn first_difference<'a>(a: &'a str, b: &'a str) -> Option<(usize, &'a str, &'a str)> {
    let end = "(end of file)";
    let (mut left, mut right) = (a.lines(), b.lines());
    let mut number = 0;
    loop {
        number += 1;
        match (left.next(), right.next()) {
            (None, None) => return None,
            (l, r) if l == r => {}
            (l, r) => return Some((number, l.unwrap_or(end), r.unwrap_or(end))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_build_scripts_folder_is_found_among_cargos_messages() {
        let messages = r#"{"reason":"build-script-executed","package_id":"registry#serde@1.0.0","out_dir":"/no"}
not json
{"reason":"compiler-artifact","package_id":"path+file:///x#bess-consensus@0.1.0"}
{"reason":"build-script-executed","package_id":"path+file:///x#bess-consensus@0.1.0","out_dir":"/yes"}"#;
        assert_eq!(build_script_folder(messages), Some(PathBuf::from("/yes")));
        let named_folder = r#"{"reason":"build-script-executed","package_id":"path+file:///x/bess-consensus#0.1.0","out_dir":"/yes"}"#;
        assert_eq!(build_script_folder(named_folder), Some(PathBuf::from("/yes")));
        assert_eq!(build_script_folder(""), None);
    }

    #[test]
    fn a_difference_is_named_by_line() {
        assert_eq!(first_difference("a\nb\n", "a\nb\n"), None);
        assert_eq!(first_difference("a\nb\n", "a\nc\n"), Some((2, "b", "c")));
        assert_eq!(first_difference("a\n", "a\nb\n"), Some((2, "(end of file)", "b")));
    }
}

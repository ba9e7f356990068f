//! The Rust bindings of the FMI headers: made anew with bindgen, compared with what is checked in.

use crate::{
    error::Failure,
    process::{cargo, output},
    workspace::Workspace,
};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// What the build script makes, and where it is checked in, from the workspace root.
const FILES: [(&str, &str); 2] =
    [("bindings.rs", "src/fmi/bindings.rs"), ("bindings3.rs", "src/fmi/three/bindings.rs")];

/// Fails if the bindings that are checked in are not those that the headers give.
pub fn check(workspace: &Workspace) -> Result<(), Failure> {
    let made = generate(workspace)?;
    for (name, kept) in FILES {
        let (fresh, checked_in) = (read(&made.join(name))?, read(&workspace.root.join(kept))?);
        if let Some((line, found, expected)) = first_difference(&checked_in, &fresh) {
            return Err(Failure::Other(format!(
                "{kept}:{line} is stale: found `{found}`, the headers give `{expected}`; \
                 run `cargo xtask generate bindings`"
            )));
        }
    }
    Ok(())
}

/// Writes the bindings into the source tree.
pub fn write(workspace: &Workspace) -> Result<(), Failure> {
    let made = generate(workspace)?;
    for (name, kept) in FILES {
        let path = workspace.root.join(kept);
        std::fs::write(&path, read(&made.join(name))?).map_err(Failure::file("write", &path))?;
        println!("{kept}");
    }
    Ok(())
}

fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(Failure::file("read", path))
}

/// Has the root package's build script make the bindings; the folder that they are in.
fn generate(workspace: &Workspace) -> Result<PathBuf, Failure> {
    let mut check = cargo(workspace);
    check.args(["check", "--quiet", "--release", "--package", "bess-consensus", "--lib"]);
    check.args(["--no-default-features", "--features", "bindgen"]);
    check.args(["--message-format", "json-render-diagnostics"]);
    build_script_folder(&output(&mut check)?).ok_or_else(|| {
        Failure::Other("cargo reports no build script output for bess-consensus; see build.rs".into())
    })
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

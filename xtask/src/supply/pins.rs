//! Whether everything from a registry is pinned: Python packages to a version and its hashes, crates to one version
//! and to no git repository. Resolves nothing itself.

use crate::{
    error::Failure,
    process::{cargo, output},
    workspace::Workspace,
};
use serde_json::Value;
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// Fails with every finding, one a line.
pub fn check(workspace: &Workspace) -> Result<(), Failure> {
    let mut findings = Vec::new();
    let folders = suites(&workspace.root)?;
    for folder in &folders {
        findings.extend(suite(&workspace.root, folder)?);
    }
    let mut metadata = cargo(workspace);
    metadata.args(["metadata", "--locked", "--no-deps", "--format-version", "1"]);
    let json: Value = serde_json::from_str(&output(&mut metadata)?)
        .map_err(|error| Failure::Other(format!("`cargo metadata` printed no JSON: {error}")))?;
    findings.extend(crates(&json));
    println!("{} requirements.txt read", folders.len());
    if findings.is_empty() { Ok(()) } else { Err(Failure::Other(findings.join("\n"))) }
}

/// The folders with requirements, from the workspace root.
fn suites(root: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut found = BTreeSet::new();
    let mut to_do = vec![root.join("tests"), root.join("benches")];
    while let Some(folder) = to_do.pop() {
        for entry in std::fs::read_dir(&folder).map_err(Failure::file("list", &folder))?.flatten() {
            let path = entry.path();
            if path.is_dir() {
                to_do.push(path);
            } else if entry.file_name().to_string_lossy().starts_with("requirements") {
                found.insert(folder.clone());
            }
        }
    }
    Ok(found.into_iter().collect())
}

/// What is wrong with the two files of one folder.
fn suite(root: &Path, folder: &Path) -> Result<Vec<String>, Failure> {
    let read = |name: &str| {
        let path = folder.join(name);
        std::fs::read_to_string(&path).map_err(Failure::file("read", &path))
    };
    let name = folder.strip_prefix(root).unwrap_or(folder).display();
    let (wanted, pinned) = (read("requirements.in")?, read("requirements.txt")?);
    let (versions, mut findings) = hashed(&pinned);
    for requirement in wanted.lines().map(str::trim).filter(|line| says_something(line)) {
        match version(requirement) {
            None => findings.push(format!("requirements.in: `{requirement}` has no `==`")),
            Some(pin) if !versions.contains(&pin) => {
                findings.push(format!("`{requirement}` is not in requirements.txt: run pip-compile"));
            }
            Some(_) => {}
        }
    }
    Ok(findings.into_iter().map(|finding| format!("{name}: {finding}")).collect())
}

/// The pins of a requirements.txt, as pip-compile writes it, and what is not pinned to a version and a hash in it.
fn hashed(text: &str) -> (BTreeSet<String>, Vec<String>) {
    let (mut pins, mut findings) = (BTreeSet::new(), Vec::new());
    let joined = text.replace("\\\n", " ");
    for line in joined.lines().map(str::trim).filter(|line| says_something(line)) {
        let requirement = line.split(" --hash").next().unwrap_or(line).trim();
        let hashes: Vec<&str> = line.split_whitespace().filter(|word| word.starts_with("--hash")).collect();
        let is_hash = |word: &&str| {
            word.strip_prefix("--hash=sha256:")
                .is_some_and(|hex| hex.len() == 64 && hex.bytes().all(|byte| byte.is_ascii_hexdigit()))
        };
        match version(requirement) {
            Some(pin) if !hashes.is_empty() && hashes.iter().all(is_hash) => {
                pins.insert(pin);
            }
            Some(_) => findings.push(format!("`{requirement}` has no hash, or one that is not SHA-256")),
            None => findings.push(format!("`{requirement}` is not pinned with `==` to one version")),
        }
    }
    (pins, findings)
}

/// Neither empty nor a comment, nor what only forbids to build from source.
fn says_something(line: &str) -> bool {
    !(line.is_empty()
        || line.starts_with('#')
        || line == "--only-binary :all:"
        || line == "--only-binary=:all:")
}

/// `Name[extra]==1.2 ; marker` -> `name==1.2`; none if that is not its form.
fn version(requirement: &str) -> Option<String> {
    let (name, version) = requirement.split(';').next()?.split_once("==")?;
    let name = name.split('[').next()?.trim().to_lowercase().replace(['_', '.'], "-");
    let version = version.trim();
    let plain = |text: &str| {
        !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric() || b"-.+!".contains(&b))
    };
    (plain(&name) && plain(version)).then(|| format!("{name}=={version}"))
}

/// The dependencies of the workspace's packages that are neither a folder of it nor `=x.y.z` of the registry.
fn crates(metadata: &Value) -> Vec<String> {
    let list =
        |value: &Value, key: &str| value.get(key).and_then(Value::as_array).cloned().unwrap_or_default();
    let text = |value: &Value, key: &str| value.get(key).and_then(Value::as_str).unwrap_or("").to_owned();
    let mut findings = Vec::new();
    for package in list(metadata, "packages") {
        for dependency in list(&package, "dependencies") {
            let (of, name) = (text(&package, "name"), text(&dependency, "name"));
            let (source, version) = (text(&dependency, "source"), text(&dependency, "req"));
            if source.starts_with("git+") {
                findings.push(format!("{of}: {name} comes from a git repository: take a released version"));
            } else if source.starts_with("registry+") && !version.starts_with('=') {
                findings.push(format!("{of}: {name} `{version}` is not pinned: write `=x.y.z`"));
            }
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_here_is_pinned() {
        let workspace = Workspace::find().expect("a workspace");
        assert!(suites(&workspace.root).expect("folders").len() >= 6);
        check(&workspace).expect("all pinned");
    }

    #[test]
    fn what_is_not_pinned_or_not_hashed_is_found() {
        let hash = "a".repeat(64);
        let good = format!(
            "# by pip-compile\nFoo.Bar[x]==1.0 ; python_version < '4' \\\n    --hash=sha256:{hash}\n    # via x\n"
        );
        assert_eq!(hashed(&good), (["foo-bar==1.0".to_owned()].into(), vec![]));
        for bad in [
            "foo==1.0\n".to_owned(),
            format!("foo>=1.0 --hash=sha256:{hash}\n"),
            format!("foo==1.* --hash=sha256:{hash}\n"),
            "foo==1.0 --hash=md5:abc\n".to_owned(),
            format!("foo==1.0 --hash=sha256:{hash} --hash=sha256:abc\n"),
            "-e .\n".to_owned(),
            format!("--index-url x\nfoo==1.0 --hash=sha256:{hash}\n"),
        ] {
            assert_eq!(hashed(&bad).1.len(), 1, "{bad}");
        }
    }

    #[test]
    fn loose_and_git_dependencies_are_found() {
        let json = serde_json::json!({"packages": [{"name": "p", "dependencies": [
            {"name": "a", "source": "registry+x", "req": "=1.0.0"},
            {"name": "b", "source": "registry+x", "req": "^1.0.0"},
            {"name": "c", "source": "git+x", "req": "*"},
            {"name": "d", "source": null, "req": "*"},
        ]}]});
        let found = crates(&json);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].contains("`^1.0.0`") && found[1].contains("git"));
    }
}

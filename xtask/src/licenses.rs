//! The licences of what is inside the shared libraries of the FMUs: listed crate by crate from cargo's own
//! dependency tree, with the texts that the crates bring along.

use crate::{
    error::Failure,
    process::{cargo, output},
    workspace::Workspace,
};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The package of each FMU, and where its list is checked in, from the workspace root.
const LISTS: [(&str, &str); 2] = [
    ("bess-controller-fmu", "src/package/licenses/BessConsensus.txt"),
    ("bess-grid-fmu", "src/package/licenses/BessGrid.txt"),
];

/// A crate of the tree, by name and version.
type Crate = (String, String);

/// One line of `cargo tree --format '{p}|{l}|{r}'`.
pub struct Listed {
    /// The crate.
    pub name: String,
    /// Its version.
    pub version: String,
    /// Its license, an SPDX expression or, in old manifests, names with slashes between.
    pub license: String,
    /// Where its sources are developed; may be empty.
    pub repository: String,
}

impl Listed {
    /// Reads the line; none for a package of this workspace, which has its path behind the version.
    pub fn read(line: &str) -> Option<Listed> {
        let mut parts = line.trim().trim_end_matches(" (*)").split('|').map(str::to_owned);
        let head = parts.next()?;
        let mut words = head.split_whitespace();
        let (name, version) = (words.next()?.to_owned(), words.next()?.trim_start_matches('v').to_owned());
        if head.contains('(') && head.contains('/') {
            return None;
        }
        let (license, repository) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        Some(Listed { name, version, license, repository })
    }
}

/// Writes both lists into the source tree.
pub fn write(workspace: &Workspace) -> Result<(), Failure> {
    for (package, file) in LISTS {
        let path = workspace.root.join(file);
        std::fs::write(&path, list(workspace, package)?).map_err(Failure::file("write", &path))?;
        println!("{file}");
    }
    Ok(())
}

/// The list for one package: a table, then the texts, each once.
fn list(workspace: &Workspace, package: &str) -> Result<String, Failure> {
    let crates = crates(workspace, package)?;
    let folders = folders(workspace)?;
    let mut text = String::from(
        "The Rust crates in this FMU's shared library, on any platform, with their licenses. Where a crate offers\n\
         several, it is used under MIT if that is among them. The texts that the crates bring along follow.\n\n",
    );
    let mut texts: BTreeMap<String, BTreeSet<&str>> = BTreeMap::new();
    for ((name, version), (license, repository)) in &crates {
        let _ = writeln!(text, "{name} {version}: {license}  {repository}");
        let folder = folders.get(&(name.clone(), version.clone())).ok_or_else(|| {
            Failure::Other(format!("`cargo metadata` does not know {name} {version}; run `cargo fetch`"))
        })?;
        for license_text in license_texts(folder, license)? {
            texts.entry(license_text).or_default().insert(name);
        }
    }
    let mut ordered: Vec<(Vec<&str>, String)> =
        texts.into_iter().map(|(text, names)| (names.into_iter().collect(), text)).collect();
    ordered.sort();
    for (names, license) in ordered {
        let _ = write!(text, "\n{}\n{}\n\n{}\n", "-".repeat(100), names.join(", "), license.trim_end());
    }
    Ok(text)
}

/// Every crate that is linked in, with license and repository; neither ours nor what runs only while building.
fn crates(workspace: &Workspace, package: &str) -> Result<BTreeMap<Crate, (String, String)>, Failure> {
    let mut tree = cargo(workspace);
    tree.args(["tree", "--locked", "--package", package, "--edges", "normal,no-proc-macro"]);
    tree.args(["--target", "all", "--prefix", "none", "--format", "{p}|{l}|{r}"]);
    let listed = output(&mut tree)?;
    let crates = listed.lines().filter_map(Listed::read);
    Ok(crates.map(|listed| ((listed.name, listed.version), (listed.license, listed.repository))).collect())
}

/// Where the sources of each crate are.
pub fn folders(workspace: &Workspace) -> Result<BTreeMap<Crate, PathBuf>, Failure> {
    let mut metadata = cargo(workspace);
    metadata.args(["metadata", "--locked", "--format-version", "1"]);
    let json: Value = serde_json::from_str(&output(&mut metadata)?)
        .map_err(|error| Failure::Other(format!("`cargo metadata` printed no JSON: {error}")))?;
    let of = |package: &Value| {
        let text = |key: &str| package.get(key).and_then(Value::as_str).map(str::to_owned);
        let folder = PathBuf::from(text("manifest_path")?).parent()?.to_path_buf();
        Some(((text("name")?, text("version")?), folder))
    };
    Ok(json.get("packages").and_then(Value::as_array).into_iter().flatten().filter_map(of).collect())
}

/// The texts of the license that applies; copyright notices and all that the crate brings where it is not plain
/// which one that is.
fn license_texts(folder: &Path, license: &str) -> Result<Vec<String>, Failure> {
    let entries = std::fs::read_dir(folder).map_err(Failure::file("list", folder))?;
    let mut files: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| {
            let name = path.file_name().map(|name| name.to_string_lossy().to_uppercase()).unwrap_or_default();
            path.is_file()
                && ["LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE", "UNLICENSE"]
                    .iter()
                    .any(|start| name.starts_with(start))
        })
        .collect();
    files.sort();
    let is_mit = |path: &PathBuf| path.to_string_lossy().to_uppercase().contains("MIT");
    if license.contains("MIT") && files.iter().any(is_mit) {
        files.retain(is_mit);
    }
    let mut texts = Vec::with_capacity(files.len());
    for file in files {
        let bytes = std::fs::read(&file).map_err(Failure::file("read", &file))?;
        texts.push(String::from_utf8_lossy(&bytes).replace("\r\n", "\n"));
    }
    Ok(texts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lists_that_are_checked_in_are_fresh() {
        let workspace = Workspace::find().expect("a workspace");
        for (package, file) in LISTS {
            let checked_in = std::fs::read_to_string(workspace.root.join(file)).unwrap_or_default();
            let fresh = list(&workspace, package).expect("a list");
            assert!(checked_in == fresh, "{file} is stale: run `cargo xtask generate licenses`");
        }
    }

    #[test]
    fn no_crate_asks_for_more_than_a_notice() {
        let workspace = Workspace::find().expect("a workspace");
        for (package, _) in LISTS {
            let crates = crates(&workspace, package).expect("a tree");
            assert!(crates.len() > 15, "{package}: only {} crates", crates.len());
            for ((name, _), (license, _)) in crates {
                let free =
                    ["MIT", "Apache-2.0", "Zlib", "BSD-2-Clause", "BSD-3-Clause", "Unlicense", "CC0-1.0"];
                assert!(free.iter().any(|one| license.contains(one)), "{name}: `{license}`");
            }
        }
    }
}

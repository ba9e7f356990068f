//! The bill of materials inside each FMU, in CycloneDX 1.6: the crates that are linked into its shared library on
//! the platforms that are built for, from cargo's dependency tree and Cargo.lock. It depends on those alone: no
//! time, no serial number, nothing of the machine. What runs only while building is not in it.

use crate::{
    error::Failure,
    licenses::Listed,
    platforms::{MODELS, Platform},
    process::{cargo, output},
    workspace::Workspace,
};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// A crate that is linked in.
struct Component {
    listed: Listed,
    /// On which platforms, by FMI's names.
    platforms: BTreeSet<&'static str>,
    /// What it uses, by reference.
    uses: BTreeSet<String>,
}

/// What is linked in beside crates: name, license, what it is and where.
const BESIDE: [(&str, &str, &str); 4] = [
    (
        "Rust standard library",
        "MIT OR Apache-2.0",
        "Of the compiler that built the library; its .comment section or its panic messages' paths name it.",
    ),
    (
        "libgcc",
        "GPL-3.0-or-later WITH GCC-exception-3.1",
        "The unwinder, where gcc links: win64, and a linux64 library built without zig.",
    ),
    (
        "LLVM libunwind",
        "Apache-2.0 WITH LLVM-exception",
        "The unwinder, where zig links: linux64, aarch64-linux.",
    ),
    ("mingw-w64 runtime", "ZPL-2.1", "The start of a Windows library: win64."),
];

/// Where the bill of a model is checked in, from the workspace root.
fn file(model: &str) -> String {
    format!("src/package/sbom/{model}.cdx.json")
}

/// Writes both bills into the source tree.
pub fn write(workspace: &Workspace) -> Result<(), Failure> {
    for (package, model) in MODELS {
        let (name, text) = (file(model), bill(workspace, package, model)?);
        let path = workspace.root.join(&name);
        std::fs::write(&path, text).map_err(Failure::file("write", &path))?;
        println!("{name}");
    }
    Ok(())
}

/// The bill of one model.
fn bill(workspace: &Workspace, package: &str, model: &str) -> Result<String, Failure> {
    let lock = workspace.root.join("Cargo.lock");
    let checksums = checksums(&std::fs::read_to_string(&lock).map_err(Failure::file("read", &lock))?);
    let version = env!("CARGO_PKG_VERSION");
    let root = format!("bess-consensus/{model}@{version}");
    let mut components = BTreeMap::new();
    let mut direct = BTreeSet::new();
    for platform in Platform::ALL {
        let mut tree = cargo(workspace);
        tree.args(["tree", "--locked", "--package", package, "--edges", "normal,no-proc-macro"]);
        tree.args(["--target", platform.triple(), "--prefix", "depth", "--format", "|{p}|{l}|{r}"]);
        read_tree(&output(&mut tree)?, platform.name(), &mut direct, &mut components);
    }

    let mut listed = Vec::new();
    let mut edges = Vec::new();
    for (purl, component) in &components {
        let checksum = checksums.get(&(component.listed.name.clone(), component.listed.version.clone()));
        listed.push(described(
            purl,
            component,
            checksum.ok_or_else(|| {
                Failure::Other(format!(
                    "Cargo.lock has no checksum for {purl}; it is no crate of the registry"
                ))
            })?,
        ));
        edges.push(json!({ "ref": purl, "dependsOn": component.uses }));
    }
    for (name, license, what) in BESIDE {
        let reference = name.replace(' ', "-");
        direct.insert(reference.clone());
        edges.push(json!({ "ref": reference }));
        listed.push(json!({
            "type": "library", "bom-ref": reference, "name": name, "description": what,
            "licenses": [{ "expression": license }],
        }));
    }
    edges.insert(0, json!({ "ref": root, "dependsOn": direct }));
    let bill = json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "lifecycles": [{ "phase": "pre-build" }],
            "component": {
                "type": "library", "bom-ref": root, "group": "bess-consensus", "name": model, "version": version,
                "description": format!("The shared libraries of {model}.fmu"),
                "licenses": [{ "expression": env!("CARGO_PKG_LICENSE") }],
            },
        },
        "components": listed,
        "dependencies": edges,
    });
    let text = serde_json::to_string_pretty(&bill)
        .map_err(|error| Failure::Other(format!("the bill of materials is no JSON: {error}")))?;
    Ok(text + "\n")
}

/// One crate, as CycloneDX wants it.
fn described(purl: &str, component: &Component, checksum: &str) -> Value {
    let listed = &component.listed;
    let mut value = json!({
        "type": "library", "bom-ref": purl, "name": listed.name, "version": listed.version,
        "hashes": [{ "alg": "SHA-256", "content": checksum }],
        // Old manifests separate what one may choose from by a slash.
        "licenses": [{ "expression": listed.license.replace('/', " OR ") }],
        "purl": purl,
    });
    if let Some(value) = value.as_object_mut() {
        if !listed.repository.is_empty() {
            value.insert("externalReferences".into(), json!([{ "type": "vcs", "url": listed.repository }]));
        }
        if component.platforms.len() < Platform::ALL.len() {
            let only: Vec<&str> = component.platforms.iter().copied().collect();
            value.insert("properties".into(), json!([{ "name": "bess:platforms", "value": only.join(" ") }]));
        }
    }
    value
}

/// Takes the crates and edges out of what `cargo tree --prefix depth` printed. Packages of this workspace are one
/// with the library; what they use is `direct`.
fn read_tree(
    printed: &str,
    platform: &'static str,
    direct: &mut BTreeSet<String>,
    components: &mut BTreeMap<String, Component>,
) {
    // The path from the root to the line above; none for a package of this workspace.
    let mut path: Vec<Option<String>> = Vec::new();
    for line in printed.lines() {
        let Some((depth, rest)) = line.split_once('|') else { continue };
        let Ok(depth) = depth.parse::<usize>() else { continue };
        path.truncate(depth);
        let purl = Listed::read(rest).map(|listed| {
            let purl = format!("pkg:cargo/{}@{}", listed.name, listed.version);
            let component = components.entry(purl.clone()).or_insert_with(|| Component {
                listed,
                platforms: BTreeSet::new(),
                uses: BTreeSet::new(),
            });
            component.platforms.insert(platform);
            purl
        });
        if let Some(purl) = &purl {
            match path.last().and_then(Option::as_ref).and_then(|user| components.get_mut(user)) {
                Some(user) => user.uses.insert(purl.clone()),
                None => direct.insert(purl.clone()),
            };
        }
        path.push(purl);
    }
}

/// The SHA-256 of every crate in a Cargo.lock, as the registry hands it out.
fn checksums(lock: &str) -> BTreeMap<(String, String), String> {
    let mut found = BTreeMap::new();
    for package in lock.split("[[package]]").skip(1) {
        let value = |key: &str| {
            let line = package.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(" = "))?;
            Some(line.trim_matches('"').to_owned())
        };
        if let (Some(name), Some(version), Some(checksum)) =
            (value("name"), value("version"), value("checksum"))
        {
            found.insert((name, version), checksum);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bills_that_are_checked_in_are_fresh() {
        let workspace = Workspace::find().expect("a workspace");
        for (package, model) in MODELS {
            let checked_in = std::fs::read_to_string(workspace.root.join(file(model))).unwrap_or_default();
            let fresh = bill(&workspace, package, model).expect("a bill");
            assert!(checked_in == fresh, "{} is stale: run `cargo xtask generate sbom`", file(model));
        }
    }

    #[test]
    fn crates_and_who_uses_them_are_read_from_the_tree() {
        let printed = "0|ours v0.1.0 (/w/fmu)|MIT|\n1|bess v0.1.0 (/w)|MIT|\n2|a v1.0.0|MIT|u\n3|b v2.0.0|Zlib|v\n\
                       2|b v2.0.0|Zlib|v (*)\n";
        let (mut direct, mut components) = (BTreeSet::new(), BTreeMap::new());
        read_tree(printed, "linux64", &mut direct, &mut components);
        read_tree("0|ours v0.1.0 (/w)|MIT|\n1|a v1.0.0|MIT|u\n", "win64", &mut direct, &mut components);
        let (a, b) = ("pkg:cargo/a@1.0.0", "pkg:cargo/b@2.0.0");
        assert_eq!(direct, [a.to_owned(), b.to_owned()].into());
        assert_eq!(components[a].uses, [b.to_owned()].into());
        assert_eq!(components[a].platforms.len(), 2);
        assert!(components[b].uses.is_empty() && components[b].platforms.contains("linux64"));
        assert_eq!(components[b].listed.repository, "v");
    }

    #[test]
    fn checksums_are_read_from_the_lock_file() {
        let lock = "version = 4\n\n[[package]]\nname = \"a\"\nversion = \"1.0.0\"\nsource = \"r\"\nchecksum = \"00ff\"\n\n\
                    [[package]]\nname = \"ours\"\nversion = \"0.1.0\"\n";
        assert_eq!(checksums(lock), [(("a".to_owned(), "1.0.0".to_owned()), "00ff".to_owned())].into());
    }
}

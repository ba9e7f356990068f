//! cargo-deny: licences, duplicate versions and sources by deny.toml; advisories where their database can be had,
//! else only the versions that their authors took back, which the registry's index says.

use crate::{
    error::Failure,
    process::{command, run},
    python,
    workspace::Workspace,
};
use std::{path::Path, process::Command};

/// Where cargo-deny fetches the advisories from.
const DATABASE: &str = "https://github.com/RustSec/advisory-db";

/// What cargo-deny says when it cannot.
const NOT_FETCHED: &str = "failed to fetch advisory database";

/// An advisory about no crate. cargo-deny looks up which versions were yanked only with some database at hand.
const NOBODYS: &str = "```toml
[advisory]
id = \"RUSTSEC-2000-0001\"
package = \"none\"
date = \"2000-01-01\"

[versions]
patched = [\">= 0.0.0\"]
```

# Stands in for a database that cannot be had
";

/// Licences, duplicate versions, sources.
pub fn check(workspace: &Workspace) -> Result<(), Failure> {
    run(deny(workspace)?.args(["--locked", "check", "licenses", "bans", "sources"]))
}

/// Advisories. [`Failure::Absent`] if the database cannot be had, when only yanked versions were looked for.
pub fn advisories(workspace: &Workspace) -> Result<(), Failure> {
    let mut check = deny(workspace)?;
    check.args(["--locked", "check", "advisories"]);
    eprintln!("$ cargo-deny --locked check advisories");
    match judged(&mut check) {
        Err(said) if said.contains(NOT_FETCHED) => {}
        Err(said) => return Err(Failure::Other(said)),
        Ok(()) => return Ok(()),
    }
    yanked(workspace)?;
    Err(Failure::Absent(format!(
        "no advisory was looked up, because {DATABASE} cannot be fetched here; no version is yanked"
    )))
}

/// Fails if a version in Cargo.lock was yanked.
fn yanked(workspace: &Workspace) -> Result<(), Failure> {
    let folder = workspace.target.join("supply");
    let database = folder.join("nobodys");
    let (advisory, settings) = (database.join("crates/none"), folder.join("yanked.toml"));
    std::fs::create_dir_all(&advisory).map_err(Failure::file("make", &advisory))?;
    let advisory = advisory.join("RUSTSEC-2000-0001.md");
    std::fs::write(&advisory, NOBODYS).map_err(Failure::file("write", &advisory))?;
    let text = format!("[advisories]\ndb-path = {:?}\nyanked = \"deny\"\n", folder.join("databases"));
    std::fs::write(&settings, text).map_err(Failure::file("write", &settings))?;
    let git = |arguments: &[&str]| {
        let mut git = command(workspace, "git");
        git.arg("-C").arg(&database).args(arguments);
        run(&mut git)
    };
    if !database.join(".git").is_dir() {
        git(&["init", "--quiet", "--initial-branch=main"])?;
    }
    git(&["add", "--all"])?;
    // Made anew each time: cargo-deny refuses a database that nobody touched for months.
    let who = ["-c", "user.name=xtask", "-c", "user.email=xtask@localhost"];
    git(&[
        &who[..],
        &["commit", "--quiet", "--no-verify", "--no-gpg-sign", "--allow-empty", "--message", "Nothing"],
    ]
    .concat())?;
    let mut check = deny(workspace)?;
    instead_of_the_database(&mut check, &database);
    // Its own words would be `advisories ok`, and none was looked up.
    judged(check.args(["--locked", "--config"]).arg(settings).args(["check", "advisories"]))
        .map_err(Failure::Other)
}

/// Runs cargo-deny; what it says if it refuses.
fn judged(check: &mut Command) -> Result<(), String> {
    match check.output() {
        Ok(done) if done.status.success() => Ok(()),
        Ok(done) => Err(format!("cargo-deny: {}", String::from_utf8_lossy(&done.stderr).trim())),
        Err(error) => Err(format!("cannot start cargo-deny: {error}")),
    }
}

/// Has git take this folder for the database.
fn instead_of_the_database(check: &mut Command, folder: &Path) {
    check.env("GIT_CONFIG_COUNT", "1").env("GIT_CONFIG_VALUE_0", DATABASE);
    check.env("GIT_CONFIG_KEY_0", format!("url.file://{}.insteadOf", folder.display()));
}

fn deny(workspace: &Workspace) -> Result<Command, Failure> {
    let python = python::environment(workspace, "supply")?;
    Ok(command(workspace, python.with_file_name("cargo-deny")))
}

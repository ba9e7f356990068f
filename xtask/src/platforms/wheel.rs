//! `bess` as a Python wheel: the executable alone, with the FMUs' libraries for every platform inside, linked by
//! zig against an old glibc so that pip installs it on any Linux of the last ten years.

use super::{CARRY_CFG, OLDEST_GLIBC, Platform, build_all, carry, toolchain};
use crate::{
    error::Failure,
    process::{command, run},
    supply,
    workspace::Workspace,
};
use std::path::PathBuf;

/// Builds the wheel into target/wheels and gives back its path.
pub fn wheel(workspace: &Workspace) -> Result<PathBuf, Failure> {
    let tools = toolchain::zig(workspace).map_err(Failure::Other)?;
    let archive = carry(workspace, &build_all(workspace)?)?;
    let folder = workspace.target.join("wheels");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(Failure::file("empty", &folder))?;
    }
    let mut maturin = command(workspace, tools.join("maturin"));
    maturin.args(["build", "--release", "--locked", "--quiet", "--zig", "--compatibility", "manylinux2014"]);
    maturin.args(["--target", Platform::Linux64.triple(), "--out"]).arg(&folder);
    maturin.arg("--target-dir").arg(workspace.platforms().join("build"));
    maturin.arg("--").args(CARRY_CFG);
    // With the flags that the libraries in this target folder were built with, or all is built anew.
    supply::remapped(&mut maturin, workspace, Some(Platform::Linux64), None)?;
    maturin.env("BESS_CARRY", archive).env("PATH", toolchain::first_in_path(&tools));
    run(&mut maturin)?;
    only_wheel(&folder)
}

fn only_wheel(folder: &std::path::Path) -> Result<PathBuf, Failure> {
    let entries = std::fs::read_dir(folder).map_err(Failure::file("read", folder))?;
    let wheel = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "whl");
    let found: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(wheel).collect();
    match found.as_slice() {
        [one] => Ok(one.clone()),
        others => Err(Failure::Other(format!(
            "{} holds {} wheels after maturin, expected one for glibc {OLDEST_GLIBC}",
            folder.display(),
            others.len()
        ))),
    }
}

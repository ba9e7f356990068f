//! Builds the shared libraries and the `bess` that carries them, and has `bess` pack the FMUs.

use crate::{
    error::Failure,
    platforms::{self, Built, MODELS, Platform},
    process::{cargo, command, run},
    supply,
    workspace::Workspace,
};
use std::{io::IsTerminal, path::Path, process::Command};

/// The packed controller, from the workspace root.
pub const CONTROLLER: &str = "fmu/BessConsensus.fmu";
/// The packed grid, from the workspace root.
pub const GRID: &str = "fmu/BessGrid.fmu";

/// The packed controller of FMI 3.0.
pub const CONTROLLER_3: &str = "fmu/BessConsensus.fmi3.fmu";
/// The packed grid of FMI 3.0.
pub const GRID_3: &str = "fmu/BessGrid.fmi3.fmu";

/// Model, version of FMI, and the file that is packed of it.
const PACKED: [(&str, &str, &str); 4] = [
    ("controller", "2", CONTROLLER),
    ("grid", "2", GRID),
    ("controller", "3", CONTROLLER_3),
    ("grid", "3", GRID_3),
];

/// Builds for this platform, and packs both FMUs for the scenario `case1`.
pub fn build_and_pack(workspace: &Workspace) -> Result<(), Failure> {
    let platform = Platform::must_be_here()?;
    let built = [build_here(workspace, platform)?];
    pack(workspace, &built)?;
    if let Some(glibc) = platforms::needs(&built[0])? {
        println!("{} needs {glibc}; `cargo xtask fmu --all-platforms` asks for less", platform.name());
    }
    Ok(())
}

/// Builds for every platform that can be built here, and packs them all into both FMUs.
pub fn build_and_pack_all(workspace: &Workspace) -> Result<Vec<Built>, Failure> {
    let built = platforms::build_all(workspace)?;
    pack(workspace, &built)?;
    for one in &built {
        let glibc = platforms::needs(one)?.map(|glibc| format!(", needs {glibc}"));
        println!("{}{}", one.platform.name(), glibc.unwrap_or_default());
    }
    Ok(built)
}

/// The shared libraries of both models for the platform that this program runs on, by the plain cargo.
pub fn build_here(workspace: &Workspace, platform: Platform) -> Result<Built, Failure> {
    // One cargo call each: in one call the features of the two would unify, and the controller's
    // library would carry the grid.
    for (package, _) in MODELS {
        build_library(workspace, package, None)?;
    }
    Ok(libraries(workspace, platform))
}

/// Builds one library by the plain cargo; in another cargo home, if one is given.
pub fn build_library(workspace: &Workspace, package: &str, home: Option<&Path>) -> Result<(), Failure> {
    let mut build = cargo(workspace);
    supply::remapped(&mut build, workspace, Platform::here(), home)?;
    build.args(["build", "--locked", "--release", "--package", package, "--target-dir"]);
    start(build.arg(workspace.platforms().join("build")))
}

/// Where [`build_library`] leaves the libraries.
pub fn libraries(workspace: &Workspace, platform: Platform) -> Built {
    Built::in_folder(platform, &workspace.plain_libraries())
}

/// Builds the `bess` that carries these libraries, and has it write both FMUs, each for FMI 2.0 and FMI 3.0.
fn pack(workspace: &Workspace, built: &[Built]) -> Result<(), Failure> {
    let archive = platforms::carry(workspace, built)?;
    let mut bess = cargo(workspace);
    bess.args(["rustc", "--locked", "--release", "--package", "bess-consensus", "--bin", "bess"]);
    start(bess.env("BESS_CARRY", archive).arg("--").args(platforms::CARRY_CFG))?;
    for (model, fmi, file) in PACKED {
        run(command(workspace, workspace.bess()).args(["export", model, "case1", "--fmi", fmi, "-o", file]))?;
        let packed = workspace.root.join(file);
        let size = std::fs::metadata(&packed).map_err(Failure::file("find", &packed))?.len();
        println!("{file}: {}", kibibytes(size));
    }
    Ok(())
}

/// Runs a cargo command whose words are of no use where nobody watches.
fn start(cargo: &mut Command) -> Result<(), Failure> {
    if !std::io::stderr().is_terminal() {
        cargo.env("CARGO_TERM_QUIET", "true");
    }
    run(cargo)
}

fn kibibytes(bytes: u64) -> String {
    format!("{} KiB", bytes.div_ceil(1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_round_up() {
        assert_eq!(kibibytes(1025), "2 KiB");
    }
}

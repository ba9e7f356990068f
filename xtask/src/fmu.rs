//! Builds the two shared libraries and `bess`, and has `bess` pack the FMUs.

use crate::{
    error::Failure,
    process::{cargo, command, run},
    workspace::Workspace,
};
use std::io::IsTerminal;

/// The packed controller, from the workspace root.
pub const CONTROLLER: &str = "fmu/BessConsensus.fmu";
/// The packed grid, from the workspace root.
pub const GRID: &str = "fmu/BessGrid.fmu";

/// Builds everything in release and packs both FMUs for the scenario `case1`.
pub fn build_and_pack(workspace: &Workspace) -> Result<(), Failure> {
    // One cargo call each: in one call the features of the three would unify, and the controller's
    // library would carry the grid and the desk tools.
    for package in ["bess-controller-fmu", "bess-grid-fmu", "bess-consensus"] {
        let mut build = cargo(workspace);
        build.args(["build", "--release", "--package", package]);
        if !std::io::stderr().is_terminal() {
            build.arg("--quiet");
        }
        run(&mut build)?;
    }
    for (model, file) in [("controller", CONTROLLER), ("grid", GRID)] {
        run(command(workspace, workspace.bess()).args(["export", model, "case1", "-o", file]))?;
        let packed = workspace.root.join(file);
        let size = std::fs::metadata(&packed).map_err(Failure::file("find", &packed))?.len();
        println!("{file}: {}", kibibytes(size));
    }
    Ok(())
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

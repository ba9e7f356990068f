//! The two stages that look at what was built for other platforms, with pytest as the judge.

use super::{mocks, wheel};
use crate::{error::Failure, fmu, process::run, python, workspace::Workspace};

/// Builds and packs for all platforms and has `tests/platforms` look at the libraries and run them.
pub fn test(workspace: &Workspace, pytest: &[String]) -> Result<(), Failure> {
    mocks(workspace, &fmu::build_and_pack_all(workspace)?)?;
    let mut test = python::tests(workspace, "platforms", "platforms")?;
    run(test.env("BESS_PLATFORMS_DIR", workspace.platforms()).args(pytest))
}

/// Builds the wheel and has `tests/wheel` install and use it; FMPy's environment, which judges, never sees the wheel.
pub fn test_wheel(workspace: &Workspace, pytest: &[String]) -> Result<(), Failure> {
    let file = wheel(workspace)?;
    let mut test = python::tests(workspace, "fmpy", "wheel")?;
    run(test.env("BESS_WHEEL", file).args(pytest))
}

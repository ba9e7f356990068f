//! The virtual environment for the tests in Python: made under the target folder from pinned, hashed
//! requirements, and made anew when those or the interpreter change.

use crate::{
    error::Failure,
    process::{command, output, run},
    workspace::Workspace,
};
use std::path::PathBuf;

/// The pinned packages, from the workspace root.
const REQUIREMENTS: &str = "tests/fmpy/requirements.txt";

/// The interpreter of the virtual environment, with everything installed.
pub fn environment(workspace: &Workspace) -> Result<PathBuf, Failure> {
    let folder = workspace.target.join("venv");
    let python = folder.join("bin/python");
    let stamp = folder.join("made-from.txt");

    let requirements = workspace.root.join(REQUIREMENTS);
    let pinned = std::fs::read_to_string(&requirements).map_err(Failure::file("read", &requirements))?;
    let interpreter = "import sys; print(sys.base_prefix, sys.version)";
    let wanted = format!("{}\n{pinned}", output(command(workspace, "python3").args(["-c", interpreter]))?);
    if python.exists() && std::fs::read_to_string(&stamp).is_ok_and(|made_from| made_from == wanted) {
        return Ok(python);
    }

    run(command(workspace, "python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    let mut pip = command(workspace, &python);
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input"]);
    run(pip.args(["--only-binary=:all:", "--require-hashes", "-r", REQUIREMENTS]))?;
    // Written last: half an installation is made anew.
    std::fs::write(&stamp, wanted).map_err(Failure::file("write", &stamp))?;
    Ok(python)
}

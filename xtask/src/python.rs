//! The virtual environments for the tests in Python: each made under the target folder from the pinned,
//! hashed requirements of its tests, and made anew when those or the interpreter change.

use crate::{
    error::Failure,
    process::{command, output, run},
    workspace::Workspace,
};
use std::{path::PathBuf, process::Command};

/// pytest for `tests/SUITE`, in the virtual environment for the suite named first.
pub fn tests(workspace: &Workspace, of: &str, suite: &str) -> Result<Command, Failure> {
    let mut test = command(workspace, environment(workspace, of)?);
    // Where the built `bess` and the libraries are, for the tests that look at them.
    test.env("BESS_RELEASE_DIR", workspace.release());
    test.args(["-m", "pytest", "-ra"]).arg(format!("tests/{suite}"));
    Ok(test)
}

/// The interpreter of the virtual environment for `tests/SUITE` (`fmpy`, or `masters/cofmupy` for a part of a
/// suite), with everything installed that `tests/SUITE/requirements.txt` pins. Suites are apart, because the
/// masters ask for packages that clash.
pub fn environment(workspace: &Workspace, suite: &str) -> Result<PathBuf, Failure> {
    environment_of(workspace, &format!("tests/{suite}"), &suite.replace('/', "-"))
}

/// The same for the requirements.txt in any folder of the workspace; `name` tells the environments apart.
pub fn environment_of(workspace: &Workspace, folder: &str, name: &str) -> Result<PathBuf, Failure> {
    let requirements = workspace.root.join(folder).join("requirements.txt");
    let folder = workspace.target.join("venv").join(name);
    let python = folder.join("bin/python");
    let stamp = folder.join("made-from.txt");

    let pinned = std::fs::read_to_string(&requirements).map_err(Failure::file("read", &requirements))?;
    let interpreter = "import sys; print(sys.base_prefix, sys.version)";
    let wanted = format!("{}\n{pinned}", output(command(workspace, "python3").args(["-c", interpreter]))?);
    if python.exists() && std::fs::read_to_string(&stamp).is_ok_and(|made_from| made_from == wanted) {
        return Ok(python);
    }

    run(command(workspace, "python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    let mut pip = command(workspace, &python);
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input"]);
    // Python compiles what it imports; most of what the big packages bring it never does.
    pip.args(["--no-compile", "--only-binary=:all:", "--require-hashes", "-r"]);
    run(pip.arg(&requirements))?;
    // Written last: half an installation is made anew.
    std::fs::write(&stamp, wanted).map_err(Failure::file("write", &stamp))?;
    Ok(python)
}

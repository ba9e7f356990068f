//! Runs a scenario through `bess run`, with the packed FMUs where they fit.

use crate::{
    error::Failure,
    fmu::{CONTROLLER, GRID},
    process::{command, run as start},
    workspace::Workspace,
};
use std::{ffi::OsString, path::Path};

/// Couples controller and grid; results go to results/NAME/.
pub fn run(workspace: &Workspace, scenario: &Path, extra: &[String]) -> Result<(), Failure> {
    let here = std::env::current_dir().map_err(Failure::file("find", "."))?;
    let mut bess = command(workspace, workspace.bess());
    bess.args(arguments(&here, scenario)?).args(extra);
    start(&mut bess)
}

/// Runs Case 1 once more with each FMU in a process of its own: the trajectory must be the same, byte for byte.
pub fn isolated(workspace: &Workspace) -> Result<(), Failure> {
    let case = Path::new("case1");
    let folder = "results/case1-isolated";
    let mut bess = command(workspace, workspace.bess());
    bess.args(["run", "case1", "--isolate", "--no-report", "--quiet", "-o", folder]);
    start(bess.args(["--controller", CONTROLLER, "--grid", GRID]))?;
    let read = |folder: &Path| {
        let path = workspace.root.join(folder).join("trajectory.csv");
        std::fs::read(&path).map_err(Failure::file("read", &path))
    };
    if read(Path::new(folder))? == read(Path::new(&results(case)?))? {
        println!("case1 --isolate: the same trajectory, byte for byte");
        Ok(())
    } else {
        Err(Failure::Other("case1: the trajectory with --isolate differs from the one without".to_owned()))
    }
}

/// Where `bess run` leaves what it made, from the workspace root.
pub fn results(scenario: &Path) -> Result<OsString, Failure> {
    let name = scenario.file_stem().ok_or_else(|| {
        Failure::Other(format!("`{}` is neither a built-in scenario nor a file", scenario.display()))
    })?;
    let mut folder = OsString::from("results/");
    folder.push(name);
    Ok(folder)
}

/// The arguments of `bess` for a scenario named by somebody who stands in the folder `here`.
fn arguments(here: &Path, scenario: &Path) -> Result<Vec<OsString>, Failure> {
    let file = here.join(scenario);
    // `bess` runs in the workspace root, but a path counts from where it was typed.
    let named = if file.is_file() { file.into_os_string() } else { scenario.as_os_str().to_owned() };
    let mut arguments = vec!["run".into(), named, "-o".into(), results(scenario)?];
    if scenario == Path::new("case1") {
        // The packed FMUs hold case1's configuration; for another scenario `bess` packs its own.
        arguments.extend(["--controller", CONTROLLER, "--grid", GRID].map(OsString::from));
    }
    Ok(arguments)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn case1_runs_with_the_packed_fmus() {
        let given = arguments(Path::new("/nowhere"), Path::new("case1")).expect("valid");
        let expected =
            "run case1 -o results/case1 --controller fmu/BessConsensus.fmu --grid fmu/BessGrid.fmu";
        assert_eq!(given, expected.split(' ').map(OsString::from).collect::<Vec<_>>());
    }

    #[test]
    fn a_file_counts_from_where_it_was_typed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("mine.json");
        std::fs::write(&file, "{}").expect("writable");
        let given = arguments(folder.path(), Path::new("mine.json")).expect("valid");
        assert_eq!(given, ["run".into(), file.into_os_string(), "-o".into(), "results/mine".into()]);
    }

    #[test]
    fn a_path_without_a_name_is_refused() {
        assert!(arguments(Path::new("/"), Path::new("..")).is_err());
    }
}

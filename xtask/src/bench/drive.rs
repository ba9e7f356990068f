//! benches/peer_c: the driver that calls FMUs, the peer in C, and the measurements that both are given. Compiles,
//! unpacks and records; judges nothing.

use super::program::last_line;
use crate::{
    error::Failure,
    fmu,
    process::{command, output, run},
    workspace::Workspace,
};
use serde_json::Value;
use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

/// What the driver is told of one FMU: library, GUID, resources, value reference of `P[1]`.
pub struct Fmu {
    pub words: [String; 4],
}

impl Fmu {
    /// An unpacked archive.
    pub fn unpack(workspace: &Workspace, archive: &Path, to: &Path, first: u32) -> Result<Self, Failure> {
        // What an FMU of before had and this one has not must not be found.
        if to.exists() {
            std::fs::remove_dir_all(to).map_err(Failure::file("remove", to))?;
        }
        run(command(workspace, "python3").args(["-m", "zipfile", "-e"]).arg(archive).arg(to))?;
        let description = to.join("modelDescription.xml");
        let text = std::fs::read_to_string(&description).map_err(Failure::file("read", &description))?;
        let attribute = |name: &str| {
            let start = text.find(&format!(" {name}=\""))? + name.len() + 3;
            text.get(start..)?.split('"').next().map(str::to_owned)
        };
        let (Some(guid), Some(identifier)) = (attribute("guid"), attribute("modelIdentifier")) else {
            return Err(Failure::Other(format!("{} has no guid or modelIdentifier", description.display())));
        };
        let library = to.join("binaries/linux64").join(format!("{identifier}.so"));
        let resources = format!("file://{}", to.join("resources").display());
        Ok(Self { words: [library.display().to_string(), guid, resources, first.to_string()] })
    }
}

/// The driver, ready.
pub struct Driver {
    /// Where everything lies.
    pub folder: PathBuf,
    program: PathBuf,
    /// The measurements.
    pub inputs: PathBuf,
    /// Our FMU.
    pub ours: Fmu,
}

impl Driver {
    /// Builds the FMUs and the driver, and records Case 1.
    pub fn new(workspace: &Workspace) -> Result<Self, Failure> {
        fmu::build_and_pack(workspace)?;
        let folder = workspace.target.join("bench/fmu");
        std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
        let program = folder.join("drive");
        compile(workspace, "drive.c", &["-O2"], &program)?;
        let ours = Fmu::unpack(workspace, &workspace.root.join(fmu::CONTROLLER), &folder.join("ours"), 1)?;
        let inputs = folder.join("inputs.txt");
        record(workspace, &folder.join("case1"), &inputs)?;
        Ok(Self { folder, program, inputs, ours })
    }

    /// The same as a library.
    pub fn library(&self, workspace: &Workspace) -> Result<PathBuf, Failure> {
        let library = self.folder.join("drive.so");
        compile(workspace, "drive.c", &["-O2", "-fPIC", "-shared", "-DWITHIN_PYTHON"], &library)?;
        Ok(library)
    }

    /// The peer in C.
    pub fn peer_c(&self, workspace: &Workspace) -> Result<Fmu, Failure> {
        let library = self.folder.join("peer.so");
        compile(workspace, "peer.c", &["-O3", "-fPIC", "-shared", "-fvisibility=hidden"], &library)?;
        let library = library.display().to_string();
        // As in peer.c, which needs no resources.
        let guid = "1a0f4c1e-6f5b-4d0c-9d8e-7c5d51c1b007".to_owned();
        Ok(Fmu { words: [library, guid, String::new(), "1".into()] })
    }

    /// Ours and another in turn.
    pub fn compare(&self, workspace: &Workspace, rounds: &str, other: &Fmu) -> Result<Value, Failure> {
        let mut drive = command(workspace, &self.program);
        drive.arg("compare").arg(&self.inputs).arg(rounds).args(&self.ours.words).args(&other.words);
        last_line(&output(&mut drive)?)
    }

    /// Program and arguments of a run of so many steps of one FMU.
    pub fn count(&self, steps: &str, fmu: &Fmu) -> (PathBuf, Vec<String>) {
        let inputs = self.inputs.display().to_string();
        let head = ["count".to_owned(), inputs, steps.to_owned()];
        (self.program.clone(), head.into_iter().chain(fmu.words.iter().cloned()).collect())
    }
}

fn compile(workspace: &Workspace, source: &str, flags: &[&str], to: &Path) -> Result<(), Failure> {
    let mut cc = command(workspace, "cc");
    cc.args(flags).args(["-Wall", "-Wextra", "-I", "src/fmi/headers"]);
    cc.arg(format!("benches/peer_c/{source}")).arg("-o").arg(to).args(["-ldl", "-lm"]);
    run(&mut cc)
}

/// Quantities that the controller measures, in the order of its inputs.
const MEASURED: [&str; 5] = ["P", "Q", "V", "omega", "E"];
const AGENTS: usize = 7;
/// The controller of Case 1 is switched on; before, it holds its setpoints.
const ENABLED_S: f64 = 20.0;
const STEP_S: f64 = 0.01;

/// Runs Case 1 and writes what the controller measured in it, as the driver reads it.
fn record(workspace: &Workspace, folder: &Path, to: &Path) -> Result<(), Failure> {
    output(
        command(workspace, workspace.bess()).args(["run", "case1", "--set", "compare=[]", "-o"]).arg(folder),
    )?;
    let path = folder.join("trajectory.csv");
    let text = std::fs::read_to_string(&path).map_err(Failure::file("read", &path))?;
    let lines = measurements(&text)
        .ok_or_else(|| Failure::Other(format!("{} lacks columns of the grid", path.display())))?;
    std::fs::write(to, lines).map_err(Failure::file("write", to))
}

/// `None` where a column or a value is missing.
fn measurements(trajectory: &str) -> Option<String> {
    let mut rows = trajectory.lines();
    let names: Vec<&str> = rows.next()?.split(',').collect();
    let wanted = MEASURED.iter().flat_map(|name| (1..=AGENTS).map(move |i| format!("grid.{name}[{i}]")));
    let columns: Vec<usize> =
        wanted.map(|name| names.iter().position(|found| *found == name)).collect::<Option<_>>()?;
    let time = names.iter().position(|name| *name == "time")?;
    let (mut lines, mut steps) = (String::new(), 0);
    for row in rows {
        let values: Vec<&str> = row.split(',').collect();
        if values.get(time)?.parse::<f64>().ok()? < ENABLED_S {
            continue;
        }
        for &column in &columns {
            write!(lines, "{} ", values.get(column)?).ok()?;
        }
        lines.push('\n');
        steps += 1;
    }
    (steps > 0).then(|| format!("{steps} {STEP_S}\n{lines}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_are_taken_from_when_the_controller_is_on() {
        let names: Vec<String> =
            MEASURED.iter().flat_map(|name| (1..=AGENTS).map(move |i| format!("grid.{name}[{i}]"))).collect();
        let row = |time: &str, of: &str| format!("{time},x,{}\n", vec![of; names.len()].join(","));
        let head = format!("time,other,{}\n", names.join(","));
        let text = format!("{head}{}{}", row("19.99", "1"), row("20", "0.25"));
        let found = measurements(&text).expect("complete");
        assert_eq!(found, format!("1 0.01\n{}\n", "0.25 ".repeat(35)));
        assert!(measurements(&text.replace("grid.E[7]", "grid.E[8]")).is_none());
        assert!(measurements(&head).is_none());
    }
}

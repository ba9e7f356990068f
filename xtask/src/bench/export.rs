//! Export of a controller for 10,000 agents, against the time that FMPy takes to read its model description (its
//! own reading with the default settings, validation included); and its load, from the file to an instance, here
//! and in FMPy.

use super::program::{build, last_line, measure, number};
use super::row::{Bar, Row, median};
use crate::{
    error::Failure,
    fmu,
    process::{command, output},
    python,
    workspace::Workspace,
};
use serde_json::{Value, json};

const AGENTS: &str = "10000";
/// Time of the export, whole but for the start of the program, over that of the reading.
const READING: Bar = Bar::AtMost(1.0);

const READ: &str = "import json, sys, time, fmpy
begin = time.perf_counter()
description = fmpy.read_model_description(sys.argv[1])
elapsed = time.perf_counter() - begin
print(json.dumps({'s': elapsed, 'version': fmpy.__version__, 'variables': len(description.modelVariables)}))";

const LOAD: &str = "import json, sys, time, fmpy, fmpy.fmi2
begin = time.perf_counter()
description = fmpy.read_model_description(sys.argv[1])
folder = fmpy.extract(sys.argv[1])
slave = fmpy.fmi2.FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName='load',
                            modelIdentifier=description.coSimulation.modelIdentifier)
slave.instantiate()
print(json.dumps({'s': time.perf_counter() - begin, 'version': fmpy.__version__}))
slave.freeInstance()
import shutil; shutil.rmtree(folder)";

/// Both rows.
pub fn rows(workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
    fmu::build_and_pack(workspace)?;
    let folder = workspace.target.join("bench/export");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let archive = folder.join("BessConsensus.fmu");
    let program = build(workspace, "controller")?;
    let (libraries, file) =
        (workspace.plain_libraries().display().to_string(), archive.display().to_string());
    let name = "export of 10,000 agents against FMPy's reading";
    let load = "load of 10,000 agents against FMPy's";
    let python = match python::environment(workspace, "fmpy") {
        Ok(python) => python,
        Err(failure) => {
            let why = failure.to_string();
            return Ok(vec![
                Row::missing(name, "x the time", READING, why.as_str()),
                Row::unknown(load, "x the time", why.as_str()),
            ]);
        }
    };
    let (mut ours, mut theirs, mut last) = (Vec::new(), Vec::new(), Value::Null);
    let (mut loads, mut their_loads) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let arguments = ["export", "--agents", AGENTS, "--folder", &libraries, "--to", &file];
        ours.push(number(&measure(workspace, &program, &arguments)?, "s")?);
        last = last_line(&output(command(workspace, &python).args(["-c", READ]).arg(&archive))?)?;
        theirs.push(number(&last, "s")?);
        loads.push(number(&measure(workspace, &program, &["load", &file])?, "s")?);
        let loaded = last_line(&output(command(workspace, &python).args(["-c", LOAD]).arg(&archive))?)?;
        their_loads.push(number(&loaded, "s")?);
    }
    let version = last["version"].as_str().unwrap_or("?");
    let read = format!(
        "{:.2} s here, {:.2} s in FMPy {version} for {} variables, validation included",
        median(ours.clone()),
        median(theirs.clone()),
        last["variables"]
    );
    let loaded = format!(
        "from the file to an instance: {:.2} s in the harness, {:.2} s in FMPy {version}",
        median(loads.clone()),
        median(their_loads.clone()),
    );
    Ok(vec![row(name, (ours, theirs), read).bar(READING), row(load, (loads, their_loads), loaded)])
}

/// The median of the ratios of what was measured in turn.
fn row(name: &str, (ours, theirs): (Vec<f64>, Vec<f64>), note: String) -> Row {
    let ratios = ours.iter().zip(&theirs).map(|(ours, theirs)| ours / theirs).collect();
    let detail = json!({ "ours_s": ours, "theirs_s": theirs });
    Row::figure(name, median(ratios), "x the time").note(note, detail)
}

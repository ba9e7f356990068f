//! Export of a controller for 10,000 agents, against the time that FMPy takes to read its model description (its
//! own reading with the default settings, validation included).

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

/// One row.
pub fn rows(workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
    fmu::build_and_pack(workspace)?;
    let folder = workspace.target.join("bench/export");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let archive = folder.join("BessConsensus.fmu");
    let program = build(workspace, "controller")?;
    let (libraries, file) =
        (workspace.plain_libraries().display().to_string(), archive.display().to_string());
    let name = "export of 10,000 agents against FMPy's reading";
    let python = match python::environment(workspace, "fmpy") {
        Ok(python) => python,
        Err(failure) => return Ok(vec![Row::missing(name, "x the time", READING, failure.to_string())]),
    };
    let (mut ours, mut theirs, mut last) = (Vec::new(), Vec::new(), Value::Null);
    for _ in 0..runs {
        let arguments = ["export", "--agents", AGENTS, "--folder", &libraries, "--to", &file];
        ours.push(number(&measure(workspace, &program, &arguments)?, "s")?);
        last = last_line(&output(command(workspace, &python).args(["-c", READ]).arg(&archive))?)?;
        theirs.push(number(&last, "s")?);
    }
    let ratios = ours.iter().zip(&theirs).map(|(ours, theirs)| ours / theirs).collect();
    let note = format!(
        "{:.2} s here, {:.2} s in FMPy {} for {} variables, validation included",
        median(ours.clone()),
        median(theirs.clone()),
        last["version"].as_str().unwrap_or("?"),
        last["variables"]
    );
    let detail = json!({ "ours_s": ours, "theirs_s": theirs });
    Ok(vec![Row::figure(name, median(ratios), "x the time").bar(READING).note(note, detail)])
}

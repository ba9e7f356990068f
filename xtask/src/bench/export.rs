//! Export of a controller for 10,000 agents, against the time that FMPy takes to read its model description (its
//! own reading with the default settings, validation included).

use super::program::{last_line, number};
use super::row::{Bar, Row, median};
use crate::{
    error::Failure,
    fmu,
    process::{command, output},
    python,
    workspace::Workspace,
};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

const AGENTS: u32 = 10_000;
/// Time of the whole `bess export` over that of the reading.
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
    let (scenario, archive) = (folder.join("scenario.json"), folder.join("BessConsensus.fmu"));
    std::fs::write(&scenario, ring().to_string()).map_err(Failure::file("write", &scenario))?;
    let name = "export of 10,000 agents against FMPy's reading";
    let python = match python::environment(workspace, "fmpy") {
        Ok(python) => python,
        Err(failure) => return Ok(vec![Row::missing(name, "x the time", READING, failure.to_string())]),
    };
    let (mut ours, mut theirs, mut last) = (Vec::new(), Vec::new(), Value::Null);
    for _ in 0..runs {
        ours.push(export(workspace, &scenario, &archive)?);
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

fn export(workspace: &Workspace, scenario: &Path, archive: &Path) -> Result<f64, Failure> {
    let mut bess = command(workspace, workspace.bess());
    bess.args(["export", "controller"]).arg(scenario).arg("-o").arg(archive);
    let begin = Instant::now();
    output(&mut bess)?;
    Ok(begin.elapsed().as_secs_f64())
}

/// A ring in which every agent talks to the two on either side.
fn ring() -> Value {
    let edges = (0..AGENTS).flat_map(|i| [(i, (i + 1) % AGENTS), (i, (i + 2) % AGENTS)]);
    let edges: Vec<Value> = edges.map(|(a, b)| json!({ "a": a + 1, "b": b + 1, "weight": 0.8 })).collect();
    let bess: Vec<Value> =
        (0..AGENTS).map(|i| json!({ "bus": i + 1, "K_P": 0.004, "K_Q": 0.02, "capacity": 10.0 })).collect();
    json!({
        "name": "ring", "stop_s": 10, "step_s": 0.01, "bess": bess,
        "communication": { "graphs": [{ "name": "ring", "edges": edges, "pins": [{ "agent": 1 }] }] },
    })
}

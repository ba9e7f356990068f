//! What a federation costs: steps a second of `bess federate` with 2, 4, 8 and 16 federates over every core of HELICS,
//! against the bare ring of benches/federation.rs, and against one process.

use super::program::{build, last_line, number};
use super::row::{Bar, Row, median};
use crate::{
    error::Failure,
    process::{command, output, run},
    python,
    workspace::Workspace,
};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const AS_FAST_AS_BARE: Bar = Bar::AtLeast(0.8);

/// Batteries: enough for a part each in the largest federation.
const BATTERIES: usize = 15;
/// Federates, the grid among them.
const SIZES: [usize; 4] = [2, 4, 8, 16];
const CORES: [&str; 3] = ["zmq", "tcp", "ipc"];
/// Steps of 10 ms.
const STEPS: usize = 1000;

/// Rows for each size and core.
pub fn rows(workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
    let ring = build(workspace, "federation")?;
    let python = python::environment(workspace, "federation")?;
    // The ring and the federation load the same library.
    let mut where_is_it = command(workspace, &python);
    let package = output(where_is_it.args(["-c", "import helics; print(helics.__path__[0])"]))?;
    let folder = workspace.target.join("bench/federation");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let mut rows = Vec::new();
    for size in SIZES {
        let file = folder.join(format!("f{size}.json"));
        let text = scenario(size - 1).to_string();
        std::fs::write(&file, text).map_err(Failure::file("write", &file))?;
        let one = one_process(workspace, &file, &folder, runs).map_err(|failure| failure.to_string());
        for core in CORES {
            let measured = federation(workspace, &ring, (package.trim(), core, size), (&file, &folder), runs)
                .map_err(|failure| failure.to_string());
            match (measured, &one) {
                (Ok(measured), Ok(one)) => rows.extend(measured.rows(core, size, *one)),
                (measured, one) => {
                    let why = measured.err().or(one.as_ref().err().cloned()).unwrap_or_default();
                    let name = format!("federation, {size} federates, {core}, against the bare ring");
                    rows.push(Row::missing(name, "x", AS_FAST_AS_BARE, why));
                }
            }
        }
    }
    Ok(rows)
}

/// Steps a second.
struct Measured {
    vectors: f64,
    packed: f64,
    ring: f64,
    ring_in_turns: f64,
    values: usize,
}

impl Measured {
    fn rows(&self, core: &str, size: usize, one: f64) -> Vec<Row> {
        let name = |what: &str| format!("federation, {size} federates, {core}, {what}");
        let note = format!(
            "{:.0} steps/s packed, {:.0} with a vector for every array; the ring, {} numbers a step each, {:.0}; the \
             ring in two turns, as grid and controllers take them, {:.0}: {:.2} x that",
            self.packed,
            self.vectors,
            self.values,
            self.ring,
            self.ring_in_turns,
            self.packed / self.ring_in_turns
        );
        let detail = json!({
            "steps_per_s": {"packed": self.packed, "vectors": self.vectors, "ring": self.ring,
                "ring_in_turns": self.ring_in_turns, "one_process": one},
            "values_per_federate": self.values,
        });
        vec![
            Row::figure(name("against the bare ring"), self.packed / self.ring, "x")
                .bar(AS_FAST_AS_BARE)
                .note(note, detail),
            Row::figure(name("against one process"), self.packed / one, "x")
                .note(format!("one process: {one:.0} steps/s"), Value::Null),
        ]
    }
}

fn federation(
    workspace: &Workspace,
    ring: &PathBuf,
    (package, core, size): (&str, &str, usize),
    (file, folder): (&Path, &Path),
    runs: u32,
) -> Result<Measured, Failure> {
    let bess = workspace.release().join("bess");
    let steps_per_s = |publish: &str| -> Result<f64, Failure> {
        let mut speeds = Vec::new();
        for _ in 0..runs {
            let mut federate = command(workspace, &bess);
            federate.arg("federate").arg(file).args([
                "--core",
                core,
                "--publish",
                publish,
                "--helics",
                package,
            ]);
            run(federate.args(["--quiet", "--no-report", "-o"]).arg(folder.join("out")))?;
            speeds.push(speed(&folder.join("out"))?);
        }
        Ok(median(speeds))
    };
    let (vectors, packed) = (steps_per_s("vectors")?, steps_per_s("packed")?);
    // Five measurements and four setpoints a battery, and ten numbers each way over every link between parts.
    let links = if size > 2 { size - 1 } else { 0 };
    let values = (9 * BATTERIES + 20 * links).div_ceil(size);
    let bare = |turns: &str| -> Result<f64, Failure> {
        let mut speeds = Vec::new();
        for _ in 0..runs {
            let (size, steps, values) = (size.to_string(), STEPS.to_string(), values.to_string());
            let arguments = ["ring", &size, &steps, &values, core, turns];
            let mut program = command(workspace, ring);
            let value = last_line(&output(program.args(arguments).env("BESS_HELICS", package))?)?;
            speeds.push(number(&value, "steps")? / number(&value, "took_s")?);
        }
        Ok(median(speeds))
    };
    Ok(Measured { vectors, packed, ring: bare("1")?, ring_in_turns: bare("2")?, values })
}

fn one_process(workspace: &Workspace, file: &Path, folder: &Path, runs: u32) -> Result<f64, Failure> {
    let mut speeds = Vec::new();
    for _ in 0..runs {
        let mut one = command(workspace, workspace.release().join("bess"));
        run(one.arg("run").arg(file).args(["--quiet", "--no-report", "-o"]).arg(folder.join("one")))?;
        speeds.push(speed(&folder.join("one"))?);
    }
    Ok(median(speeds))
}

/// Steps a second of a run, from its summary.
fn speed(folder: &Path) -> Result<f64, Failure> {
    let path = folder.join("summary.json");
    let text = std::fs::read_to_string(&path).map_err(Failure::file("read", &path))?;
    let summary: Value = serde_json::from_str(&text)
        .map_err(|error| Failure::Other(format!("{}: {error}", path.display())))?;
    Ok(STEPS as f64 / number(&summary, "wall_s")?)
}

/// Fifteen batteries in a ring, in so many clusters.
fn scenario(clusters: usize) -> Value {
    let bess = |bus: usize| json!({"bus": bus, "K_P": 0.004, "K_Q": 0.02, "soc_start": 0.7, "omega_set_start": 1.0 + 1e-4 * (bus % 4) as f64});
    let edge = |a: usize| json!({"a": a, "b": a % BATTERIES + 1, "weight": 1.0});
    let cluster = |i: usize| i * clusters / BATTERIES + 1;
    json!({
        "extends": "case1", "name": "federation", "stop_s": STEPS as f64 * 0.01, "step_s": 0.01,
        "bess": (1..=BATTERIES).map(bess).collect::<Vec<_>>(),
        "compare": [], "events": [], "initial": {"controller.enable": true},
        "communication": {"graphs": [{
            "name": "ring",
            "edges": (1..=BATTERIES).map(edge).collect::<Vec<_>>(),
            "pins": [{"agent": 1, "weight": 1.0}],
            "clusters": (0..BATTERIES).map(cluster).collect::<Vec<_>>(),
        }]},
    })
}

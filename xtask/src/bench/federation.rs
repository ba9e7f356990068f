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
    let mut steps_s: Vec<(usize, &str, f64)> = Vec::new();
    for size in SIZES {
        let file = folder.join(format!("f{size}.json"));
        let text = scenario(size - 1).to_string();
        std::fs::write(&file, text).map_err(Failure::file("write", &file))?;
        let one = one_process(workspace, &file, &folder, runs).map_err(|failure| failure.to_string());
        for core in CORES {
            let measured = federation(workspace, &ring, (package.trim(), core, size), (&file, &folder), runs)
                .map_err(|failure| failure.to_string());
            match (measured, &one) {
                (Ok(measured), Ok(one)) => {
                    steps_s.push((size, core, 1.0 / measured.packed));
                    rows.extend(measured.rows(core, size, *one));
                }
                (measured, one) => {
                    let why = measured.err().or(one.as_ref().err().cloned()).unwrap_or_default();
                    let name = format!("federation, {size} federates, {core}, against the bare ring");
                    rows.push(Row::missing(name, "x", AS_FAST_AS_BARE, why));
                }
            }
        }
    }
    rows.extend(CORES.iter().filter_map(|core| model_row(core, &steps_s)));
    Ok(rows)
}

/// Messages of one step, packed: two publications between the grid and each part, two over each link between parts, and
/// a request and a grant of time for each that depends on another.
fn messages(federates: usize) -> f64 {
    let parts = federates as f64 - 1.0;
    let links = if federates > 2 { parts } else { 0.0 };
    2.0 * parts + 2.0 * links + 2.0 * (2.0 * parts + 2.0 * links)
}

/// How far the model of docs/distributed.md, a step takes A + S messages, is from what was measured; A and S fitted.
fn model_row(core: &str, steps_s: &[(usize, &str, f64)]) -> Option<Row> {
    let points: Vec<(f64, f64)> =
        steps_s.iter().filter(|(_, of, _)| *of == core).map(|(size, _, t)| (messages(*size), *t)).collect();
    if points.len() < 3 {
        return None;
    }
    let (a, s) = fit(&points);
    let miss = points.iter().map(|(x, t)| ((a + s * x) / t - 1.0).abs()).fold(0.0, f64::max);
    let paper = a + s * messages(1001);
    let note = format!(
        "A = {:.0} us, S = {:.1} us a message; on paper, 1,000 parts of one ring through one broker: {:.1} ms a step",
        1e6 * a,
        1e6 * s,
        1e3 * paper
    );
    let name = format!("federation, {core}, the cost model's worst miss");
    Some(
        Row::figure(name, 100.0 * miss, "%").note(note, json!({"A_s": a, "S_s": s, "step_of_1000_s": paper})),
    )
}

/// A and S of t = A + S x with the least squares of relative errors; two numbers in closed form.
fn fit(points: &[(f64, f64)]) -> (f64, f64) {
    // Each equation divided by t: 1 = A / t + S x / t.
    let sum = |of: fn(f64, f64) -> f64| points.iter().map(|(x, t)| of(*x, *t)).sum::<f64>();
    let (aa, ab, bb) = (sum(|_, t| 1.0 / (t * t)), sum(|x, t| x / (t * t)), sum(|x, t| x * x / (t * t)));
    let (a1, b1) = (sum(|_, t| 1.0 / t), sum(|x, t| x / t));
    let determinant = aa * bb - ab * ab;
    ((a1 * bb - b1 * ab) / determinant, (aa * b1 - ab * a1) / determinant)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_again() {
        let points = [6.0, 36.0, 84.0, 180.0].map(|x| (x, 2e-4 + 5e-6 * x));
        let (a, s) = fit(&points);
        assert!((a - 2e-4).abs() < 1e-15 && (s - 5e-6).abs() < 1e-17, "{a} {s}");
    }
}

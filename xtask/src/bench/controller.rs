//! The controller's step for many agents of degree 4, per undirected edge, against what the machine needs for the
//! least that it can be; and its memory. Floor and step in turn in one process, so that a machine whose speed
//! drifts is the same for both.

use super::program::{build, measure, median_of, number};
use super::row::{Bar, Row, median};
use crate::{error::Failure, workspace::Workspace};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Time of a step with eta = 0.5 over the larger of square roots and memory.
const FLOOR: Bar = Bar::AtMost(1.5);
/// Time of a step with another eta over the vector power of its values.
const POWER: Bar = Bar::AtMost(1.5);
/// Time per edge with 1e6 agents over that with 1e4.
const GROWTH: Bar = Bar::AtMost(1.5);
/// Time per edge in random order over that in local order.
const SHUFFLED: Bar = Bar::AtMost(2.0);
/// Memory of the process with a delay of 0.5 s at steps of 10 ms.
const MEMORY: Bar = Bar::AtMost(4.0);
/// Laws per edge.
const LAWS: f64 = 5.0;

/// All rows.
pub fn rows(workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
    let program = build(workspace, "controller")?;
    let steps = runs.max(5).to_string();
    let run = |options: &[&str]| {
        let all: Vec<&str> = ["step", "--steps", &steps].into_iter().chain(options.iter().copied()).collect();
        measure(workspace, &program, &all)
    };
    let million = run(&["--agents", "1000000"])?;
    let other = run(&["--agents", "1000000", "--eta", "0.3"])?;
    let few = run(&["--agents", "10000", "--floor", "no"])?;
    let shuffled = run(&["--agents", "1000000", "--order", "random", "--floor", "no"])?;
    let per_edge = per_edge_s(&million)?;
    Ok(vec![
        against_floor(&million)?,
        against_power(&other)?,
        growth("controller step per edge, 1e6 agents against 1e4", per_edge, per_edge_s(&few)?, GROWTH),
        growth(
            "controller step per edge, random order against local",
            per_edge_s(&shuffled)?,
            per_edge,
            SHUFFLED,
        ),
        memory(workspace, &program)?,
    ])
}

/// Median time per undirected edge, s.
fn per_edge_s(run: &Value) -> Result<f64, Failure> {
    Ok(median_of(run, "step_s") / number(run, "edges")?)
}

fn numbers(run: &Value, key: &str) -> Vec<f64> {
    run[key].as_array().map(|all| all.iter().filter_map(Value::as_f64).collect()).unwrap_or_default()
}

fn against_floor(run: &Value) -> Result<Row, Failure> {
    let (edges, bytes) = (number(run, "edges")?, number(run, "bytes")?);
    let rounds = numbers(run, "step_s")
        .into_iter()
        .zip(numbers(run, "root_s").into_iter().zip(numbers(run, "triad_bytes_per_s")));
    let ratios = rounds.map(|(step, (root, triad))| step / (LAWS * edges * root).max(bytes / triad));
    let value = median(ratios.collect());
    let triad = median_of(run, "triad_bytes_per_s");
    let note = format!(
        "{:.1} ns per edge; roots {:.1} ns; {:.0} bytes at {:.1} GB/s {:.1} ns",
        1e9 * per_edge_s(run)?,
        1e9 * LAWS * median_of(run, "root_s"),
        bytes / edges,
        1e-9 * triad,
        1e9 * bytes / edges / triad,
    );
    let name = "controller step, 1e6 agents, eta 0.5, against the floor";
    Ok(Row::figure(name, value, "x the time").bar(FLOOR).note(note, json!({ "run": run })))
}

fn against_power(run: &Value) -> Result<Row, Failure> {
    let edges = number(run, "edges")?;
    let rounds = numbers(run, "step_s").into_iter().zip(numbers(run, "power_s"));
    let value = median(rounds.map(|(step, power)| step / (LAWS * edges * power)).collect());
    let note = format!(
        "{:.1} ns per edge; five vector powers {:.1} ns",
        1e9 * per_edge_s(run)?,
        1e9 * LAWS * median_of(run, "power_s")
    );
    let name = "controller step, 1e6 agents, eta 0.3, against the power";
    Ok(Row::figure(name, value, "x the time").bar(POWER).note(note, json!({ "run": run })))
}

fn growth(name: &str, time: f64, beside: f64, bar: Bar) -> Row {
    let note = format!("{:.1} and {:.1} ns", 1e9 * time, 1e9 * beside);
    Row::figure(name, time / beside, "x the time").bar(bar).note(note, Value::Null)
}

fn memory(workspace: &Workspace, program: &PathBuf) -> Result<Row, Failure> {
    let options = ["step", "--agents", "1000000", "--delay-s", "0.5", "--steps", "60", "--floor", "no"];
    let run = measure(workspace, program, &options)?;
    let name = "memory, 1e6 agents with 0.5 s of delay at 10 ms";
    let gigabytes = match number(&run, "peak_memory_bytes") {
        Ok(bytes) => 1e-9 * bytes,
        Err(failure) => return Ok(Row::missing(name, "GB", MEMORY, failure.to_string())),
    };
    let note =
        format!("the whole process at its largest; {:.1} ns per edge and step", 1e9 * per_edge_s(&run)?);
    Ok(Row::figure(name, gigabytes, "GB").bar(MEMORY).note(note, json!({ "run": run })))
}

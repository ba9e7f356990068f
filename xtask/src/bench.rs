//! Measures speed against the bars. A missed bar is a figure, not an error: what a machine is able to do
//! is no property of the source.

use crate::{
    error::Failure,
    fmu::{self, CONTROLLER, GRID},
    process::command,
    workspace::Workspace,
};
use serde_json::{Value, json};
use std::time::Instant;

/// One measured figure.
#[derive(Clone, Debug, PartialEq)]
struct Figure {
    /// What was measured.
    name: &'static str,
    /// The median.
    value: f64,
    /// Its unit: `x` is times real time.
    unit: &'static str,
    /// What it should at least reach, if there is a bar.
    bar: Option<f64>,
}

impl Figure {
    fn met(&self) -> Option<bool> {
        self.bar.map(|bar| self.value >= bar)
    }

    fn line(&self) -> String {
        let verdict = match (self.bar, self.met()) {
            (Some(bar), Some(true)) => format!("bar {bar} {}: met", self.unit),
            (Some(bar), _) => format!("bar {bar} {}: MISSED", self.unit),
            (None, _) => String::new(),
        };
        format!("{:28} {:>10.1} {:2}  {verdict}", self.name, self.value, self.unit).trim_end().to_string()
    }

    fn json(&self) -> Value {
        json!({ "name": self.name, "value": self.value, "unit": self.unit, "bar": self.bar, "met": self.met() })
    }
}

/// Case 1 runs 120 s.
const CASE1_STOP_S: f64 = 120.0;
/// The bar for Case 1 through the harness, trajectory recorded: times real time.
const CASE1_BAR: f64 = 500.0;

/// Measures everything, prints it, writes target/bench/summary.json.
pub fn run(workspace: &Workspace, runs: u32) -> Result<(), Failure> {
    fmu::build_and_pack(workspace)?;
    let mut figures = Vec::new();
    figures.extend(case1(workspace, runs)?);

    println!("median of {runs} runs:");
    for figure in &figures {
        println!("{}", figure.line());
    }
    let path = workspace.target.join("bench/summary.json");
    let rows: Vec<Value> = figures.iter().map(Figure::json).collect();
    let text = format!("{:#}\n", Value::from(rows));
    std::fs::write(&path, text).map_err(Failure::file("write", &path))?;
    println!("{}", path.display());
    Ok(())
}

/// Case 1: the coupled simulation as `bess` times it, and the whole command with its reports.
fn case1(workspace: &Workspace, runs: u32) -> Result<[Figure; 2], Failure> {
    let folder = workspace.target.join("bench/case1");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let (mut coupling, mut whole) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let mut bess = command(workspace, workspace.bess());
        bess.args(["run", "case1", "--controller", CONTROLLER, "--grid", GRID, "-o"]).arg(&folder);
        let start = Instant::now();
        crate::process::output(&mut bess)?;
        whole.push(CASE1_STOP_S / start.elapsed().as_secs_f64());
        coupling.push(real_time_factor(&folder.join("summary.json"))?);
    }
    Ok([
        Figure { name: "case1, simulation", value: median(coupling), unit: "x", bar: Some(CASE1_BAR) },
        Figure { name: "case1, whole command", value: median(whole), unit: "x", bar: None },
    ])
}

/// The figure `real_time_factor` of a run's summary.json.
fn real_time_factor(path: &std::path::Path) -> Result<f64, Failure> {
    let text = std::fs::read_to_string(path).map_err(Failure::file("read", path))?;
    serde_json::from_str::<Value>(&text)
        .ok()
        .and_then(|summary| summary.get("real_time_factor")?.as_f64())
        .ok_or_else(|| Failure::Other(format!("{} has no number `real_time_factor`", path.display())))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match (values.get(middle), values.len() % 2) {
        (Some(&upper), 1) => upper,
        (Some(&upper), _) => (values.get(middle - 1).copied().unwrap_or(upper) + upper) / 2.0,
        (None, _) => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_odd_and_even_counts() {
        assert_eq!(median(vec![3.0, 1.0, 100.0]), 3.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 100.0]), 3.0);
        assert!(median(vec![]).is_nan());
    }

    #[test]
    fn a_missed_bar_is_shown_and_written() {
        let mut figure = Figure { name: "speed", value: 499.9, unit: "x", bar: Some(500.0) };
        assert_eq!(figure.met(), Some(false));
        assert!(figure.line().ends_with("bar 500 x: MISSED"));
        figure.value = 500.0;
        assert!(figure.line().ends_with("bar 500 x: met"));
        assert_eq!(figure.json()["met"], true);
        figure.bar = None;
        assert!(figure.json()["met"].is_null());
        assert!(figure.line().ends_with(" x"));
    }

    #[test]
    fn a_summary_without_the_figure_is_an_error() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("summary.json");
        std::fs::write(&path, r#"{"real_time_factor": 512.5}"#).expect("writable");
        assert_eq!(real_time_factor(&path).expect("is there"), 512.5);
        std::fs::write(&path, r#"{"speed": 1}"#).expect("writable");
        assert!(real_time_factor(&path).is_err());
    }
}

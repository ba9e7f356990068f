//! One run with everything that is recorded of it.

use crate::harness::scenario::{CONTROLLER, GRID};
use crate::harness::{
    Cast, Column, FanOut, HarnessError, Memory, Observer, Outcome, Plan, Progress, Recorder, run, stage,
};
use crate::report::{Columns, ReportError};
use crate::scenario::Resolved;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::Path;
use std::time::Duration;

/// Controller outputs that the figures need besides what the agents measure.
const SHOWN: [&str; 11] =
    ["P_set", "Q_set", "T_omega", "T_P", "u_omega", "u_P", "u_E", "u_V", "u_Q", "omega_set", "V_set"];

/// What is left of a run.
pub struct Record {
    /// Steps, times, warnings.
    pub outcome: Outcome,
    plan: Plan,
    memory: Memory,
    time_s: Vec<f64>,
    named: Vec<(String, Vec<f64>)>,
}

/// Runs a scenario; with a folder, `trajectory.csv` is written there while it runs.
pub fn record(
    resolved: &Resolved,
    cast: &Cast,
    folder: Option<&Path>,
    quiet: bool,
) -> Result<Record, HarnessError> {
    let (mut participants, plan) = stage(resolved, cast)?;
    let sources: Vec<String> = plan.connections.iter().map(|c| c.from.to_string()).collect();
    let keep = move |column: &Column| {
        sources.contains(&column.label())
            || (column.participant == CONTROLLER && SHOWN.contains(&quantity(&column.variable)))
    };
    let mut memory = Memory::new(1, keep);
    let bar = bar(quiet);
    let mut progress = Progress::new(Duration::from_millis(50), |t_s, share| {
        bar.set_position((share * 1000.0) as u64);
        bar.set_message(format!("{t_s:.0} of {:.0} s", resolved.scenario.stop_s));
    });
    let mut recorder = folder.map(|f| Recorder::new(f, u64::from(resolved.scenario.record_every)));
    let mut observers: Vec<&mut dyn Observer> = vec![&mut memory, &mut progress];
    if let Some(recorder) = &mut recorder {
        observers.push(recorder);
    }
    let outcome = run(&mut participants, &plan, &mut FanOut(observers));
    bar.finish_and_clear();
    let outcome = outcome?;
    let time_s = memory.times_ns().iter().map(|t| *t as f64 * 1e-9).collect();
    let mut named = measured(&plan, &memory, resolved.control.agents());
    for column in memory.columns().iter().filter(|c| c.participant == CONTROLLER) {
        let values = memory.values(CONTROLLER, &column.variable).unwrap_or_default();
        named.push((column.label(), values.to_vec()));
    }
    Ok(Record { outcome, plan, memory, time_s, named })
}

impl Record {
    /// What was recorded, by name. What the agents measure is there as `grid.P[i]`, ... in the
    /// controller's units, whatever the grid calls it.
    pub fn columns(&self) -> Result<Columns<'_>, ReportError> {
        Columns::new(&self.time_s, self.named.iter().map(|(name, values)| (name.as_str(), values.as_slice())))
    }

    /// max abs(sum of P_set) over all communication points, pu.
    pub fn worst_sum_of_p_set(&self, n: usize) -> f64 {
        let columns: Vec<&[f64]> =
            (1..=n).filter_map(|i| self.memory.values(CONTROLLER, &format!("P_set[{i}]"))).collect();
        let sum = |k: usize| columns.iter().filter_map(|c| c.get(k)).sum::<f64>();
        (0..self.time_s.len()).map(|k| sum(k).abs()).fold(0.0, f64::max)
    }

    /// Simulated time over wall time.
    pub fn real_time_factor(&self) -> f64 {
        (self.plan.stop_ns - self.plan.start_ns) as f64 * 1e-9 / self.outcome.total.as_secs_f64()
    }
}

/// The controller's measured inputs out of whatever feeds them.
fn measured(plan: &Plan, memory: &Memory, n: usize) -> Vec<(String, Vec<f64>)> {
    let mut all = Vec::with_capacity(5 * n);
    for quantity in ["P", "Q", "V", "omega", "E"] {
        for i in 1..=n {
            let input = format!("{quantity}[{i}]");
            let feeds =
                |c: &&crate::harness::Connection| c.to.participant == CONTROLLER && c.to.variable == input;
            let Some(connection) = plan.connections.iter().find(feeds) else {
                let is_it = |s: &&crate::harness::Setting| s.participant == CONTROLLER && s.variable == input;
                if let Some(constant) = plan.initial.iter().rev().find(is_it) {
                    let values = vec![constant.value.as_f64(); memory.times_ns().len()];
                    all.push((format!("{GRID}.{input}"), values));
                }
                continue;
            };
            let from = &connection.from;
            if let Some(values) = memory.values(&from.participant, &from.variable) {
                let scaled = values.iter().map(|v| connection.factor * v + connection.offset).collect();
                all.push((format!("{GRID}.{input}"), scaled));
            }
        }
    }
    all
}

/// `omega_set` of `omega_set[3]`.
fn quantity(variable: &str) -> &str {
    variable.split('[').next().unwrap_or(variable)
}

/// A bar on a terminal, nothing when piped or asked to be quiet.
fn bar(quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}");
    let bar = ProgressBar::new(1000);
    match style {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

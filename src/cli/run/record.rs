//! One run with everything that is recorded of it.

use crate::harness::checkpoint::Identity;
use crate::harness::scenario::{CONTROLLER, GRID};
use crate::harness::{
    Cast, Checkpoint, Column, Experiment, FanOut, HarnessError, Isolation, Keeping, Memory, Observer,
    Outcome, Participant, Plan, Progress, Recorder, Sample, run_from, stage_isolated,
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
    /// What ended it too early, if anything did.
    pub ended: Option<HarnessError>,
    plan: Plan,
    kept: Kept,
    time_s: Vec<f64>,
    named: Vec<(String, Vec<f64>)>,
}

/// How a run is recorded.
#[derive(Default)]
pub struct How<'a> {
    /// Where `trajectory.csv` is written while it runs.
    pub folder: Option<&'a Path>,
    /// No progress bar.
    pub quiet: bool,
    /// Each FMU in a process of its own.
    pub isolation: Option<&'a Isolation>,
    /// Checkpoints every so often, ns of simulated time; they need the folder.
    pub checkpoint_ns: Option<i64>,
    /// From the checkpoint in the folder.
    pub resume: bool,
}

/// Samples for the report and the trajectory, with checkpoints or without.
enum Kept {
    Plain(Memory, Option<Box<Recorder>>),
    Resumable(Box<Keeping>),
}

impl Kept {
    fn memory(&self) -> &Memory {
        match self {
            Kept::Plain(memory, _) => memory,
            Kept::Resumable(keeping) => keeping.memory(),
        }
    }

    fn observers(&mut self) -> Vec<&mut dyn Observer> {
        match self {
            Kept::Plain(memory, None) => vec![memory],
            Kept::Plain(memory, Some(recorder)) => vec![memory, recorder.as_mut()],
            Kept::Resumable(keeping) => vec![keeping.as_mut()],
        }
    }
}

/// Runs a scenario. An error in the middle leaves a record of what there is.
pub fn record(resolved: &Resolved, cast: &Cast, how: &How<'_>) -> Result<Record, HarnessError> {
    let (mut participants, plan) = stage_isolated(resolved, cast, how.isolation)?;
    let memory = Memory::new(1, shown(&plan));
    let every = u64::from(resolved.scenario.record_every);
    let (mut kept, checkpoint) = match how.folder {
        Some(folder) if how.resume || how.checkpoint_ns.is_some() => {
            let identity = identity(resolved, &participants);
            let found = if how.resume { Some(Checkpoint::read(folder, &identity)?) } else { None };
            let every_ns = how.checkpoint_ns.or(found.as_ref().map(|found| found.every_ns));
            let keeping = match &found {
                Some(found) => Keeping::resuming(folder, found, every, memory),
                None => Keeping::new(folder, every_ns.unwrap_or(i64::MAX), identity, every, memory),
            };
            (Kept::Resumable(Box::new(keeping)), found)
        }
        folder => (Kept::Plain(memory, folder.map(|folder| Box::new(Recorder::new(folder, every)))), None),
    };
    let bar = bar(how.quiet);
    let mut progress = Progress::new(Duration::from_millis(50), |t_s, share| {
        bar.set_position((share * 1000.0) as u64);
        bar.set_message(format!("{t_s:.0} of {:.0} s", resolved.scenario.stop_s));
    });
    let mut observers = kept.observers();
    observers.push(&mut progress);
    let from = checkpoint.as_ref().map(|checkpoint| &checkpoint.position);
    let (outcome, result) = run_from(&mut participants, &plan, &mut FanOut(observers), from);
    bar.finish_and_clear();
    let ended = match result {
        // What the user gave does not fit, or could not be written at all: nothing has run.
        Err(error) if kept.memory().times_ns().is_empty() && !matches!(error, HarnessError::Run { .. }) => {
            return Err(error);
        }
        result => result.err(),
    };
    Ok(Record::new(resolved, plan, outcome, ended, kept))
}

/// The record of a run that others have made: these rows go through the recorders as if it were run again.
pub fn replay(
    resolved: &Resolved,
    plan: Plan,
    experiment: &Experiment,
    rows: impl Iterator<Item = (i64, Vec<f64>)>,
    (folder, took): (&Path, Duration),
) -> Result<Record, HarnessError> {
    let memory = Memory::new(1, shown(&plan));
    let recorder = Recorder::new(folder, u64::from(resolved.scenario.record_every));
    let mut kept = Kept::Plain(memory, Some(Box::new(recorder)));
    let mut span_ns = (plan.start_ns, plan.start_ns);
    let mut observers = FanOut(kept.observers());
    observers.begin(experiment)?;
    let mut steps = 0;
    for (t_ns, values) in rows {
        let since_ns = t_ns - plan.start_ns;
        let regular = (since_ns % plan.step_ns == 0).then(|| (since_ns / plan.step_ns) as u64);
        observers.sample(Sample { t_ns, regular, last: t_ns >= plan.stop_ns, values: &values })?;
        span_ns.1 = t_ns;
        steps += 1;
    }
    observers.finish(None)?;
    drop(observers);
    let outcome = Outcome { steps, span_ns, total: took, is_settled: true, ..Outcome::default() };
    Ok(Record::new(resolved, plan, outcome, None, kept))
}

/// What is kept for the report.
fn shown(plan: &Plan) -> impl Fn(&Column) -> bool + 'static {
    let sources: Vec<String> = plan.connections.iter().map(|c| c.from.to_string()).collect();
    move |column: &Column| {
        sources.contains(&column.label())
            || (column.participant == CONTROLLER && SHOWN.contains(&quantity(&column.variable)))
    }
}

/// What a checkpoint of this run belongs to.
pub fn identity(resolved: &Resolved, participants: &[Box<dyn Participant>]) -> Identity {
    let scenario = serde_json::to_string(&resolved.scenario).unwrap_or_default();
    let configuration = format!("{:?} {:?} {:?}", resolved.control, resolved.grid, resolved.wires);
    Identity::new(scenario, &configuration, participants)
}

impl Record {
    fn new(
        resolved: &Resolved,
        plan: Plan,
        outcome: Outcome,
        ended: Option<HarnessError>,
        kept: Kept,
    ) -> Self {
        let memory = kept.memory();
        let time_s = memory.times_ns().iter().map(|t| *t as f64 * 1e-9).collect();
        let mut named = measured(&plan, memory, resolved.control.agents());
        for column in memory.columns().iter().filter(|c| c.participant == CONTROLLER) {
            let values = memory.values(CONTROLLER, &column.variable).unwrap_or_default();
            named.push((column.label(), values.to_vec()));
        }
        Self { outcome, ended, plan, kept, time_s, named }
    }

    /// What was recorded, by name. What the agents measure is there as `grid.P[i]`, ... in the
    /// controller's units, whatever the grid calls it.
    pub fn columns(&self) -> Result<Columns<'_>, ReportError> {
        Columns::new(&self.time_s, self.named.iter().map(|(name, values)| (name.as_str(), values.as_slice())))
    }

    /// max abs(sum of P_set) over all communication points, pu.
    pub fn worst_sum_of_p_set(&self, n: usize) -> f64 {
        let columns: Vec<&[f64]> =
            (1..=n).filter_map(|i| self.kept.memory().values(CONTROLLER, &format!("P_set[{i}]"))).collect();
        let sum = |k: usize| columns.iter().filter_map(|c| c.get(k)).sum::<f64>();
        (0..self.time_s.len()).map(|k| sum(k).abs()).fold(0.0, f64::max)
    }

    /// Simulated time over wall time.
    pub fn real_time_factor(&self) -> f64 {
        let (from_ns, to_ns) = self.outcome.span_ns;
        (to_ns - from_ns) as f64 * 1e-9 / self.outcome.total.as_secs_f64()
    }

    /// Where it was resumed, s.
    pub fn resumed_at_s(&self) -> Option<f64> {
        let (from_ns, _) = self.outcome.span_ns;
        (from_ns > self.plan.start_ns).then_some(from_ns as f64 * 1e-9)
    }

    /// Recorded instants, s.
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
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
pub fn bar(quiet: bool) -> ProgressBar {
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

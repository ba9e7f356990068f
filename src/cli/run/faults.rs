//! The scenario's trials: each is run beside the scenario, and becomes a row of the table of faults.

use super::super::{Failure, ScenarioArgs};
use super::record::{How, Record, record};
use super::terms::Terms;
use crate::harness::{Cast, HarnessError};
use crate::report::{FaultRow, FaultWindow, KeptLimits, fault_lines, fault_row};
use crate::scenario::Resolved;
use crate::scenario::fault::Trial;
use miette::IntoDiagnostic;
use std::fmt::Write as _;

/// The trials of a scenario with what is to be run, checked before anything runs.
pub fn trials(args: &ScenarioArgs, resolved: &Resolved) -> Result<Vec<(Trial, Resolved)>, Failure> {
    let of = |trial: &Trial| {
        let mut set = args.assignments();
        set.extend(trial.set.clone());
        Ok((trial.clone(), Resolved::of(&resolved.source, &set).map_err(Failure::scenario)?))
    };
    resolved.scenario.trials.iter().map(of).collect()
}

/// The row of the scenario itself, where it has faults; it counts from the first to the last of them.
pub fn own_row(resolved: &Resolved, run: &Record) -> Result<Option<FaultRow>, Failure> {
    let faults = &resolved.scenario.faults;
    let Some(from_s) = faults.iter().map(|fault| fault.from_s).reduce(f64::min) else { return Ok(None) };
    let ends: Option<Vec<f64>> = faults.iter().map(|fault| fault.until_s).collect();
    let indexed =
        |name: &str| name.strip_suffix(']')?.split_once('[')?.1.parse::<usize>().ok()?.checked_sub(1);
    let wires = resolved.faults.iter().filter_map(|fault| indexed(&fault.signal));
    let messages = resolved.control.message_faults.iter().map(|fault| (fault.agent as usize).wrapping_sub(1));
    let window = FaultWindow {
        label: "as given".into(),
        from_s,
        until_s: ends.and_then(|ends| ends.into_iter().reduce(f64::max)),
        affected: wires.chain(messages).collect(),
        tolerance: 1e-5,
        cannot: None,
    };
    row(resolved, run, &window).map(Some)
}

/// Runs a trial.
pub fn run_trial(
    trial: &Trial,
    (resolved, cast): (&Resolved, &Cast),
    how: &How<'_>,
) -> Result<FaultRow, Failure> {
    let failed = |error: &HarnessError| {
        let failure = super::failed(error);
        Failure { report: failure.report.wrap_err(format!("trial \"{}\"", trial.label)), ..failure }
    };
    let run = record(resolved, cast, how).map_err(|error| failed(&error))?;
    if let Some(error) = &run.ended {
        return Err(failed(error));
    }
    let window = FaultWindow {
        label: trial.label.clone(),
        from_s: trial.from_s,
        until_s: trial.until_s,
        affected: trial.affected.iter().map(|agent| (*agent as usize).wrapping_sub(1)).collect(),
        tolerance: trial.tolerance,
        cannot: trial.cannot.clone(),
    };
    row(resolved, &run, &window)
}

fn row(resolved: &Resolved, run: &Record, window: &FaultWindow) -> Result<FaultRow, Failure> {
    let limits = &resolved.control.limits;
    let kept = KeptLimits {
        omega_set: limits.omega_set_range,
        V_set: limits.V_set_range,
        P_set: resolved.control.P_exchange_max.clone(),
        P: limits.P_max.clone(),
        rates: [limits.omega_set_rate.clone(), limits.V_set_rate.clone(), limits.P_set_rate.clone()],
    };
    let agents = Terms::of(resolved).agents;
    Ok(fault_row(&run.columns().into_diagnostic()?, &agents, &kept, window).into_diagnostic()?)
}

/// The rows for the terminal, a line each.
pub fn text(rows: &[FaultRow]) -> String {
    let lines = fault_lines(rows);
    let width =
        |c: usize| lines.iter().filter_map(|l| l.get(c)).map(|s| s.chars().count()).max().unwrap_or(0);
    let mut text = String::from("\nFaults, pu\n");
    for line in &lines {
        let mut shown = String::new();
        for (c, cell) in line.iter().enumerate() {
            let pad = " ".repeat(width(c).min(60).saturating_sub(cell.chars().count()));
            let _ = match c {
                0 => write!(shown, "{cell}{pad}"),
                _ if c + 1 == line.len() => write!(shown, "  {cell}"),
                _ => write!(shown, "  {pad}{cell}"),
            };
        }
        text.push_str(shown.trim_end());
        text.push('\n');
    }
    text
}

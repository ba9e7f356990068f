//! `bess run`: couple, simulate, and leave what a person and what a script want to see.

mod comparison;
mod console;
mod faults;
mod record;
mod results;
mod sections;

use super::{Failure, ScenarioArgs, print, results_folder};
use crate::harness::{Cast, HarnessError, Origin};
use crate::scenario::{self, Resolved};
use clap::Args;
use comparison::Compared;
use miette::{IntoDiagnostic, WrapErr};
use record::record;
use std::path::PathBuf;

/// The command line of `bess run`.
#[derive(Args)]
#[command(after_help = "Examples:
  bess run case1
  bess run case1 --set control.gains.E=0 --set step_s=0.1 -o results/coarse
  bess run mine.json --grid MyGrid.fmu
  bess run case1 --controller fmu/BessConsensus.fmu --grid fmu/BessGrid.fmu

DIR holds afterwards: trajectory.csv (time, controller.NAME, grid.NAME), summary.json, report.html.
An FMU gets the scenario's parameters where it has parameters of the same names. Names and units that
differ from the controller's go into the scenario's `connections`; docs/your-grid.md has examples.")]
pub struct RunArgs {
    #[command(flatten)]
    scenario: ScenarioArgs,
    /// Folder for the results [default: results/NAME]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// FMU in the controller's place [default: control.fmu, or the built-in model]
    #[arg(long, value_name = "FMU")]
    controller: Option<PathBuf>,
    /// FMU in the grid's place [default: grid.fmu, or the built-in model]
    #[arg(long, value_name = "FMU")]
    grid: Option<PathBuf>,
    /// No report.html, and no variants that only the report shows
    #[arg(long)]
    no_report: bool,
    /// No progress bar and no table
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the scenario and its variants, and writes the results.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    let resolved = args.scenario.resolve()?;
    let variants = if args.no_report { Vec::new() } else { variants(args, &resolved)? };
    let trials = faults::trials(&args.scenario, &resolved)?;
    let folder = args.output.clone().unwrap_or_else(|| results_folder(&resolved.scenario.name));
    let cast = cast(args, &resolved);

    let main = record(&resolved, &cast, Some(&folder), args.quiet).map_err(failed)?;
    let mut compared: Vec<Compared> = Vec::with_capacity(variants.len());
    for (label, resolved) in variants {
        // An FMU exported earlier knows of a variant only what is a parameter, hence our own controller.
        let cast = Cast { controller: Cast::of(&resolved).controller, ..self::cast(args, &resolved) };
        let record = record(&resolved, &cast, None, args.quiet).map_err(failed)?;
        compared.push(Compared { label, resolved, record });
    }
    let mut results = results::Results::new(&resolved, &main, &compared)?;
    results.faults.extend(faults::own_row(&resolved, &main, results.agents())?);
    for (trial, resolved) in &trials {
        let cast = Cast { controller: Cast::of(resolved).controller, ..self::cast(args, resolved) };
        results.faults.push(faults::run_trial(trial, resolved, &cast, results.agents(), args.quiet)?);
    }
    results.write_summary(&folder.join("summary.json"))?;
    if !args.no_report {
        let report = folder.join("report.html");
        results
            .report(&resolved, &main, &compared)?
            .write(&report)
            .into_diagnostic()
            .wrap_err_with(|| format!("{}: the report", report.display()))?;
    }
    for warning in unlikely(&resolved).iter().chain(&main.outcome.warnings) {
        eprintln!("warning: {warning}");
    }
    if args.quiet {
        return Ok(());
    }
    print(&console::table(&results, &folder, !args.no_report))
}

/// Who takes part: the command line before the scenario, the built-in models where neither names an FMU.
fn cast(args: &RunArgs, resolved: &Resolved) -> Cast {
    let named = Cast::of(resolved);
    let of = |fmu: &Option<PathBuf>, named: Origin| fmu.clone().map_or(named, Origin::Fmu);
    Cast { controller: of(&args.controller, named.controller), grid: of(&args.grid, named.grid) }
}

/// The variants of the scenario, checked before anything runs.
fn variants(args: &RunArgs, resolved: &Resolved) -> Result<Vec<(String, Resolved)>, Failure> {
    let of = |variant: &scenario::document::Variant| {
        let mut set = args.scenario.assignments();
        set.extend(variant.set.clone());
        Ok((variant.label.clone(), Resolved::of(&resolved.source, &set).map_err(Failure::scenario)?))
    };
    resolved.scenario.compare.iter().map(of).collect()
}

/// What is allowed, but hardly what anybody wants.
fn unlikely(resolved: &Resolved) -> Vec<String> {
    let scenario = &resolved.scenario;
    let mut warnings = Vec::new();
    let fed = |wire: &scenario::connection::Wire| wire.to == "controller.enable";
    if results::enabled_from(resolved).is_infinite() && !resolved.wires.iter().any(fed) {
        warnings.push(
            "controller.enable is never true: the controller holds its setpoints throughout; set it in `initial` \
             or by an event"
                .into(),
        );
    }
    for (k, event) in scenario.events.iter().enumerate().filter(|(_, event)| event.at_s > scenario.stop_s) {
        let (at_s, stop_s) = (event.at_s, scenario.stop_s);
        warnings.push(format!("events[{k}] at {at_s} s never happens: the run ends at stop_s = {stop_s} s"));
    }
    for (k, fault) in scenario.faults.iter().enumerate().filter(|(_, fault)| fault.from_s > scenario.stop_s) {
        let (from_s, stop_s) = (fault.from_s, scenario.stop_s);
        warnings
            .push(format!("faults[{k}] from {from_s} s never happens: the run ends at stop_s = {stop_s} s"));
    }
    if scenario.step_s > LONG_STEP_S {
        warnings.push(format!(
            "step_s = {} s: the controller acts once in a step, and a grid answers within fractions of a second; \
             expected 0.01 to {LONG_STEP_S} s",
            scenario.step_s
        ));
    }
    warnings
}

/// Steps beyond this are likely meant as milliseconds, s.
const LONG_STEP_S: f64 = 1.0;

/// A run that could not start because of what the user gave ends with code 2, one that broke with code 1.
fn failed(error: HarnessError) -> Failure {
    let code = match error {
        HarnessError::Run { .. } | HarnessError::Observer(_) | HarnessError::Conversion { .. } => 1,
        _ => 2,
    };
    Failure { report: miette::miette!("{error}"), code }
}

//! `bess run`: couple, simulate, and leave what a person and what a script want to see.

mod comparison;
mod console;
mod ended;
mod faults;
mod isolate;
mod record;
mod results;
mod sections;
mod terms;

pub use isolate::{WORKER, WorkerArgs, work};
pub use record::{bar, identity, replay};

use super::{Failure, ScenarioArgs, duration, print, results_folder};
use crate::control::partition::Cut;
use crate::harness::whole::write_whole;
use crate::harness::{Cast, HarnessError, Keeping, Origin, Trouble};
use crate::report::Report;
use crate::scenario::{self, Resolved};
use clap::{Args, ValueEnum};
use comparison::Compared;
use ended::Ended;
use miette::{IntoDiagnostic, WrapErr};
use record::{How, Record, record};
use results::Results;
use std::path::{Path, PathBuf};

/// The command line of `bess run`.
#[derive(Args)]
#[command(after_help = "Examples:
  bess run case1
  bess run case1 --set control.gains.E=0 --set step_s=0.1 -o results/coarse
  bess run mine.json --grid MyGrid.fmu
  bess run case1 --controller fmu/BessConsensus.fmu --grid fmu/BessGrid.fmu
  bess run mine.json --grid Unknown.fmu --isolate      each FMU in a process of its own
  bess run case1 --parts clusters                      a controller for each cluster; or agents: for each battery
  bess run energy --checkpoint 5min                    and after a power cut, the same with --resume

DIR holds afterwards: trajectory.csv (time, controller.NAME, grid.NAME), summary.json, report.html. While it runs, and
where it ended early, the trajectory is called trajectory.csv.part: whole lines, up to the last whole second.
Exit codes: 0 done, 1 the run failed, 2 the command line or the scenario is wrong, 3 an isolated FMU crashed or hung.
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
    /// The controller in parts that exchange messages over their links only
    #[arg(long, value_name = "PARTS", conflicts_with = "controller")]
    parts: Option<Parts>,
    /// FMU in the grid's place [default: grid.fmu, or the built-in model]
    #[arg(long, value_name = "FMU")]
    grid: Option<PathBuf>,
    /// Run each FMU in a process of its own: if one crashes or hangs, the results up to then are kept, and the exit code is 3
    #[arg(long)]
    isolate: bool,
    /// With --isolate: how long one call of an FMU may take, in seconds or as 500ms, 2min, 1h
    #[arg(long, value_name = "TIME", default_value = "30s", value_parser = duration::parse, requires = "isolate")]
    call_limit: i64,
    /// Keep the state of the run every so many simulated seconds (or 500ms, 2min, 1h) for --resume
    #[arg(long, value_name = "EVERY", value_parser = duration::parse)]
    checkpoint: Option<i64>,
    /// Go on from the checkpoint in DIR; the results are the same to the last bit as without interruption
    #[arg(long)]
    resume: bool,
    /// No report.html, and no variants that only the report shows
    #[arg(long)]
    no_report: bool,
    /// No progress bar and no table
    #[arg(short, long)]
    quiet: bool,
}

/// Into what a controller is cut.
#[derive(Clone, Copy, ValueEnum)]
enum Parts {
    /// One for each cluster
    Clusters,
    /// One for each battery
    Agents,
}

impl From<Parts> for Cut {
    fn from(parts: Parts) -> Self {
        match parts {
            Parts::Clusters => Cut::Clusters,
            Parts::Agents => Cut::Agents,
        }
    }
}

/// Runs the scenario and its variants, and writes the results.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    let resolved = args.scenario.resolve()?;
    let variants = if args.no_report { Vec::new() } else { variants(args, &resolved)? };
    let trials = faults::trials(&args.scenario, &resolved)?;
    let folder = args.output.clone().unwrap_or_else(|| results_folder(&resolved.scenario.name));
    let cast = cast(args, &resolved);
    let isolation = if args.isolate { Some(isolate::isolation(args.call_limit)?) } else { None };
    if args.isolate && !isolate::has_fmu(&cast) {
        eprintln!("note: no FMU takes part, so --isolate has nothing to isolate");
    }
    let alone = How { quiet: args.quiet, isolation: isolation.as_ref(), ..How::default() };
    let main = How { folder: Some(&folder), checkpoint_ns: args.checkpoint, resume: args.resume, ..alone };
    let main = match record(&resolved, &cast, &main) {
        Ok(main) => main,
        Err(error) => return Err(stillborn(args, &resolved, &folder, error)),
    };
    let mut ended = main.ended.as_ref().map(|error| (Ended::of(error, None), failed(error)));
    if main.time_s().is_empty()
        && let Some(error) = main.ended
    {
        return Err(stillborn(args, &resolved, &folder, error));
    }
    let mut compared: Vec<Compared> = Vec::with_capacity(variants.len());
    for (label, resolved) in variants {
        if ended.is_some() {
            break;
        }
        // An FMU exported earlier knows of a variant only what is a parameter, hence our own controller.
        let controller = own_controller(args, &resolved);
        let cast = Cast { controller, ..self::cast(args, &resolved) };
        match record(&resolved, &cast, &alone) {
            Ok(Record { ended: Some(error), .. }) | Err(error) => {
                ended = Some((Ended::of(&error, Some(&label)), failed(&error)));
            }
            Ok(record) => compared.push(Compared { label, resolved, record }),
        }
    }
    let (ended, failure) = ended.unzip();
    let written = Results::new(&resolved, &main, &compared, ended).and_then(|mut results| {
        if failure.is_none() {
            results.faults.extend(faults::own_row(&resolved, &main)?);
            for (trial, resolved) in &trials {
                let controller = own_controller(args, resolved);
                let cast = Cast { controller, ..self::cast(args, resolved) };
                results.faults.push(faults::run_trial(trial, (resolved, &cast), &alone)?);
            }
        }
        results.write_summary(&folder.join("summary.json"))?;
        if !args.no_report {
            write(&results.report(&resolved, &main, &compared)?, &folder)?;
        }
        Ok(results)
    });
    for warning in unlikely(args, &resolved).iter().chain(&main.outcome.warnings) {
        eprintln!("warning: {warning}");
    }
    if let Some(failure) = failure {
        // What ended the run matters more than what could not be written after it.
        return Err(if written.is_ok() { with_remains(failure, args, &folder) } else { failure });
    }
    let results = written?;
    Keeping::clear(&folder).into_diagnostic().wrap_err("the checkpoint cannot be removed")?;
    if args.quiet {
        return Ok(());
    }
    print(&console::table(&results, &folder, !args.no_report))
}

/// What a run leaves that others have made: summary, report and table; `early` says what ended it before its time.
pub fn conclude(
    resolved: &Resolved,
    main: &Record,
    folder: &Path,
    early: Option<&str>,
    (report, quiet): (bool, bool),
) -> Result<(), Failure> {
    let time_s = main.time_s().last().copied();
    let mut results = Results::new(resolved, main, &[], early.map(|reason| Ended::other(reason, time_s)))?;
    if early.is_none() {
        results.faults.extend(faults::own_row(resolved, main)?);
    }
    results.write_summary(&folder.join("summary.json"))?;
    if report {
        write(&results.report(resolved, main, &[])?, folder)?;
    }
    if quiet { Ok(()) } else { print(&console::table(&results, folder, report)) }
}

/// A run that ended before anything was recorded: a report only if a participant failed of its own.
fn stillborn(args: &RunArgs, resolved: &Resolved, folder: &Path, error: HarnessError) -> Failure {
    let failure = failed(&error);
    let is_a_participants = matches!(error, HarnessError::Run { .. } | HarnessError::Call { .. });
    if failure.code == 2 || !is_a_participants || args.no_report {
        return failure;
    }
    match write(&Ended::of(&error, None).report(resolved), folder) {
        Ok(()) => with_remains(failure, args, folder),
        Err(_) => failure,
    }
}

fn write(report: &Report, folder: &Path) -> Result<(), Failure> {
    let path = folder.join("report.html");
    let named = || format!("{}: the report", path.display());
    let html = report.to_html().into_diagnostic().wrap_err_with(named)?;
    let written = std::fs::create_dir_all(folder).and_then(|()| write_whole(&path, &[html.as_bytes()]));
    Ok(written.into_diagnostic().wrap_err_with(|| format!("{} cannot be written", named()))?)
}

/// The failure with where to look.
fn with_remains(failure: Failure, args: &RunArgs, folder: &Path) -> Failure {
    let mut help = format!("what there is lies in {}", folder.display());
    if !args.no_report {
        help += "; report.html tells what happened";
    }
    if args.checkpoint.is_some() || args.resume {
        help += "; the same command with --resume goes on from the last checkpoint";
    }
    let text = failure.report.to_string();
    Failure { report: miette::miette!(help = help, "{text}"), ..failure }
}

/// Who takes part: the command line before the scenario, the built-in models where neither names an FMU.
fn cast(args: &RunArgs, resolved: &Resolved) -> Cast {
    let named = Cast::of(resolved);
    let of = |fmu: &Option<PathBuf>, named: Origin| fmu.clone().map_or(named, Origin::Fmu);
    let controller = args.parts.map_or(named.controller, |parts| Origin::Parts(parts.into()));
    Cast { controller: of(&args.controller, controller), grid: of(&args.grid, named.grid) }
}

/// The same without an FMU that the command line names.
fn own_controller(args: &RunArgs, resolved: &Resolved) -> Origin {
    args.parts.map_or(Cast::of(resolved).controller, |parts| Origin::Parts(parts.into()))
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
fn unlikely(args: &RunArgs, resolved: &Resolved) -> Vec<String> {
    let scenario = &resolved.scenario;
    // Who ends a run sooner on the command line knows what is cut off.
    let end_s =
        if args.scenario.assignments().contains_key("stop_s") { f64::INFINITY } else { scenario.stop_s };
    let mut warnings = Vec::new();
    let fed = |wire: &scenario::connection::Wire| wire.to == "controller.enable";
    if terms::enabled_from(resolved).is_infinite() && !resolved.wires.iter().any(fed) {
        warnings.push(
            "controller.enable is never true: the controller holds its setpoints throughout; set it in `initial` \
             or by an event"
                .into(),
        );
    }
    for (k, event) in scenario.events.iter().enumerate().filter(|(_, event)| event.at_s > end_s) {
        let (at_s, stop_s) = (event.at_s, scenario.stop_s);
        warnings.push(format!("events[{k}] at {at_s} s never happens: the run ends at stop_s = {stop_s} s"));
    }
    for (k, fault) in scenario.faults.iter().enumerate().filter(|(_, fault)| fault.from_s > end_s) {
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

/// A run that could not start because of what the user gave ends with code 2, one that broke with code 1, one whose FMU
/// took its own process down with code 3.
pub fn failed(error: &HarnessError) -> Failure {
    let code = match error {
        HarnessError::Run { source, .. } | HarnessError::Call { source, .. }
            if source.trouble != Trouble::Refused =>
        {
            3
        }
        HarnessError::Run { .. } | HarnessError::Observer(_) | HarnessError::Conversion { .. } => 1,
        _ => 2,
    };
    Failure { report: miette::miette!("{error}"), code }
}

//! The `bess` command: parse, call one function, print. Exit codes: 0 done, 1 the run or the file failed (or `check` found errors),
//! 2 the command line or the scenario is wrong, 3 an FMU in a process of its own crashed or hung.
#![forbid(unsafe_code)]
#![allow(non_snake_case)]

mod bounds;
mod certified;
mod check;
mod cluster;
mod duration;
mod export;
mod federate;
mod run;
mod show;

use crate::scenario::Resolved;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use miette::{IntoDiagnostic, Report};
use serde_json::{Map, Value};
use std::path::PathBuf;
use std::process::ExitCode;

/// Distributed finite-time consensus control of battery energy storage, as FMI 2.0 FMUs.
#[derive(Parser)]
#[command(version, about, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "Examples:
  bess run case1                                  simulate the paper's Case 1, results in results/case1
  bess show case1 > mine.json                     a scenario to start from
  bess export controller mine.json -o Mine.fmu    the controller for your own batteries
  bess run mine.json --grid MyGrid.fmu            the controller beside your own grid model
  bess cluster case1                              who talks to whom, and why
  bess check MyGrid.fmu                           what is wrong with an FMU, and who refuses it

SCENARIO is a JSON file or a built-in name: case1, case2, case3, case4, plug_and_play, voltage, energy, faults.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write an FMU for a scenario, or both FMUs connected (.ssp)
    Export(export::ExportArgs),
    /// Couple controller and grid, simulate, and leave trajectory.csv, summary.json and report.html
    Run(run::RunArgs),
    /// Run grid and controller as federates of HELICS, here or on several machines
    Federate(federate::FederateArgs),
    /// The broker of a federation
    #[command(name = federate::BROKER, hide = true)]
    Broker(federate::BrokerArgs),
    /// Print the spanning tree, the cuts, the clusters with their leaders, and the weights
    Cluster(ScenarioArgs),
    /// Print lambda_2 and the certified times T_P and T_omega
    Bounds(ScenarioArgs),
    /// Check an FMU, yours or any other: what is wrong, and which tools would refuse it
    Check(check::CheckArgs),
    /// Runs an FMU for `check`, in a process that may die of it
    #[command(name = check::PROBE, hide = true)]
    Probe {
        /// The FMU
        file: PathBuf,
    },
    /// Takes calls for one FMU, in a process that may die of it
    #[command(name = run::WORKER, hide = true)]
    Worker(run::WorkerArgs),
    /// Print a scenario as it is read, a start for one's own
    Show(ScenarioArgs),
    /// Print the JSON Schema of scenarios
    Schema,
}

/// A scenario with some keys changed.
#[derive(Args, Clone)]
pub struct ScenarioArgs {
    /// JSON file or built-in name: case1, case2, case3, case4, plug_and_play, voltage, energy, faults
    #[arg(value_name = "SCENARIO")]
    scenario: String,
    /// Change a key of the scenario: --set control.gains.E=0 (repeatable)
    #[arg(long, value_name = "PATH=VALUE", value_parser = crate::scenario::parse_assignment)]
    set: Vec<(String, Value)>,
}

impl ScenarioArgs {
    /// The scenario, checked and turned into the two configurations.
    fn resolve(&self) -> Result<Resolved, Failure> {
        Resolved::load(&self.scenario, &self.assignments()).map_err(Failure::scenario)
    }

    fn assignments(&self) -> Map<String, Value> {
        self.set.iter().cloned().collect()
    }
}

/// What went wrong, and with which exit code it ends.
#[derive(Debug)]
struct Failure {
    report: Report,
    code: u8,
}

impl<E: Into<Report>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self { report: error.into(), code: 1 }
    }
}

impl Failure {
    fn scenario(error: crate::scenario::ScenarioError) -> Self {
        let help = error.help();
        Self { report: miette::miette!(help = help, "{error}"), code: 2 }
    }
}

/// Runs the command line; what is printed on standard output is the result alone.
///
/// `carried` is the zip archive of shared libraries inside the program, empty if there is none.
pub fn main(carried: &'static [u8]) -> ExitCode {
    let cli =
        Cli::from_arg_matches(&command_line(carried).get_matches()).unwrap_or_else(|error| error.exit());
    let done = match cli.command {
        Command::Export(args) => export::export(&args, carried),
        Command::Run(args) => run::run(&args),
        Command::Federate(args) => federate::federate(&args),
        Command::Broker(args) => federate::serve(&args),
        Command::Cluster(args) => cluster::cluster(&args),
        Command::Bounds(args) => bounds::bounds(&args),
        Command::Check(args) => match check::check(&args) {
            Ok(true) => Ok(()),
            Ok(false) => return ExitCode::FAILURE,
            Err(failure) => Err(failure),
        },
        Command::Probe { file } => {
            crate::check::probe(&file);
            Ok(())
        }
        Command::Worker(args) => run::work(&args),
        Command::Show(args) => show::show(&args),
        Command::Schema => show::schema(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure { report, code }) => {
            eprintln!("{report:?}");
            ExitCode::from(code)
        }
    }
}

/// The command line, with what this very program carries in `bess --version` and `bess export --help`.
fn command_line(carried: &'static [u8]) -> clap::Command {
    let carries = export::carries(carried);
    // clap keeps the version as `&'static str`; one a process is no leak that grows.
    let version: &'static str = format!("{}\n{carries}", env!("CARGO_PKG_VERSION")).leak();
    Cli::command().long_version(version).mut_subcommand("export", |export| {
        let examples = export.get_after_help().map(ToString::to_string).unwrap_or_default();
        export.after_help(format!("{examples}\n\n{carries}"))
    })
}

/// Prints to standard output; a closed pipe (`bess schema | head`) is no error.
fn print(text: &str) -> Result<(), Failure> {
    use std::io::Write;
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => Ok(written.into_diagnostic()?),
    }
}

/// The default folder of a run's results.
fn results_folder(name: &str) -> PathBuf {
    PathBuf::from("results").join(name)
}

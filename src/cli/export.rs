//! `bess export`: an FMU for a scenario, both as one system, or the controller in parts.

use super::{Failure, ScenarioArgs};
use crate::control::partition::Cut;
use crate::fmi::{Interface, Model};
use crate::models::fleet::Fleet;
use crate::models::{Controller, Grid};
use crate::package::{self, Libraries, PackageError};
use crate::scenario::Resolved;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// What an FMU can be written of.
#[derive(Clone, Copy, ValueEnum)]
pub enum Part {
    /// The consensus controller
    Controller,
    /// The power network with its batteries
    Grid,
    /// Both, connected: a .ssp (SSP 1.0)
    System,
    /// The controller of cluster number K alone
    Cluster,
    /// The controller of agent number I alone
    Agent,
    /// The controllers of all clusters and the grid, connected: a .ssp
    Clusters,
    /// The controllers of all agents and the grid, connected: a .ssp
    Agents,
}

impl Part {
    /// How the controller is cut, where it is.
    fn cut(self) -> Option<Cut> {
        match self {
            Part::Controller | Part::Grid | Part::System => None,
            Part::Cluster | Part::Clusters => Some(Cut::Clusters),
            Part::Agent | Part::Agents => Some(Cut::Agents),
        }
    }

    /// Whether it is one of several, and needs a number.
    fn is_one(self) -> bool {
        matches!(self, Part::Cluster | Part::Agent)
    }
}

/// A version of FMI that an FMU can be written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Fmi {
    /// FMI 2.0: one variable for each element
    #[value(name = "2", alias = "2.0")]
    Two,
    /// FMI 3.0: arrays
    #[value(name = "3", alias = "3.0")]
    Three,
}

/// The command line of `bess export`.
#[derive(Args)]
#[command(allow_missing_positional = true)]
#[command(after_help = "Examples:
  bess export controller case1
  bess export controller mine.json -o fmu/Mine.fmu
  bess export grid case1 --set grid.case=my_case.m
  bess export controller mine.json --portable     P_1 in place of P[1], nothing but Reals
  bess export controller mine.json --fmi 3        FMI 3.0: one array P, any number of batteries
  bess export system mine.json -o mine.ssp        both FMUs, connected
  bess export cluster 2 case1                     BessCluster2.fmu: its agents, and messages to and from cluster 1
  bess export agent 3 mine.json                   BessAgent3.fmu: one battery
  bess export clusters case1                      BessClusters.ssp: all of them and the grid, connected

A system starts with the scenario's `initial` values and its events at 0 s, and with the controller on unless
those say otherwise; later events are left to the master that opens it. docs/distributed.md says what a cluster or an
agent alone knows, and how they are connected.")]
pub struct ExportArgs {
    /// What to export
    part: Part,
    /// Number of the cluster or agent, from 1; for nothing else
    #[arg(value_name = "NUMBER")]
    number: Option<u32>,
    #[command(flatten)]
    scenario: ScenarioArgs,
    /// The file to write [default: BessConsensus.fmu, BessGrid.fmu, BessSystem.ssp, BessCluster2.fmu, ...]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Names that are C identifiers (P_1) and Reals only (true from 0.5 on), for tools that know nothing else
    #[arg(long)]
    portable: bool,
    /// Version of FMI: 2 for FMI 2.0, 3 for FMI 3.0 with arrays; a system holds FMI 2.0
    #[arg(long, value_name = "VERSION", default_value = "2")]
    fmi: Fmi,
    /// Folder with the shared libraries: linux64/, win64/, aarch64-linux/, or a cargo target folder
    /// [default: those that this program carries; if it carries none, those beside it]
    #[arg(long, value_name = "DIR")]
    libraries: Option<PathBuf>,
}

/// Writes the FMU and says where it is.
pub fn export(args: &ExportArgs, carried: &'static [u8]) -> Result<(), Failure> {
    refuse_mixtures(args)?;
    let resolved = args.scenario.resolve()?;
    let libraries = chosen(args.libraries.as_deref(), carried);
    let number = number(args, &resolved)?;
    let default = match args.part {
        Part::Controller => format!("{}.fmu", Controller::IDENTIFIER),
        Part::Grid => format!("{}.fmu", Grid::IDENTIFIER),
        Part::System => "BessSystem.ssp".to_owned(),
        Part::Clusters => "BessClusters.ssp".to_owned(),
        Part::Agents => "BessAgents.ssp".to_owned(),
        Part::Cluster => format!("BessCluster{number}.fmu"),
        Part::Agent => format!("BessAgent{number}.fmu"),
    };
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(default));
    let interface = if args.portable { Interface::Portable } else { Interface::Structured };
    // A system holds both models, built for the same platforms.
    let model = if matches!(args.part, Part::Grid) { Grid::IDENTIFIER } else { Controller::IDENTIFIER };
    let written = match (args.fmi, args.part) {
        (Fmi::Three, Part::Controller) => package::write_controller_3(&output, &resolved, &libraries),
        (Fmi::Three, Part::Grid) => package::write_grid_3(&output, &resolved, &libraries),
        // Others were refused for FMI 3.0.
        _ => write((args.part, number), &resolved, interface, &output, &libraries),
    };
    let platforms = written.and_then(|()| libraries.platforms(model)).map_err(|error| {
        let report = match &error {
            PackageError::NoLibrary { .. } | PackageError::NotCarried { .. } => {
                miette::miette!(
                    help = "build it with `cargo xtask fmu`, or name its folder with --libraries",
                    "{error}"
                )
            }
            _ => miette::miette!("{error}"),
        };
        // What the scenario says is the user's; the rest is the file's or the machine's.
        let code = if matches!(error, PackageError::System(_)) { 2 } else { 1 };
        Failure { report, code }
    })?;
    let platforms: Vec<&str> = match args.fmi {
        Fmi::Two => platforms,
        Fmi::Three => platforms.into_iter().map(package::platform_3).collect(),
    };
    eprintln!("wrote {} ({})", output.display(), platforms.join(", "));
    Ok(())
}

/// The number of the part asked for, which is there; 0 where none is wanted.
fn number(args: &ExportArgs, resolved: &Resolved) -> Result<u32, Failure> {
    let wrong = |report| Failure { report, code: 2 };
    let (Some(cut), true) = (args.part.cut(), args.part.is_one()) else {
        return match args.number {
            None => Ok(0),
            Some(number) => Err(wrong(miette::miette!(
                help = "`bess export cluster 2 SCENARIO` and `bess export agent 3 SCENARIO` take a number",
                "NUMBER: found {number}; expected none here"
            ))),
        };
    };
    let count = crate::control::partition::numbers(&resolved.control, cut).into_iter().max().unwrap_or(0);
    let name = if cut == Cut::Clusters { "cluster" } else { "agent" };
    match args.number {
        Some(number) if (1..=count).contains(&number) => Ok(number),
        found => {
            let found = found.map_or_else(|| "none".to_owned(), |number| number.to_string());
            Err(wrong(miette::miette!(
                help = format!(
                    "as in `bess export {name} 1 SCENARIO`; `bess cluster SCENARIO` shows who is where"
                ),
                "NUMBER: found {found}; expected the number of the {name}, 1 to {count}"
            )))
        }
    }
}

/// Writes what is asked for of a resolved scenario.
fn write(
    (part, number): (Part, u32),
    resolved: &Resolved,
    interface: Interface,
    output: &Path,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    match part {
        Part::Controller => package::write_controller(output, resolved, interface, libraries),
        Part::Grid => package::write_grid(output, resolved, interface, libraries),
        Part::System => package::write_system(output, resolved, interface, libraries),
        Part::Clusters => package::write_parts(output, resolved, Cut::Clusters, interface, libraries),
        Part::Agents => package::write_parts(output, resolved, Cut::Agents, interface, libraries),
        Part::Cluster | Part::Agent => {
            let cut = part.cut().unwrap_or(Cut::Agents);
            let mut fleet = Fleet::of(&Controller::resource(resolved), cut)?;
            // Looked at before.
            let member = fleet.parts.swap_remove(number as usize - 1);
            package::write_controller_of(output, member.resource, interface, libraries)
        }
    }
}

/// What FMI 3.0 has no need of, and what cannot hold it.
fn refuse_mixtures(args: &ExportArgs) -> Result<(), Failure> {
    let report = match (args.fmi, args.part, args.portable) {
        (Fmi::Three, Part::System, _) => miette::miette!(
            help = "export controller and grid by themselves, each with --fmi 3; or the system without it",
            "--fmi 3: a system (.ssp) holds FMUs of FMI 2.0"
        ),
        (Fmi::Three, Part::Cluster | Part::Agent | Part::Clusters | Part::Agents, _) => miette::miette!(
            help = "leave --fmi out; or export the whole controller with --fmi 3",
            "--fmi 3: clusters and agents alone are FMUs of FMI 2.0"
        ),
        (Fmi::Three, _, true) => miette::miette!(
            help = "leave --portable out: the names of FMI 3.0 are plain, P and not P[1]",
            "--portable is for FMI 2.0, not for --fmi 3"
        ),
        _ => return Ok(()),
    };
    Err(Failure { report, code: 2 })
}

/// What is named counts first, then what the program carries; beside it they lie only after a plain cargo build.
fn chosen(named: Option<&Path>, carried: &'static [u8]) -> Libraries {
    match named {
        Some(folder) => Libraries::Folder(folder.to_owned()),
        None if !carried.is_empty() => Libraries::Carried(carried),
        None => Libraries::Folder(beside_this_program()),
    }
}

/// What this program carries, in a sentence for `--help` and `--version`.
pub fn carries(carried: &'static [u8]) -> String {
    match Libraries::Carried(carried).platforms(Controller::IDENTIFIER) {
        Ok(platforms) if platforms.is_empty() => {
            "This program carries no shared libraries; `bess export` takes those beside it.".to_owned()
        }
        Ok(platforms) => format!("This program carries the shared libraries for {}.", platforms.join(", ")),
        Err(error) => error.to_string(),
    }
}

fn beside_this_program() -> PathBuf {
    std::env::current_exe()
        .ok()
        .and_then(|program| program.parent().map(PathBuf::from))
        .unwrap_or_else(|| PathBuf::from("."))
}

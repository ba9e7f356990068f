//! `bess export`: an FMU for a scenario, or both as one system.

use super::{Failure, ScenarioArgs};
use crate::fmi::{Interface, Model};
use crate::models::{Controller, Grid};
use crate::package::{self, PackageError};
use crate::scenario::Resolved;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What an FMU can be written of.
#[derive(Clone, Copy, ValueEnum)]
pub enum Part {
    /// The consensus controller
    Controller,
    /// The power network with its batteries
    Grid,
    /// Both, connected: a .ssp (SSP 1.0)
    System,
}

/// The command line of `bess export`.
#[derive(Args)]
#[command(after_help = "Examples:
  bess export controller case1
  bess export controller mine.json -o fmu/Mine.fmu
  bess export grid case1 --set grid.case=my_case.m
  bess export controller mine.json --portable     P_1 in place of P[1], nothing but Reals
  bess export system mine.json -o mine.ssp        both FMUs, connected

A system starts with the scenario's `initial` values and its events at 0 s, and with the controller on unless
those say otherwise; later events are left to the master that opens it.")]
pub struct ExportArgs {
    /// What to export
    part: Part,
    #[command(flatten)]
    scenario: ScenarioArgs,
    /// The file to write [default: BessConsensus.fmu, BessGrid.fmu or BessSystem.ssp]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Names that are C identifiers (P_1) and Reals only (true from 0.5 on), for tools that know nothing else
    #[arg(long)]
    portable: bool,
    /// Folder with the shared libraries [default: beside this program]
    #[arg(long, value_name = "DIR")]
    libraries: Option<PathBuf>,
}

/// Writes the FMU and says where it is.
pub fn export(args: &ExportArgs) -> Result<(), Failure> {
    let resolved = args.scenario.resolve()?;
    let libraries = args.libraries.clone().unwrap_or_else(beside_this_program);
    let output = args.output.clone().unwrap_or_else(|| match args.part {
        Part::Controller => PathBuf::from(format!("{}.fmu", Controller::IDENTIFIER)),
        Part::Grid => PathBuf::from(format!("{}.fmu", Grid::IDENTIFIER)),
        Part::System => PathBuf::from("BessSystem.ssp"),
    });
    let interface = if args.portable { Interface::Portable } else { Interface::Structured };
    write(args.part, &resolved, interface, &output, &libraries).map_err(|error| {
        let report = match &error {
            PackageError::NoLibrary { .. } => {
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
    eprintln!("wrote {}", output.display());
    Ok(())
}

/// Writes what is asked for of a resolved scenario.
fn write(
    part: Part,
    resolved: &Resolved,
    interface: Interface,
    output: &std::path::Path,
    libraries: &std::path::Path,
) -> Result<(), PackageError> {
    match part {
        Part::Controller => package::write_controller(output, resolved, interface, libraries),
        Part::Grid => package::write_grid(output, resolved, interface, libraries),
        Part::System => package::write_system(output, resolved, interface, libraries),
    }
}

fn beside_this_program() -> PathBuf {
    std::env::current_exe()
        .ok()
        .and_then(|program| program.parent().map(PathBuf::from))
        .unwrap_or_else(|| PathBuf::from("."))
}

//! `bess export`: an FMU for a scenario.

use super::{Failure, ScenarioArgs};
use crate::fmi::Model;
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
}

/// The command line of `bess export`.
#[derive(Args)]
#[command(after_help = "Examples:
  bess export controller case1
  bess export controller mine.json -o fmu/Mine.fmu
  bess export grid case1 --set grid.case=my_case.m")]
pub struct ExportArgs {
    /// What to export
    part: Part,
    #[command(flatten)]
    scenario: ScenarioArgs,
    /// The FMU to write [default: BessConsensus.fmu or BessGrid.fmu]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Folder with the shared libraries [default: beside this program]
    #[arg(long, value_name = "DIR")]
    libraries: Option<PathBuf>,
}

/// Writes the FMU and says where it is.
pub fn export(args: &ExportArgs) -> Result<(), Failure> {
    let resolved = args.scenario.resolve()?;
    let libraries = args.libraries.clone().unwrap_or_else(beside_this_program);
    let identifier = match args.part {
        Part::Controller => Controller::IDENTIFIER,
        Part::Grid => Grid::IDENTIFIER,
    };
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{identifier}.fmu")));
    write(args.part, &resolved, &output, &libraries).map_err(|error| {
        let report = match &error {
            PackageError::NoLibrary { .. } => {
                miette::miette!(
                    help = "build it with `cargo xtask fmu`, or name its folder with --libraries",
                    "{error}"
                )
            }
            _ => miette::miette!("{error}"),
        };
        Failure { report, code: 1 }
    })?;
    eprintln!("wrote {}", output.display());
    Ok(())
}

/// Writes one part of a resolved scenario as an FMU.
fn write(
    part: Part,
    resolved: &Resolved,
    output: &std::path::Path,
    libraries: &std::path::Path,
) -> Result<(), PackageError> {
    match part {
        Part::Controller => package::write_controller(output, resolved, libraries),
        Part::Grid => package::write_grid(output, resolved, libraries),
    }
}

fn beside_this_program() -> PathBuf {
    std::env::current_exe()
        .ok()
        .and_then(|program| program.parent().map(PathBuf::from))
        .unwrap_or_else(|| PathBuf::from("."))
}

//! `bess export`: an FMU for a scenario.

use super::{Failure, ScenarioArgs};
use crate::fmi::Model;
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
    /// Folder with the shared libraries: linux64/, win64/, aarch64-linux/, or a cargo target folder
    /// [default: those that this program carries; if it carries none, those beside it]
    #[arg(long, value_name = "DIR")]
    libraries: Option<PathBuf>,
}

/// Writes the FMU and says where it is.
pub fn export(args: &ExportArgs, carried: &'static [u8]) -> Result<(), Failure> {
    let resolved = args.scenario.resolve()?;
    let libraries = chosen(args.libraries.as_deref(), carried);
    let identifier = match args.part {
        Part::Controller => Controller::IDENTIFIER,
        Part::Grid => Grid::IDENTIFIER,
    };
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{identifier}.fmu")));
    let written = write(args.part, &resolved, &output, &libraries);
    let platforms = written.and_then(|()| libraries.platforms(identifier)).map_err(|error| {
        let report = match &error {
            PackageError::NoLibrary { .. } | PackageError::NotCarried { .. } => {
                miette::miette!(
                    help = "build it with `cargo xtask fmu`, or name its folder with --libraries",
                    "{error}"
                )
            }
            _ => miette::miette!("{error}"),
        };
        Failure { report, code: 1 }
    })?;
    eprintln!("wrote {} ({})", output.display(), platforms.join(", "));
    Ok(())
}

/// Writes one part of a resolved scenario as an FMU.
fn write(part: Part, resolved: &Resolved, output: &Path, libraries: &Libraries) -> Result<(), PackageError> {
    match part {
        Part::Controller => package::write_controller(output, resolved, libraries),
        Part::Grid => package::write_grid(output, resolved, libraries),
    }
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

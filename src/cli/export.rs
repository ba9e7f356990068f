//! `bess export`: an FMU for a scenario, or both as one system.

use super::{Failure, ScenarioArgs};
use crate::fmi::{Interface, Model};
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
#[command(after_help = "Examples:
  bess export controller case1
  bess export controller mine.json -o fmu/Mine.fmu
  bess export grid case1 --set grid.case=my_case.m
  bess export controller mine.json --portable     P_1 in place of P[1], nothing but Reals
  bess export controller mine.json --fmi 3        FMI 3.0: one array P, any number of batteries
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
    let (identifier, extension) = match args.part {
        Part::Controller => (Controller::IDENTIFIER, "fmu"),
        Part::Grid => (Grid::IDENTIFIER, "fmu"),
        Part::System => ("BessSystem", "ssp"),
    };
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{identifier}.{extension}")));
    let interface = if args.portable { Interface::Portable } else { Interface::Structured };
    // A system holds both models, built for the same platforms.
    let model = if matches!(args.part, Part::Grid) { Grid::IDENTIFIER } else { Controller::IDENTIFIER };
    let written = match args.fmi {
        Fmi::Two => write(args.part, &resolved, interface, &output, &libraries),
        Fmi::Three => write_3(args.part, &resolved, &output, &libraries),
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

/// Writes what is asked for of a resolved scenario.
fn write(
    part: Part,
    resolved: &Resolved,
    interface: Interface,
    output: &Path,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    match part {
        Part::Controller => package::write_controller(output, resolved, interface, libraries),
        Part::Grid => package::write_grid(output, resolved, interface, libraries),
        Part::System => package::write_system(output, resolved, interface, libraries),
    }
}

/// The same for FMI 3.0.
fn write_3(
    part: Part,
    resolved: &Resolved,
    output: &Path,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    match part {
        Part::Controller => package::write_controller_3(output, resolved, libraries),
        Part::Grid => package::write_grid_3(output, resolved, libraries),
        Part::System => package::write_system(output, resolved, Interface::Structured, libraries),
    }
}

/// What FMI 3.0 has no need of, and what cannot hold it.
fn refuse_mixtures(args: &ExportArgs) -> Result<(), Failure> {
    let report = match (args.fmi, args.part, args.portable) {
        (Fmi::Three, Part::System, _) => miette::miette!(
            help = "export controller and grid by themselves, each with --fmi 3; or the system without it",
            "--fmi 3: a system (.ssp) holds FMUs of FMI 2.0"
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

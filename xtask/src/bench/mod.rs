//! Measures speed against the bars. A missed bar is a figure, not an error: what a machine is able to do
//! is no property of the source. What cannot be measured says why, and counts as nothing.
//!
//! One file per family of rows; each gives back its rows and leaves the printing to this one.

mod case1;
mod controller;
mod drive;
mod dynamics;
mod export;
mod federation;
mod fmu;
mod instructions;
mod peers;
mod power_flow;
mod program;
mod row;
mod summary;

use crate::{error::Failure, workspace::Workspace};
use clap::ValueEnum;
use row::Row;

/// One family of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Family {
    /// Case 1, both FMUs in the harness, against ANDES
    Case1,
    /// The controller's step for a million agents, against the floor of the machine
    Controller,
    /// The FMU of seven agents through its C interface, against the same law in C and in NumPy
    Fmu,
    /// Export and load of 10,000 agents, against FMPy
    Export,
    /// The power flow against lightsim2grid and MATPOWER
    PowerFlow,
    /// A grid of 9241 buses with 1,445 BESS against real time
    Dynamics,
    /// Federations of 2 to 16 over HELICS, against bare rings of the same size
    Federation,
    /// Instruction counts of the hot loops, by valgrind
    Instructions,
}

impl Family {
    fn measure(self, workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
        match self {
            Family::Case1 => case1::rows(workspace, runs),
            Family::Controller => controller::rows(workspace, runs),
            Family::Fmu => fmu::rows(workspace, runs),
            Family::Export => export::rows(workspace, runs),
            Family::PowerFlow => power_flow::rows(workspace, runs),
            Family::Dynamics => dynamics::rows(workspace, runs),
            Family::Federation => federation::rows(workspace, runs),
            Family::Instructions => instructions::rows(workspace),
        }
    }
}

impl Family {
    /// As on the command line.
    fn name(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
    }
}

/// Measures these families (all, if none is named), prints a table, brings target/bench/summary.json up to date.
pub fn run(workspace: &Workspace, runs: u32, only: &[Family]) -> Result<(), Failure> {
    let folder = workspace.target.join("bench");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let (mut measured, mut shown) = (Vec::new(), Vec::new());
    for &family in Family::value_variants().iter().filter(|family| only.is_empty() || only.contains(family)) {
        // One that fails as a whole must not take the others along.
        let rows = family.measure(workspace, runs).unwrap_or_else(|failure| {
            vec![Row::unknown(format!("all of {}", family.name()), "", failure.to_string())]
        });
        shown.extend(rows.iter().cloned());
        measured.push((family, rows));
    }
    print!("medians of {runs} runs:\n{}", row::table(&shown));
    println!("{}", summary::merge(workspace, &measured)?.display());
    Ok(())
}

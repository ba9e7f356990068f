//! Measures speed against the bars. A missed bar is a figure, not an error: what a machine is able to do
//! is no property of the source. What cannot be measured says why, and counts as nothing.
//!
//! One file per family of rows; each gives back its rows and leaves the printing to this one.

mod case1;
mod controller;
mod dynamics;
mod export;
mod instructions;
mod peers;
mod power_flow;
mod program;
mod row;

use crate::{error::Failure, workspace::Workspace};
use clap::ValueEnum;
use row::Row;
use serde_json::Value;

/// One family of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Family {
    /// Case 1, both FMUs in the harness, against ANDES
    Case1,
    /// The controller's step for a million agents, against the floor of the machine
    Controller,
    /// Export of 10,000 agents, against FMPy's reading of it
    Export,
    /// The power flow against lightsim2grid and MATPOWER
    PowerFlow,
    /// A grid of 9241 buses with 1,445 BESS against real time
    Dynamics,
    /// Instruction counts of the hot loops, by valgrind
    Instructions,
}

impl Family {
    fn measure(self, workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
        match self {
            Family::Case1 => case1::rows(workspace, runs),
            Family::Controller => controller::rows(workspace, runs),
            Family::Export => export::rows(workspace, runs),
            Family::PowerFlow => power_flow::rows(workspace, runs),
            Family::Dynamics => dynamics::rows(workspace, runs),
            Family::Instructions => instructions::rows(workspace),
        }
    }
}

/// Measures these families (all, if none is named), prints a table, writes target/bench/summary.json.
pub fn run(workspace: &Workspace, runs: u32, only: &[Family]) -> Result<(), Failure> {
    let folder = workspace.target.join("bench");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let mut rows = Vec::new();
    for family in Family::value_variants().iter().filter(|family| only.is_empty() || only.contains(family)) {
        rows.extend(family.measure(workspace, runs)?);
    }
    print!("medians of {runs} runs:\n{}", row::table(&rows));
    let path = folder.join("summary.json");
    let text = format!("{:#}\n", rows.iter().map(Row::json).collect::<Value>());
    std::fs::write(&path, text).map_err(Failure::file("write", &path))?;
    println!("{}", path.display());
    Ok(())
}

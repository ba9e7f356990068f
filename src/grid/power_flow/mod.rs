//! The power flow: Newton's method in polar coordinates, sparse. Its bus voltages turn the loads into
//! admittances. Enforces no reactive limits, as MATPOWER by default.
//!
//! One power flow of a case: [`power_flow()`]. Many of the same network: keep a [`PowerFlowSolver`].

mod connected;
mod network;
mod solver;
mod specified;

pub use solver::{Convergence, PowerFlowSolver};

use super::case::Case;
use super::error::GridError;
use faer::c64;

/// Where Newton's method starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// The `vm`, `va` of the bus table.
    #[default]
    Case,
    /// 1 pu at the reference angle.
    Flat,
}

/// A solved power flow, in the order of the bus table; isolated buses are at 0 pu.
#[derive(Clone, Debug, PartialEq)]
pub struct PowerFlow {
    /// Voltage magnitudes, pu.
    pub vm: Vec<f64>,
    /// Voltage angles, rad.
    pub va: Vec<f64>,
    /// Complex power injected into the network at each bus, pu: generation less load.
    pub injection: Vec<c64>,
    /// Newton iterations made.
    pub iterations: usize,
    /// Largest power mismatch left, pu.
    pub mismatch: f64,
}

/// Solves the power flow of a validated case from `start`.
pub fn power_flow(case: &Case, start: Start) -> Result<PowerFlow, GridError> {
    let mut solver = PowerFlowSolver::new(case, start)?;
    let Convergence { iterations, mismatch, .. } = solver.solve()?;
    let buses = 0..case.bus.len();
    Ok(PowerFlow {
        vm: buses.clone().map(|k| solver.vm(k)).collect(),
        va: buses.clone().map(|k| solver.va(k)).collect(),
        injection: buses.map(|k| solver.injection(k)).collect(),
        iterations,
        mismatch,
    })
}

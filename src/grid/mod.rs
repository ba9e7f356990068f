//! The plant: network, power flow, droop inverter, battery, loads, tie; and the agent model. Pure:
//! no I/O, no FMI. Quantities in per unit on the system base, time in s, angles in rad, the paper's
//! letters in ASCII.
//!
//! | file | what it is |
//! |---|---|
//! | [`case`], [`matpower`] | the network data, from JSON or MATPOWER's own format |
//! | [`config`] | everything the grid model is made from, with its validation |
//! | [`admittance`] | the bus admittance matrix |
//! | [`mod@power_flow`] | the operating point that turns loads into admittances |
//! | [`sparse`] | linear equations on a static pattern |
//! | [`load`] | impedance, constant-power and ZIP loads |
//! | [`plant`], [`network`], [`reduction`], [`lu`], [`workspace`] | what the sources see of the network |
//! | [`bess`] | the paper's (1) to (3), angle and battery, one function each |
//! | [`dynamics`] | the right-hand side made of those |
//! | [`integrator`] | embedded Runge-Kutta 5(4) with error control |
//! | `ramp` | a step whose inputs move |
//! | [`tangent`] | what the readings do along a direction of the inputs, or in time |
//! | [`steady_state`] | where a simulation starts |
//! | [`model`], [`state`] | the grid model: inputs, steps, outputs, its state |
//! | [`distance`] | electrical distances between BESS buses |
//! | [`agents`] | the paper's (5)-(6), to check the theory with |
#![forbid(unsafe_code)]
#![allow(non_snake_case)]

pub mod admittance;
pub mod agents;
pub mod bess;
pub mod case;
pub mod config;
pub mod distance;
pub mod dynamics;
pub mod error;
pub mod integrator;
pub mod load;
pub mod lu;
pub mod matpower;
mod matpower_text;
pub mod model;
pub mod network;
pub mod plant;
pub mod power_flow;
mod ramp;
pub mod reduction;
pub mod sparse;
pub mod state;
pub mod steady_state;
pub mod tangent;
mod trigonometry;
pub mod workspace;

pub use agents::{Agents, Controls};
pub use case::{Branch, Bus, Case, Generator};
pub use config::{Bess, CaseSource, Config, NetworkMethod, Tie, Tolerances};
pub use distance::electrical_distances;
pub use error::GridError;
pub use load::LoadModel;
pub use model::GridModel;
pub use power_flow::{Convergence, PowerFlow, PowerFlowSolver, Start, power_flow};
pub use state::{Inputs, Parameters, State};

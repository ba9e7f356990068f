//! The paper: graph, clustering, protocol, discretisation, delay, certificates. Pure: no I/O, no FMI,
//! no knowledge of any plant.
//!
//! Everything is per unit on the system base; omega in pu of nominal, time in s (counted in integer
//! ns), energy in pu*h. Agents count from 0 inside and from 1 in JSON, events and outputs.
#![forbid(unsafe_code)]
// The paper's letters (K_P, P_set, u_P) are the names that users know from its equations.
#![allow(non_snake_case)]

pub mod communication;
pub mod config;
pub mod error;
pub mod graph;
mod validate;

pub use config::Config;
pub use error::{ConfigError, Problem};

//! The paper: graph, clustering, protocol, discretisation, delay, certificates. Pure: no I/O, no FMI,
//! no knowledge of any plant.
//!
//! Everything is per unit on the system base; omega in pu of nominal, time in s (counted in integer
//! ns), energy in pu*h. Agents count from 0 inside and from 1 in JSON, events and outputs.
//!
//! | file | what it is for |
//! |---|---|
//! | `config`, `communication`, `validate`, `error` | what a controller is made from, and what is wrong with it |
//! | `sized` | the same for another number of agents |
//! | `graph`, `clustering`, `topology`, `network` | who talks to whom, from distances to the hot path's arrays |
//! | `protocol`, `discretisation`, `exchange`, `estimator` | the laws (9)-(13), one function per equation |
//! | `sweep`, `wave`, `blocks`, `diagonals`, `ahead`, `kernels`, `power`, `diagnosis`, `order` | the same for many agents at once, in vector code |
//! | `few`, `lanes`, `roster`; `plain` | the same for a handful of agents; when either will do |
//! | `delay`, `channel`, `lag` | what agents know of each other, how late that is |
//! | `fade` | how the exchange comes in, and moves where links come and go |
//! | `part`, `partition`, `messages`, `across`, `outer`, `election` | one part of a fleet: what it is, tells and hears, who leads it |
//! | `told`, `outlier` | wrong messages, and the option that sorts outliers out |
//! | `limits`, `authority`, `relay`, `saturation` | what they can do, and what becomes of what they cannot |
//! | `certificates`, `spectrum` | how long it takes |
//! | `scalar`, `tangent`, `tangent_limits`, `tangent_diagnostics` | the laws in dual numbers: what the outputs do along a direction |
//! | `controller`, `adopt`, `evaluate`, `step`, `state`, `io`, `event` | the controller around them |
#![forbid(unsafe_code)]
// The paper's letters (K_P, P_set, u_P) are the names that users know from its equations.
#![allow(non_snake_case)]

mod across;
mod adopt;
mod ahead;
pub mod authority;
mod blocks;
pub mod certificates;
mod channel;
pub mod clustering;
pub mod communication;
pub mod config;
mod controller;
pub mod delay;
mod diagnosis;
mod diagonals;
pub mod discretisation;
mod election;
pub mod error;
pub mod estimator;
mod evaluate;
pub mod event;
pub mod exchange;
mod fade;
mod few;
pub mod graph;
pub mod io;
mod kernels;
pub mod lag;
mod lanes;
pub mod limits;
pub mod messages;
pub mod network;
pub mod order;
pub mod outer;
pub mod outlier;
pub mod part;
pub mod partition;
mod plain;
pub mod power;
pub mod protocol;
pub mod relay;
mod roster;
mod saturation;
pub mod scalar;
pub mod sized;
pub mod spectrum;
mod state;
mod step;
mod sweep;
pub mod tangent;
mod tangent_diagnostics;
mod tangent_limits;
mod time;
pub mod told;
pub mod topology;
mod validate;
mod wave;

pub use adopt::{Spectrum, Tie};
pub use config::Config;
pub use controller::Controller;
pub use error::{ConfigError, Problem};
pub use event::Event;
pub use io::{Inputs, Outputs, Parameters};
pub use state::State;

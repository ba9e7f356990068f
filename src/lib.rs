//! Distributed, step-by-step, finite-time consensus control of battery energy storage systems
//! (BESS) with droop control, after Zhang, Song and Fei, as FMI 2.0 co-simulation FMUs.
//!
//! The rooms, from the foundation up; each may use only those above it in this list:
//!
//! | room | what it is for |
//! |---|---|
//! | [`control`] | the paper: graph, clustering, protocol, discretisation, delay, certificates |
//! | [`grid`] | the plant: network, power flow, droop inverter, battery, loads, tie; the agent model |
//! | [`fmi`] | FMI 2.0 and nothing of physics |
//! | [`scenario`] | the user's JSON and its validation |
//! | [`models`] | the two FMUs: control and grid behind the trait of `fmi` |
//! | [`package`] | the `.fmu` archives, and the `.ssp` of both |
//! | [`harness`] | the importer side: load, couple, record |
//! | [`federation`] | federates of HELICS |
//! | [`check`] | what is wrong with an FMU |
//! | [`report`] | what a person looks at |
//! | [`cli`] | parse, call one function, print |

#[cfg(feature = "controller")]
pub mod control;
pub mod fmi;
#[cfg(feature = "grid")]
pub mod grid;

#[cfg(feature = "host")]
pub mod check;
#[cfg(feature = "host")]
pub mod cli;
#[cfg(feature = "host")]
pub mod federation;
#[cfg(feature = "host")]
pub mod harness;
#[cfg(any(feature = "controller", feature = "grid"))]
pub mod models;
#[cfg(feature = "host")]
pub mod package;
#[cfg(feature = "host")]
pub mod report;
#[cfg(feature = "host")]
pub mod scenario;

//! The two models behind the FMUs: the only room that knows both physics and FMI. Nothing is computed here;
//! each model says what its variables are and passes calls on.
#![forbid(unsafe_code)]
// The paper's letters are the names of the interface.
#![allow(non_snake_case)]

#[cfg(feature = "controller")]
mod controller;
#[cfg(feature = "controller")]
pub mod fleet;
#[cfg(feature = "grid")]
mod grid;
mod planes;
mod resource;
mod variables;

#[cfg(feature = "controller")]
pub use controller::Controller;
#[cfg(feature = "grid")]
pub use grid::Grid;
pub use resource::Resource;

/// What makes a controller.
#[cfg(feature = "controller")]
pub type ControllerResource = Resource<crate::control::Config>;

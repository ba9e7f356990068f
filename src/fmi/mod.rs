//! FMI 2.0 co-simulation and nothing of physics: a shell over one trait, [`Model`].

#[allow(missing_docs, non_camel_case_types, non_upper_case_globals, clippy::all)]
#[rustfmt::skip]
pub mod bindings;
pub mod model;
pub mod registry;

pub use model::{Log, LogLevel, Model, ModelError, Phase, Step};
pub use registry::{Access, Causality, Dependencies, Group, Range, Unit, Variability};

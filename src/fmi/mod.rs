//! FMI 2.0 and 3.0 co-simulation and nothing of physics: a shell over one trait, [`Model`].
//!
//! From the foundation up: [`registry`] (what a model declares), [`lookup`] (value references),
//! [`call_order`], [`time`], [`logging`], [`error`]; then [`instance`], the whole behaviour in safe
//! code; then [`shell`], which only turns C pointers into slices, and [`export`], the symbols.
//! [`model_description`] reads the same list of variables as the instance does. [`three`] is FMI 3.0 over the same
//! instance and the same list, one array for each group; [`shape`] what it lets a user choose.

#[allow(missing_docs, non_camel_case_types, non_upper_case_globals, non_snake_case, clippy::all)]
#[rustfmt::skip]
pub mod bindings;
pub mod call_order;
mod derivatives;
pub mod error;
pub mod export;
pub mod guid;
pub mod instance;
mod known;
pub mod logging;
pub mod lookup;
pub mod model;
pub mod model_description;
pub mod registry;
pub mod resource_location;
pub mod shape;
pub mod shell;
pub mod state;
pub mod three;
pub mod time;
mod values;

pub use call_order::{Function, State};
pub use error::Error;
pub use guid::{Guid, fingerprint};
pub use instance::Instance;
pub use logging::{Category, Logger, Sink};
pub use lookup::{Interface, Registry, Type};
pub use model::{Along, Log, LogLevel, Model, ModelError, Phase, Plane, Step};
pub use registry::{Access, Causality, Dependencies, Group, Range, Row, Unit, Variability};
pub use shape::{Array, Shape, Size, Values};
pub use state::Snapshot;

//! FMI 3.0 co-simulation over the same models, the same list of variables and the same [`crate::fmi::Instance`] as
//! FMI 2.0: each group of the registry is one variable, an array where it has elements, and its sizes are structural
//! parameters. What a value is, when it may be set and what a step does is decided there, so that both standards
//! give the same results bit for bit; here are only FMI 3.0's states, its arrays and the building anew of a model whose
//! sizes have been changed.

#[allow(missing_docs, non_camel_case_types, non_upper_case_globals, non_snake_case, clippy::all)]
#[rustfmt::skip]
pub mod bindings;
pub mod call_order;
mod dependencies;
mod derivatives;
pub mod error;
pub mod export;
pub mod instance;
pub mod model_description;
pub mod shell;
pub mod state;
pub mod table;
mod values;

pub use call_order::{Function, State};
pub use dependencies::Dependency;
pub use error::{Error, Outcome, Reason};
pub use instance::Instance;
pub use state::Snapshot;
pub use table::Type;

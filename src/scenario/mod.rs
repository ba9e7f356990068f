//! One JSON document that says everything about a co-simulation, its schema and its validation. Reads files,
//! writes none.
#![forbid(unsafe_code)]

pub mod connection;
pub mod document;
pub mod equal_names;
mod error;
mod extends;
pub mod fault;
mod load;
mod resolve;
mod resolve_control;
mod resolve_grid;
pub mod units;

pub use document::Scenario;
pub use error::ScenarioError;
pub use load::{BUILT_IN, Source, find, parse_assignment, read};
pub use resolve::{Resolved, nanoseconds};

/// The JSON Schema of a scenario, as published in `schema/scenario.schema.json`.
pub fn schema() -> String {
    let schema = schemars::schema_for!(Scenario);
    let mut text = serde_json::to_string_pretty(&schema).unwrap_or_default();
    text.push('\n');
    text
}

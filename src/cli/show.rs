//! `bess show` and `bess schema`: what to start a scenario from.

use super::{Failure, ScenarioArgs, print};
use crate::scenario;
use miette::IntoDiagnostic;

/// Prints the scenario: as it stands, or with defaults and changed keys filled in when keys are changed.
pub fn show(args: &ScenarioArgs) -> Result<(), Failure> {
    let source = scenario::find(&args.scenario).map_err(Failure::scenario)?;
    let read = scenario::read(&source, &args.assignments()).map_err(Failure::scenario)?;
    if args.set.is_empty() {
        return print(&source.text);
    }
    print(&format!("{}\n", serde_json::to_string_pretty(&read).into_diagnostic()?))
}

/// Prints the JSON Schema.
pub fn schema() -> Result<(), Failure> {
    print(&scenario::schema())
}

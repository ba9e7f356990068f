//! The `.ssp` archive (SSP 1.0) of controller and grid: both FMUs, who is connected to whom, and the values that
//! a scenario starts with. Events after the start are the master's business; SSP has no place for them.

mod connections;
mod part;
mod parts;
mod ssd;
mod ssv;

use super::archive::{self, Entries};
use super::{Libraries, PackageError, controller, grid};
use crate::fmi::{Interface, Model};
use crate::models::{Controller, Grid};
use crate::scenario::Resolved;
use part::Part;
pub use parts::write_parts;
use serde_json::{Map, Value};
use std::path::Path;

/// Name of the controller's component, as in scenarios and results.
const CONTROLLER: &str = "controller";
/// Name of the grid's component.
const GRID: &str = "grid";
/// Name of both parameter sets: Ecos takes the sets of one name together.
const PARAMETER_SET: &str = "scenario";

/// What in a scenario does not fit the two FMUs. `path` is the key of the scenario.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SystemError {
    /// No variable of that name.
    #[error("{path}: \"{found}\" is no {expected}")]
    Unknown {
        /// Where it stands.
        path: String,
        /// The name.
        found: String,
        /// What was looked for, with an example.
        expected: &'static str,
    },
    /// The FMU does not accept the value.
    #[error("{path}: {reason}")]
    Refused {
        /// Where it stands.
        path: String,
        /// What the FMU says.
        reason: String,
    },
    /// Two ends of different types.
    #[error("{path}: {from} ({from_type}) feeds {to} ({to_type}); expected equal types, or --portable")]
    Types {
        /// Where it stands.
        path: String,
        /// The output.
        from: String,
        /// Its FMI type.
        from_type: String,
        /// The input.
        to: String,
        /// Its FMI type.
        to_type: String,
    },
}

/// Writes the system of both FMUs for a scenario.
pub fn write_system(
    path: &Path,
    resolved: &Resolved,
    interface: Interface,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    let (controller_model, controller_fmu) = controller(resolved, interface, libraries)?;
    let (grid_model, grid_fmu) = grid(resolved, interface, libraries)?;
    let start = start_values(resolved);
    part::check_owners(&start, &[CONTROLLER, GRID])?;
    let parts = [
        Part::new((CONTROLLER, file(Controller::IDENTIFIER)), controller_model, interface, &start)?,
        Part::new((GRID, file(Grid::IDENTIFIER)), grid_model, interface, &start)?,
    ];
    let connections = connections::between(&parts, &resolved.wires)?;
    write(path, resolved, (&parts, &[controller_fmu, grid_fmu]), &connections)
}

/// Writes components with their FMUs, connected.
fn write(
    path: &Path,
    resolved: &Resolved,
    (parts, fmus): (&[Part], &[Entries]),
    connections: &[connections::Connection],
) -> Result<(), PackageError> {
    let written = |e: std::io::Error| PackageError::Archive { file: path.into(), cause: e.to_string() };
    let mut entries = Entries::new();
    let structure = ssd::write(resolved, parts, connections).map_err(written)?;
    entries.insert("SystemStructure.ssd".to_owned(), structure);
    for (part, fmu) in parts.iter().zip(fmus) {
        entries.insert(part.source.clone(), archive::packed(path, fmu)?);
        entries.insert(part.parameter_file(), ssv::write(part, connections).map_err(written)?);
    }
    archive::write(path, &entries)
}

/// Where an FMU lies in the archive.
fn file(identifier: &str) -> String {
    format!("resources/{identifier}.fmu")
}

/// Where a value stands in the scenario, which variable it is for (`grid.dP_load[12]`), and the value.
#[derive(Clone)]
struct Start {
    path: String,
    variable: String,
    value: f64,
}

/// The scenario's values at the start: `initial`, then the events at 0 s. The controller is on unless the scenario
/// says otherwise, because nobody can turn it on in a system that is only opened and run.
fn start_values(resolved: &Resolved) -> Vec<Start> {
    let scenario = &resolved.scenario;
    let mut all =
        vec![Start { path: "initial".into(), variable: format!("{CONTROLLER}.enable"), value: 1.0 }];
    let mut take = |path: String, values: &Map<String, Value>| {
        for (variable, value) in values {
            // Resolution has let through nothing but numbers and Booleans.
            let number = value.as_f64().or_else(|| value.as_bool().map(|b| f64::from(u8::from(b))));
            if let Some(value) = number {
                all.push(Start { path: format!("{path}.{variable}"), variable: variable.clone(), value });
            }
        }
    };
    take("initial".into(), &scenario.initial);
    for (k, event) in scenario.events.iter().enumerate().filter(|(_, event)| event.at_s == 0.0) {
        take(format!("events[{k}].set"), &event.set);
    }
    all
}

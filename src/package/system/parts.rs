//! The `.ssp` archive of a fleet in parts: an FMU for each cluster or agent, the grid, and who is connected to whom:
//! measurements and setpoints as with the whole controller, messages from part to part.

use super::connections::{Connection, between, listed};
use super::part::{Part, check_owners};
use super::{CONTROLLER, GRID, Start, SystemError, file, start_values, write};
use crate::fmi::{Interface, Model};
use crate::models::fleet::{Cut, Fleet, NO_ONE_PLACE};
use crate::models::{Controller, Grid};
use crate::package::{Libraries, PackageError, controller_of, grid};
use crate::scenario::Resolved;
use crate::scenario::connection::Wire;
use std::path::Path;

/// Writes the system of a fleet in parts and its grid for a scenario.
pub fn write_parts(
    path: &Path,
    resolved: &Resolved,
    cut: Cut,
    interface: Interface,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    let whole = Controller::resource(resolved);
    let fleet = Fleet::of(&whole, cut)?;
    let (grid_model, grid_fmu) = grid(resolved, interface, libraries)?;
    let start = start_values(resolved);
    check_owners(&start, &[CONTROLLER, GRID])?;
    let grid_part = Part::new((GRID, file(Grid::IDENTIFIER)), grid_model, interface, &start)?;
    // As the user wrote it: names, values and wires are those of the whole controller.
    let whole = Part::new((CONTROLLER, String::new()), Controller::new(whole)?, interface, &start)?;
    let whole = [whole, grid_part];
    let mut wires = Vec::new();
    for connection in between(&whole, &resolved.wires)? {
        wires.extend(spread(&fleet, &connection)?);
    }
    let [_, grid_part] = whole;
    let start: Vec<Start> = start.iter().flat_map(|value| placed(&fleet, value)).collect();
    let (mut parts, mut fmus) = (Vec::new(), Vec::new());
    for member in &fleet.parts {
        let (model, fmu) = controller_of(member.resource.clone(), interface, libraries)?;
        let source = format!("resources/{}", member.archive);
        parts.push(Part::new((&member.name, source), model, interface, &start)?);
        fmus.push(fmu);
    }
    parts.push(grid_part);
    fmus.push(grid_fmu);
    wires.extend(messages(&fleet));
    let connections = listed(&parts, &wires)?;
    write(path, resolved, (&parts, &fmus), &connections)
}

/// What one wire of the whole controller becomes. Refused from what no one part knows.
fn spread(fleet: &Fleet, connection: &Connection) -> Result<Vec<Wire>, SystemError> {
    let (part, variable) = connection.from;
    if part.name == CONTROLLER && fleet.only_place(&variable.structured).is_none() {
        let [found, expected] = NO_ONE_PLACE;
        let (path, name) = ("connections".to_owned(), &variable.structured);
        let reason = format!("{CONTROLLER}.{name} is {found}; expected {expected}");
        return Err(SystemError::Refused { path, reason });
    }
    let places =
        |(part, variable): (&Part, &super::part::Variable)| named(fleet, &part.name, &variable.structured);
    let (from, to) = (places(connection.from), places(connection.to));
    let pairs = from.iter().flat_map(|from| to.iter().map(move |to| (from, to)));
    Ok(pairs.map(|(from, to)| wire(from, to, (connection.factor, connection.offset))).collect())
}

/// Where a variable of a participant is when the controller is in parts.
fn named(fleet: &Fleet, owner: &str, variable: &str) -> Vec<String> {
    if owner != CONTROLLER {
        return vec![format!("{owner}.{variable}")];
    }
    let places = fleet.places(variable).into_iter();
    places.filter_map(|(part, name)| Some(format!("{}.{name}", fleet.parts.get(part)?.name))).collect()
}

fn placed(fleet: &Fleet, start: &Start) -> Vec<Start> {
    let (owner, variable) = start.variable.split_once('.').unwrap_or((GRID, &start.variable));
    let names = named(fleet, owner, variable).into_iter();
    names.map(|variable| Start { variable, ..start.clone() }).collect()
}

fn wire(from: &str, to: &str, (factor, offset): (f64, f64)) -> Wire {
    let (from, to) = (from.to_owned(), to.to_owned());
    Wire { from, to, factor, offset, from_unit: None, to_unit: None, line: 0 }
}

/// The wires of all messages.
fn messages(fleet: &Fleet) -> Vec<Wire> {
    let name = |part: usize| fleet.parts.get(part).map_or("", |member| member.name.as_str());
    let mut wires = Vec::new();
    for way in fleet.ways() {
        for word in &fleet.words {
            let from = format!("{}.local_{word}[{}]", name(way.from.0), way.from.1);
            let to = format!("{}.remote_{word}[{}]", name(way.to.0), way.to.1);
            wires.push(wire(&from, &to, (1.0, 0.0)));
        }
    }
    wires
}

//! A scenario with its controller in parts, each a participant of its own: who takes part, what is connected, and where
//! the variables of the whole are found. For those who run participants apart from each other.

use super::coupling::{Connection, CouplingError, Endpoint};
use super::description::{Causality, Variable};
use super::error::HarnessError;
use super::observer::Column;
use super::participant::{CallError, Participant};
use super::plan::{Event, Plan, Setting};
use super::scenario::{CONTROLLER, Cast, Staged, in_process, stage};
use super::screened::Screened;
use super::value::Kind;
use crate::models::Controller;
use crate::models::fleet::{Cut, Fleet, NO_ONE_PLACE};
use crate::scenario::Resolved;
use crate::scenario::fault::WireFault;
use std::collections::BTreeSet;

/// Participants to be run apart, and the whole that they make.
pub struct Apart {
    /// All of them, with the plan that couples them.
    pub staged: Staged,
    /// The plan of the whole.
    pub whole: Plan,
    /// The columns of the whole, each with its sources: of several the largest counts.
    pub columns: Vec<(Column, Vec<Endpoint>)>,
}

/// The participants of a scenario; with `cut` the controller is in parts.
pub fn stage_apart(resolved: &Resolved, cast: &Cast, cut: Option<Cut>) -> Result<Apart, HarnessError> {
    let (mut participants, whole) = stage(resolved, cast)?;
    let Some(cut) = cut else {
        let columns = columns(&participants, &whole).map(|column| {
            let source = Endpoint::new(&*column.participant, &*column.variable);
            (column, vec![source])
        });
        let columns = columns.collect();
        return Ok(Apart { staged: (participants, whole.clone()), whole, columns });
    };
    let refused = |reason: String| HarnessError::Call {
        participant: CONTROLLER.to_owned(),
        source: CallError::new("fmi2Instantiate", reason),
    };
    let fleet =
        Fleet::of(&Controller::resource(resolved), cut).map_err(|error| refused(error.to_string()))?;
    let mut parts: Vec<Box<dyn Participant>> = Vec::with_capacity(fleet.parts.len() + 1);
    let faults = faults(&fleet, &resolved.faults);
    for (k, part) in fleet.parts.iter().enumerate() {
        let own = in_process(&part.name, Controller::new(part.resource.clone()))?;
        let screened = Screened::new(own, &faults, true)?;
        // The same noise as in one part.
        let there = |name: &str| reference(&participants, &fleet.in_fleet(k, name)?);
        parts.push(Box::new(screened.drawn_as(there)));
    }
    let columns = columns(&participants, &whole)
        .map(|column| {
            let sources = places(&fleet, &column.participant, &column.variable);
            let is_there = |source: &Endpoint| {
                source.participant != CONTROLLER && has(&participants, &parts, source, column.kind)
            };
            let sources: Vec<Endpoint> = sources.into_iter().filter(is_there).collect();
            (column, sources)
        })
        .filter(|(_, sources)| !sources.is_empty())
        .collect();
    participants.retain(|participant| participant.name() != CONTROLLER);
    let plan = spread(&fleet, &whole)?;
    parts.extend(participants);
    Ok(Apart { staged: (parts, plan), whole, columns })
}

/// The faults of the whole controller's inputs, where those are now.
fn faults(fleet: &Fleet, whole: &[WireFault]) -> Vec<WireFault> {
    let of = |fault: &WireFault| -> Vec<WireFault> {
        let Some((CONTROLLER, variable)) = fault.signal.split_once('.') else { return Vec::new() };
        let places = places(fleet, CONTROLLER, variable).into_iter();
        places.map(|place| WireFault { signal: place.to_string(), ..fault.clone() }).collect()
    };
    whole.iter().flat_map(of).collect()
}

/// Reference of an input of the whole controller.
fn reference(participants: &[Box<dyn Participant>], name: &str) -> Option<u32> {
    let whole = participants.iter().find(|participant| participant.name() == CONTROLLER)?;
    let is_it = |v: &&Variable| v.name == name && v.causality == Causality::Input;
    whole.variables().iter().find(is_it).map(|v| v.reference)
}

/// What is recorded of a plan, in the master's order: each participant's outputs by type, then what events set.
fn columns<'a>(
    participants: &'a [Box<dyn Participant>],
    plan: &Plan,
) -> impl Iterator<Item = Column> + use<'a> {
    let set: BTreeSet<(String, String)> = plan
        .events
        .iter()
        .flat_map(|event| &event.sets)
        .map(|setting| (setting.participant.clone(), setting.variable.clone()))
        .collect();
    participants.iter().flat_map(move |participant| {
        let column = |variable: &Variable| Column {
            participant: participant.name().to_owned(),
            variable: variable.name.clone(),
            kind: variable.kind,
            unit: variable.unit.clone(),
        };
        let all = participant.variables();
        let mut own: Vec<Column> = Vec::new();
        for kind in [Kind::Real, Kind::Integer, Kind::Boolean] {
            own.extend(all.iter().filter(|v| v.causality == Causality::Output && v.kind == kind).map(column));
        }
        let is_set = |v: &&Variable| set.contains(&(participant.name().to_owned(), v.name.clone()));
        own.extend(all.iter().filter(is_set).map(column));
        own
    })
}

fn has(
    participants: &[Box<dyn Participant>],
    parts: &[Box<dyn Participant>],
    endpoint: &Endpoint,
    kind: Kind,
) -> bool {
    let mut owners = participants.iter().chain(parts).filter(|p| p.name() == endpoint.participant);
    owners.any(|p| p.variables().iter().any(|v| v.name == endpoint.variable && v.kind == kind))
}

/// Where a variable of the whole is.
fn places(fleet: &Fleet, participant: &str, variable: &str) -> Vec<Endpoint> {
    if participant != CONTROLLER {
        return vec![Endpoint::new(participant, variable)];
    }
    let places = fleet.places(variable).into_iter();
    places.filter_map(|(part, name)| Some(Endpoint::new(&*fleet.parts.get(part)?.name, name))).collect()
}

/// The plan of the whole, for the parts: its wires and values where they belong now, and all ways of messages.
/// Refuses a wire from what no one part knows.
fn spread(fleet: &Fleet, whole: &Plan) -> Result<Plan, CouplingError> {
    let mut connections = Vec::with_capacity(whole.connections.len());
    for Connection { from, to, factor, offset } in &whole.connections {
        if from.participant == CONTROLLER && fleet.only_place(&from.variable).is_none() {
            let [found, expected] = NO_ONE_PLACE;
            let (place, name) = (format!("the connection to {to}"), from.clone());
            return Err(CouplingError::Role { place, name, found: found.to_owned(), expected });
        }
        for to in places(fleet, &to.participant, &to.variable) {
            for from in places(fleet, &from.participant, &from.variable) {
                connections.push(Connection { from, to: to.clone(), factor: *factor, offset: *offset });
            }
        }
    }
    let name = |part: usize| fleet.parts.get(part).map_or("", |member| member.name.as_str());
    for way in fleet.ways() {
        for word in &fleet.words {
            connections.push(Connection::new(
                Endpoint::new(name(way.from.0), format!("local_{word}[{}]", way.from.1)),
                Endpoint::new(name(way.to.0), format!("remote_{word}[{}]", way.to.1)),
            ));
        }
    }
    let settings = |settings: &[Setting]| -> Vec<Setting> {
        let of = |setting: &Setting| {
            let places = places(fleet, &setting.participant, &setting.variable).into_iter();
            let value = setting.value;
            places
                .map(move |place| Setting::new(place.participant, place.variable, value))
                .collect::<Vec<_>>()
        };
        settings.iter().flat_map(of).collect()
    };
    Ok(Plan {
        connections,
        initial: settings(&whole.initial),
        events: whole
            .events
            .iter()
            .map(|event| Event { at_ns: event.at_ns, sets: settings(&event.sets) })
            .collect(),
        ..whole.clone()
    })
}

//! Which output feeds which input, by name. Checked and compiled by `wiring`; nothing runs here.

use super::description::Causality;
use super::near;
use super::participant::Participant;
use super::value::{Kind, Value};
use crate::scenario::equal_names::EqualNames;
use std::collections::BTreeSet;
use std::fmt;

/// A variable of a participant.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Endpoint {
    /// Its participant.
    pub participant: String,
    /// Its name there.
    pub variable: String,
}

impl Endpoint {
    /// The variable of that name.
    pub fn new(participant: impl Into<String>, variable: impl Into<String>) -> Self {
        Self { participant: participant.into(), variable: variable.into() }
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.participant, self.variable)
    }
}

/// `to = factor * from + offset`. Types convert: Booleans are 0 and 1; a number becomes an Integer by
/// rounding, and true from one half upwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Connection {
    /// An output.
    pub from: Endpoint,
    /// An input; each has one source at most.
    pub to: Endpoint,
    /// In units of `to` per unit of `from`.
    pub factor: f64,
    /// In units of `to`.
    pub offset: f64,
}

impl Connection {
    /// The value as it is.
    pub fn new(from: Endpoint, to: Endpoint) -> Self {
        Self { from, to, factor: 1.0, offset: 0.0 }
    }
}

/// Connects each input to the output of the same name of another participant, if there is one.
pub fn connect_equal_names(participants: &[Box<dyn Participant>]) -> Result<Vec<Connection>, CouplingError> {
    connect(participants, &[])
}

/// `table`, and equal names for all inputs that the table leaves open. The table is checked later, by
/// [`super::run`], together with the rest of the plan.
pub fn connect(
    participants: &[Box<dyn Participant>],
    table: &[Connection],
) -> Result<Vec<Connection>, CouplingError> {
    let taken: BTreeSet<&Endpoint> = table.iter().map(|connection| &connection.to).collect();
    let of = |causality: Causality| {
        participants.iter().flat_map(move |participant| {
            let all = participant.variables().iter().filter(move |variable| variable.causality == causality);
            all.map(move |variable| (participant.name(), variable))
        })
    };
    let outputs = of(Causality::Output).filter(|(_, variable)| variable.kind != Kind::String);
    let names = EqualNames::of(outputs.map(|(participant, variable)| (participant, &*variable.name, ())));
    let mut connections = table.to_vec();
    for (participant, variable) in of(Causality::Input) {
        let to = Endpoint::new(participant, &*variable.name);
        if taken.contains(&to) {
            continue;
        }
        match names.source(participant, &variable.name) {
            Ok(None) => {}
            Ok(Some((source, ()))) => {
                connections.push(Connection::new(Endpoint::new(source, &*variable.name), to));
            }
            Err(sources) => return Err(CouplingError::Ambiguous { to, sources }),
        }
    }
    Ok(connections)
}

/// What does not fit between plan and participants. `place` says where in the plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum CouplingError {
    #[error("two participants are called \"{name}\"; expected unique names")]
    TwoParticipants { name: String },

    #[error("{place}: there is no participant \"{found}\"; expected one of {known}")]
    UnknownParticipant { place: String, found: String, known: String },

    #[error("{place}: {participant} has no variable \"{found}\"{hint}")]
    UnknownVariable { place: String, participant: String, found: String, hint: String },

    #[error("{place}: {name} is {found}; expected {expected}")]
    Role { place: String, name: Endpoint, found: String, expected: &'static str },

    #[error("{place}: {name} = {found} does not fit its type {expected}")]
    Value { place: String, name: Endpoint, found: Value, expected: Kind },

    #[error("{place}: factor {factor:?} and offset {offset:?}; expected finite numbers")]
    Scaling { place: String, factor: f64, offset: f64 },

    #[error("{place}: {to} already has the source {first}; expected one source for each input")]
    TwoSources { place: String, to: Endpoint, first: String },

    #[error("{name} is in {declared} by its model description; found {found}; expected {expected}")]
    Unit { name: Endpoint, declared: String, found: String, expected: String },

    #[error("{name} {found}; expected {expected}{hint}")]
    Open { name: Endpoint, found: &'static str, expected: String, hint: String },

    #[error("{to} could be fed by the output of that name of {sources}; connect it explicitly")]
    Ambiguous { to: Endpoint, sources: String },

    #[error("{place}: {found_s:?} s; expected {expected}")]
    Time { place: &'static str, found_s: f64, expected: &'static str },

    #[error(
        "{participant} cannot vary its step (canHandleVariableCommunicationStepSize), but {cause} at \
         {time_s:?} s cuts one; move it onto a communication point or change the step"
    )]
    FixedStep { participant: String, cause: &'static str, time_s: f64 },
}

impl CouplingError {
    pub(super) fn unknown_variable(place: &str, participant: &dyn Participant, found: &str) -> Self {
        let names = participant.variables().iter().map(|variable| variable.name.as_str());
        CouplingError::UnknownVariable {
            place: place.to_owned(),
            participant: participant.name().to_owned(),
            found: found.to_owned(),
            hint: near::hint(found, names),
        }
    }
}

//! Finds what a plan names, and checks whether it may be set. Changes nothing.

use super::coupling::{CouplingError, Endpoint};
use super::description::{Causality, Variability, Variable};
use super::near;
use super::participant::Participant;
use super::value::Value;
use std::collections::BTreeMap;

/// Finds variables by name, or says what is near.
pub(super) struct Lookup<'a> {
    participants: &'a [Box<dyn Participant>],
    variables: Vec<BTreeMap<&'a str, &'a Variable>>,
}

impl<'a> Lookup<'a> {
    pub fn new(participants: &'a [Box<dyn Participant>]) -> Self {
        let by_name = |variable: &'a Variable| (variable.name.as_str(), variable);
        let variables = participants
            .iter()
            .map(|participant| participant.variables().iter().map(by_name).collect())
            .collect();
        Self { participants, variables }
    }

    /// The variable, if it is there.
    pub fn get(&self, endpoint: &Endpoint) -> Option<&'a Variable> {
        let mut all = self.participants.iter().zip(&self.variables);
        let (_, variables) = all.find(|(participant, _)| participant.name() == endpoint.participant)?;
        variables.get(endpoint.variable.as_str()).copied()
    }

    /// Index of the participant, and the variable.
    pub fn find(&self, place: &str, endpoint: &Endpoint) -> Result<(usize, &'a Variable), CouplingError> {
        let mut all = self.participants.iter().zip(&self.variables).enumerate();
        let Some((index, (participant, variables))) =
            all.find(|(_, (p, _))| p.name() == endpoint.participant)
        else {
            let known: Vec<&str> = self.participants.iter().map(|participant| participant.name()).collect();
            let near = near::hint(&endpoint.participant, known.iter().copied());
            return Err(CouplingError::UnknownParticipant {
                place: place.to_owned(),
                found: endpoint.participant.clone(),
                known: known.join(", ") + &near,
            });
        };
        match variables.get(endpoint.variable.as_str()) {
            Some(variable) => Ok((index, variable)),
            None => Err(CouplingError::unknown_variable(place, participant.as_ref(), &endpoint.variable)),
        }
    }

    /// Like [`Lookup::find`], for a value to be set: by an event, in a running simulation, or before it.
    pub fn settable(
        &self,
        place: &str,
        endpoint: &Endpoint,
        value: Value,
        is_running: bool,
    ) -> Result<(usize, u32, Value), CouplingError> {
        let (index, variable) = self.find(place, endpoint)?;
        let tunable = matches!(variable.variability, Variability::Tunable | Variability::Discrete);
        let (allowed, expected) = match variable.causality {
            Causality::Input => (true, ""),
            Causality::Parameter if is_running => (tunable, "an input or a tunable parameter"),
            _ if is_running => (false, "an input or a tunable parameter"),
            Causality::Independent | Causality::CalculatedParameter => (false, "an input or a parameter"),
            _ => (variable.variability != Variability::Constant, "an input or a parameter"),
        };
        if !allowed {
            return Err(CouplingError::Role {
                place: place.to_owned(),
                name: endpoint.clone(),
                found: format!("{} {}", variable.variability, variable.causality),
                expected,
            });
        }
        match value.convert(variable.kind) {
            Some(value) => Ok((index, variable.reference, value)),
            None => Err(CouplingError::Value {
                place: place.to_owned(),
                name: endpoint.clone(),
                found: value,
                expected: variable.kind,
            }),
        }
    }
}

//! Where a run stands at a communication point, as data: what another process needs to go on from there and reach the
//! same bits. Everything that the master remembers between two steps is here, and each participant's state.

use super::{Run, failed};
use crate::harness::error::HarnessError;
use crate::harness::participant::{CallError, Participant};
use crate::harness::schedule::Standing;
use crate::harness::wiring::Written;
use serde::{Deserialize, Serialize};

/// A run at a communication point, after its sample was told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Position {
    standing: Standing,
    next_event: usize,
    values: Vec<f64>,
    is_stale: Vec<bool>,
    written: Vec<Written>,
    steps: u64,
    initial_passes: usize,
    is_settled: bool,
    warnings: Vec<String>,
    states: Vec<Vec<u8>>,
    is_last: bool,
}

impl Position {
    /// Communication point, ns.
    pub fn t_ns(&self) -> i64 {
        self.standing.now_ns
    }

    /// Whether nothing is left to simulate.
    pub fn is_last(&self) -> bool {
        self.is_last
    }
}

impl Run {
    /// Asks every participant for its state.
    pub(super) fn position(
        &self,
        participants: &mut [Box<dyn Participant>],
    ) -> Result<Position, HarnessError> {
        let t_ns = self.schedule.now_ns();
        let mut states = Vec::with_capacity(participants.len());
        for participant in participants.iter_mut() {
            let state = state_of(participant.as_mut());
            states.push(state.map_err(|source| failed(participant.as_ref(), t_ns, source))?);
        }
        Ok(Position {
            standing: self.schedule.standing(),
            next_event: self.next_event,
            values: self.values.clone(),
            is_stale: self.is_stale.clone(),
            written: self.wiring.ports.iter().map(|port| port.written()).collect(),
            steps: self.outcome.steps,
            initial_passes: self.outcome.initial_passes,
            is_settled: self.outcome.is_settled,
            warnings: self.outcome.warnings.clone(),
            states,
            is_last: self.schedule.is_last(),
        })
    }

    /// Puts itself and the participants, freshly initialised, where the position says.
    pub(super) fn go_to(
        &mut self,
        participants: &mut [Box<dyn Participant>],
        position: &Position,
    ) -> Result<(), HarnessError> {
        let misfit = |what: &'static str, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(HarnessError::Position { what, found, expected }) }
        };
        misfit("participants", position.states.len(), participants.len())?;
        misfit("values", position.values.len(), self.values.len())?;
        misfit("flags", position.is_stale.len(), self.is_stale.len())?;
        misfit("sets of inputs", position.written.len(), self.wiring.ports.len())?;
        let t_ns = position.t_ns();
        for (participant, bytes) in participants.iter_mut().zip(&position.states) {
            let restored = restore(participant.as_mut(), bytes);
            restored.map_err(|source| failed(participant.as_ref(), t_ns, source))?;
        }
        for (port, written) in self.wiring.ports.iter_mut().zip(&position.written) {
            let (found, expected) = port.restore(written);
            misfit("inputs", found, expected)?;
        }
        self.values.clone_from(&position.values);
        self.is_stale.clone_from(&position.is_stale);
        self.schedule.stand_at(position.standing);
        self.next_event = position.next_event;
        self.outcome.steps = position.steps;
        self.outcome.events = position.next_event;
        self.outcome.initial_passes = position.initial_passes;
        self.outcome.is_settled = position.is_settled;
        self.outcome.warnings.clone_from(&position.warnings);
        self.outcome.span_ns.0 = t_ns;
        Ok(())
    }
}

fn state_of(participant: &mut dyn Participant) -> Result<Vec<u8>, CallError> {
    let state = participant.save_state()?;
    let bytes = participant.serialise_state(state);
    participant.forget_state(state);
    bytes
}

fn restore(participant: &mut dyn Participant, bytes: &[u8]) -> Result<(), CallError> {
    let state = participant.deserialise_state(bytes)?;
    let restored = participant.restore_state(state);
    participant.forget_state(state);
    restored
}

//! A controller that comes back: from the state of its checkpoint it is stepped alone through the time that it missed,
//! disabled, so that it holds the setpoints that the batteries still have; then it is as enabled as its plan wants it. A
//! part of a fleet has its agents taken out instead, as its neighbours have taken them out, so that what its links carry
//! stays the same at both ends.

use super::others::LATER_NS;
use crate::harness::{CallError, Causality, Kind, Participant, StateHandle, Variable};
use std::cell::Cell;
use std::rc::Rc;

/// The input that stops a controller without a bump.
const ENABLE: &str = "enable";
/// The inputs that take agents out, and those by which a part is known.
const AVAILABLE: &str = "available[";
const REMOTE: &str = "remote_available[";

/// A participant that was away.
pub struct Rejoining {
    inner: Box<dyn Participant>,
    /// Until when it was away, ns; others may move it.
    away_until_ns: Rc<Cell<i64>>,
    /// The inputs that are false while it is away.
    held: Vec<(u32, Kind)>,
    /// What they shall be when it is back, of those that were not false anyway; nothing while none is held back.
    wanted: Option<Vec<Option<f64>>>,
}

impl Rejoining {
    /// Holds back `inner` until then.
    pub fn new(inner: Box<dyn Participant>, away_until_ns: Rc<Cell<i64>>) -> Self {
        let inputs = || inner.variables().iter().filter(|v| v.causality == Causality::Input);
        let is_part = inputs().any(|v| v.name.starts_with(REMOTE));
        let is_held = |v: &&Variable| if is_part { v.name.starts_with(AVAILABLE) } else { v.name == ENABLE };
        let held = inputs().filter(is_held).map(|v| (v.reference, v.kind)).collect();
        Self { inner, away_until_ns, held, wanted: None }
    }

    /// Sets those held back, and no other: who is out for another reason must not be told to stay so.
    fn put(&mut self, values: impl Iterator<Item = Option<f64>>) -> Result<(), CallError> {
        for ((reference, kind), value) in self.held.iter().zip(values) {
            match (kind, value) {
                (_, None) => {}
                (Kind::Real, Some(value)) => self.inner.set_real(&[*reference], &[value])?,
                (_, Some(value)) => self.inner.set_boolean(&[*reference], &[i32::from(value >= 0.5)])?,
            }
        }
        Ok(())
    }

    /// What all that is held back is set to.
    fn hold(&mut self, wanted: &[Option<f64>]) -> Result<(), CallError> {
        self.put(wanted.iter().map(|value| value.map(|_| 0.0)))
    }

    fn found(&mut self) -> Result<Vec<f64>, CallError> {
        let mut values = Vec::with_capacity(self.held.len());
        for (reference, kind) in &self.held {
            values.push(match kind {
                Kind::Real => {
                    let mut value = [0.0];
                    self.inner.get_real(&[*reference], &mut value).map(|()| value[0])?
                }
                _ => {
                    let mut value = [0];
                    self.inner.get_boolean(&[*reference], &mut value).map(|()| f64::from(value[0]))?
                }
            });
        }
        Ok(values)
    }

    fn hold_back(&mut self, t_ns: i64) -> Result<(), CallError> {
        let is_away = t_ns + LATER_NS <= self.away_until_ns.get();
        if !is_away {
            let Some(wanted) = self.wanted.take() else { return Ok(()) };
            return self.put(wanted.into_iter());
        }
        // Who comes back by itself in the meantime is held back from then on.
        let mut wanted = self.wanted.take().unwrap_or_else(|| vec![None; self.held.len()]);
        for (wanted, found) in wanted.iter_mut().zip(self.found()?) {
            *wanted = if found == 0.0 { *wanted } else { Some(found) };
        }
        self.hold(&wanted)?;
        self.wanted = Some(wanted);
        Ok(())
    }

    /// Keeps a value that is to be set for later, if it is one of those held back.
    fn kept_back(&mut self, (reference, kind): (u32, Kind), value: f64) -> bool {
        let place = self.held.iter().position(|held| *held == (reference, kind));
        let wanted = self.wanted.as_mut().zip(place).and_then(|(wanted, place)| wanted.get_mut(place));
        let is_held = wanted.is_some();
        if let Some(wanted) = wanted {
            *wanted = Some(value);
        }
        is_held
    }
}

impl Participant for Rejoining {
    fn name(&self) -> &str {
        self.inner.name()
    }

    fn variables(&self) -> &[Variable] {
        self.inner.variables()
    }

    fn can_vary_step(&self) -> bool {
        self.inner.can_vary_step()
    }

    fn identity(&self) -> String {
        self.inner.identity()
    }

    fn setup(&mut self, start_ns: i64, stop_ns: Option<i64>) -> Result<(), CallError> {
        self.inner.setup(start_ns, stop_ns)
    }

    fn enter_initialization(&mut self) -> Result<(), CallError> {
        self.inner.enter_initialization()
    }

    fn exit_initialization(&mut self) -> Result<(), CallError> {
        self.inner.exit_initialization()
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.inner.get_real(references, values)
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.inner.get_integer(references, values)
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.inner.get_boolean(references, values)
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        if self.wanted.is_none() {
            return self.inner.set_real(references, values);
        }
        for (reference, value) in references.iter().zip(values) {
            if !self.kept_back((*reference, Kind::Real), *value) {
                self.inner.set_real(&[*reference], &[*value])?;
            }
        }
        Ok(())
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.inner.set_integer(references, values)
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        if self.wanted.is_none() {
            return self.inner.set_boolean(references, values);
        }
        for (reference, value) in references.iter().zip(values) {
            if !self.kept_back((*reference, Kind::Boolean), f64::from(*value)) {
                self.inner.set_boolean(&[*reference], &[*value])?;
            }
        }
        Ok(())
    }

    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        self.hold_back(t_ns)?;
        self.inner.do_step(t_ns, h_ns)
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.inner.terminate()
    }

    fn reset(&mut self) -> Result<(), CallError> {
        self.inner.reset()
    }

    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        // A state kept while it is away is that of one who is not held back, or it would never be let go again.
        let Some(wanted) = self.wanted.clone() else { return self.inner.save_state() };
        self.put(wanted.iter().copied())?;
        let state = self.inner.save_state();
        self.hold(&wanted)?;
        state
    }

    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError> {
        self.inner.restore_state(state)
    }

    fn forget_state(&mut self, state: StateHandle) {
        self.inner.forget_state(state);
    }

    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        self.inner.serialise_state(state)
    }

    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        self.inner.deserialise_state(bytes)
    }

    fn take_warnings(&mut self) -> Vec<String> {
        self.inner.take_warnings()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::harness::{Cast, stage_apart};
    use crate::models::fleet::Cut;
    use crate::scenario::Resolved;

    const STEP_NS: i64 = 10_000_000;

    /// The first cluster of Case 1, and the reference of its inputs.
    fn cluster() -> Box<dyn Participant> {
        let resolved = Resolved::load("case1", &serde_json::Map::new()).unwrap();
        let (mut participants, _) =
            stage_apart(&resolved, &Cast::default(), Some(Cut::Clusters)).unwrap().staged;
        participants.swap_remove(0)
    }

    fn reference(own: &dyn Participant, name: &str) -> u32 {
        own.variables().iter().find(|v| v.name == name && v.causality == Causality::Input).unwrap().reference
    }

    /// What its first two agents are told of themselves.
    fn available(own: &mut dyn Participant) -> [i32; 2] {
        let mut found = [-1; 2];
        let references = ["available[1]", "available[2]"].map(|name| reference(own, name));
        own.get_boolean(&references, &mut found).unwrap();
        found
    }

    #[test]
    fn who_is_out_for_a_measurement_comes_back_with_the_measurement() {
        for returns_at_step in [3, 7] {
            let mut own = cluster();
            own.setup(0, None).unwrap();
            own.enter_initialization().unwrap();
            own.exit_initialization().unwrap();
            let measurement = reference(own.as_ref(), "P[2]");
            own.set_real(&[measurement], &[f64::NAN]).unwrap();
            assert_eq!(available(own.as_mut()), [1, 0]);
            // As one that comes back from its checkpoint and was away for five steps.
            let mut own = Rejoining::new(own, Rc::new(Cell::new(5 * STEP_NS)));
            for k in 0..9 {
                if k == returns_at_step {
                    own.set_real(&[measurement], &[0.1]).unwrap();
                }
                own.do_step(k * STEP_NS, STEP_NS).unwrap();
                let is_back = k >= 5;
                let expected = [is_back, is_back && k >= returns_at_step].map(i32::from);
                assert_eq!(available(&mut own), expected, "{returns_at_step}: step {k}");
            }
        }
    }
}

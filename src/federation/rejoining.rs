//! A controller that comes back: from the state of its checkpoint it is stepped alone through the time that it missed,
//! disabled, so that it holds the setpoints that the batteries still have; then it is as enabled as its plan wants it.

use super::others::LATER_NS;
use crate::harness::{CallError, Causality, Kind, Participant, StateHandle, Variable};
use std::cell::Cell;
use std::rc::Rc;

/// The input that stops a controller without a bump.
const ENABLE: &str = "enable";

/// A participant that was away.
pub struct Rejoining {
    inner: Box<dyn Participant>,
    /// Until when it was away, ns; others may move it.
    away_until_ns: Rc<Cell<i64>>,
    enable: Option<(u32, Kind)>,
    /// What `enable` shall be when it is back; none while it is not held back.
    wanted: Option<f64>,
}

impl Rejoining {
    /// Holds back `inner` until then.
    pub fn new(inner: Box<dyn Participant>, away_until_ns: Rc<Cell<i64>>) -> Self {
        let is_enable = |v: &&Variable| v.name == ENABLE && v.causality == Causality::Input;
        let enable = inner.variables().iter().find(is_enable).map(|v| (v.reference, v.kind));
        Self { inner, away_until_ns, enable, wanted: None }
    }

    fn set_enable(&mut self, value: f64) -> Result<(), CallError> {
        match self.enable {
            Some((reference, Kind::Real)) => self.inner.set_real(&[reference], &[value]),
            Some((reference, Kind::Boolean)) => {
                self.inner.set_boolean(&[reference], &[i32::from(value >= 0.5)])
            }
            _ => Ok(()),
        }
    }

    fn hold_back(&mut self, t_ns: i64) -> Result<(), CallError> {
        let is_away = t_ns + LATER_NS <= self.away_until_ns.get();
        match (is_away, self.wanted, self.enable) {
            (true, None, Some((reference, kind))) => {
                let found = match kind {
                    Kind::Real => {
                        let mut value = [0.0];
                        self.inner.get_real(&[reference], &mut value).map(|()| value[0])?
                    }
                    _ => {
                        let mut value = [0];
                        self.inner.get_boolean(&[reference], &mut value).map(|()| f64::from(value[0]))?
                    }
                };
                self.wanted = Some(found);
                self.set_enable(0.0)
            }
            (false, Some(wanted), _) => {
                self.wanted = None;
                self.set_enable(wanted)
            }
            _ => Ok(()),
        }
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
        let held = self.enable.filter(|(_, kind)| self.wanted.is_some() && *kind == Kind::Real);
        for (reference, value) in references.iter().zip(values) {
            match held {
                Some((enable, _)) if enable == *reference => self.wanted = Some(*value),
                Some(_) => self.inner.set_real(&[*reference], &[*value])?,
                None => return self.inner.set_real(references, values),
            }
        }
        Ok(())
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.inner.set_integer(references, values)
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        let held = self.enable.filter(|(_, kind)| self.wanted.is_some() && *kind == Kind::Boolean);
        for (reference, value) in references.iter().zip(values) {
            match held {
                Some((enable, _)) if enable == *reference => self.wanted = Some(f64::from(*value)),
                Some(_) => self.inner.set_boolean(&[*reference], &[*value])?,
                None => return self.inner.set_boolean(references, values),
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
        let Some(wanted) = self.wanted else { return self.inner.save_state() };
        self.set_enable(wanted)?;
        let state = self.inner.save_state();
        self.set_enable(0.0)?;
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

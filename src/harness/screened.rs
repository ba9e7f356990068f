//! A participant whose inputs are looked at on their way in: faults are brought about there, and of a controller
//! a measurement that is not a number takes its agent out instead of ending the run. Everything else passes.
//!
//! An FMU refuses NaN, and must: it cannot know what its master wants. What the master wants is here. Input i of
//! quantity X is `X[i]`; the agent is out while any of its measurements is not finite (`available[i]` = false) and
//! comes back by itself. Where there is no `available[i]`, the last good value is held.

use super::coupling::CouplingError;
use super::description::{Causality, Variable};
use super::fault::{FaultySignal, Memory};
use super::participant::{CallError, Participant, StateHandle};
use super::slave::seconds;
use super::value::Kind;
use crate::scenario::fault::WireFault;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Most warnings that one run is worth.
const WARNINGS: usize = 20;

/// A participant with somebody at its door.
pub(super) struct Screened {
    inner: Box<dyn Participant>,
    /// Sorted by reference.
    signals: Vec<FaultySignal>,
    /// Whether Real inputs must be finite; else the participant itself shall refuse them.
    takes_agents_out: bool,
    /// Who is who; found when it is first asked for.
    agents: Option<Agents>,
    own: Own,
    states: BTreeMap<u64, Own>,
    /// Reals on their way in, so that a set allocates nothing.
    references: Vec<u32>,
    values: Vec<f64>,
    /// The names of the inputs that were not finite, and when.
    spans: Vec<Span>,
}

/// The agents behind the inputs.
#[derive(Default)]
struct Agents {
    /// Agent of a Real input, by reference.
    of: BTreeMap<u32, u32>,
    /// `available[i]`, by agent.
    available: BTreeMap<u32, u32>,
}

impl Agents {
    fn find(variables: &[Variable]) -> Self {
        let inputs = || variables.iter().filter(|v| v.causality == Causality::Input);
        let indexed = |v: &Variable| {
            let (quantity, index) = v.name.strip_suffix(']')?.split_once('[')?;
            Some((quantity.to_owned(), index.parse::<u32>().ok()?))
        };
        let available = |v: &Variable| {
            let (_, agent) = indexed(v).filter(|(quantity, _)| quantity == "available")?;
            Some((agent, v.reference))
        };
        let available: BTreeMap<u32, u32> =
            inputs().filter(|v| v.kind == Kind::Boolean).filter_map(available).collect();
        let agent = |v: &Variable| {
            let (_, agent) = indexed(v).filter(|(_, agent)| available.contains_key(agent))?;
            Some((v.reference, agent))
        };
        let of = inputs().filter(|v| v.kind == Kind::Real).filter_map(agent).collect();
        Self { of, available }
    }
}

struct Span {
    reference: u32,
    from_ns: i64,
    until_ns: Option<i64>,
}

/// What a rollback must bring back.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Own {
    now_ns: i64,
    signals: Vec<Memory>,
    /// Watched inputs that are not finite now.
    lost: BTreeSet<u32>,
    /// What the plan wants of `available[i]` where it is not what the participant was told.
    held_back: BTreeMap<u32, i32>,
}

impl Screened {
    /// With faults of its inputs; `takes_agents_out` for a controller.
    pub fn new(
        inner: Box<dyn Participant>,
        faults: &[WireFault],
        takes_agents_out: bool,
    ) -> Result<Self, CouplingError> {
        let variables = inner.variables();
        let mut by_reference: BTreeMap<u32, Vec<WireFault>> = BTreeMap::new();
        for fault in faults {
            let Some(name) = fault.signal.strip_prefix(inner.name()).and_then(|n| n.strip_prefix('.')) else {
                continue;
            };
            let Some(variable) = variables.iter().find(|v| v.name == name) else {
                return Err(CouplingError::unknown_variable(&fault.place, inner.as_ref(), name));
            };
            if variable.causality != Causality::Input || variable.kind != Kind::Real {
                return Err(CouplingError::Role {
                    place: fault.place.clone(),
                    name: super::Endpoint::new(inner.name(), name),
                    found: format!("{} {}", variable.causality, variable.kind),
                    expected: "an input of type Real",
                });
            }
            by_reference.entry(variable.reference).or_default().push(fault.clone());
        }
        let signals: Vec<FaultySignal> = by_reference
            .into_iter()
            .map(|(reference, faults)| FaultySignal::new(reference, faults))
            .collect();
        let room = variables.len();
        Ok(Self {
            inner,
            signals,
            takes_agents_out,
            agents: None,
            own: Own::default(),
            states: BTreeMap::new(),
            references: Vec::with_capacity(room),
            values: Vec::with_capacity(room),
            spans: Vec::new(),
        })
    }

    /// The same with the noise of another participant's inputs, whose reference `there` gives by the name here.
    pub fn drawn_as(mut self, there: impl Fn(&str) -> Option<u32>) -> Self {
        for signal in &mut self.signals {
            let named = |v: &&Variable| v.reference == signal.reference && v.kind == Kind::Real;
            let name = self.inner.variables().iter().find(named).map(|v| v.name.as_str());
            signal.key = name.and_then(&there).unwrap_or(signal.key);
        }
        self
    }

    /// Passes on what is in `references` and `values`, as far as the participant can take it.
    fn pass(&mut self) -> Result<(), CallError> {
        let is_sound = !self.takes_agents_out || self.values.iter().all(|value| value.is_finite());
        if is_sound && self.own.lost.is_empty() {
            return self.inner.set_real(&self.references, &self.values);
        }
        let mut kept = 0;
        for k in 0..self.values.len() {
            let (Some(&reference), Some(&value)) = (self.references.get(k), self.values.get(k)) else {
                break;
            };
            self.mark(reference, !value.is_finite());
            if value.is_finite() {
                if let (Some(r), Some(v)) = (self.references.get_mut(kept), self.values.get_mut(kept)) {
                    (*r, *v) = (reference, value);
                }
                kept += 1;
            }
        }
        self.references.truncate(kept);
        self.values.truncate(kept);
        self.tell_availability()?;
        if kept == 0 { Ok(()) } else { self.inner.set_real(&self.references, &self.values) }
    }

    /// Notes that an input is lost, or back.
    fn mark(&mut self, reference: u32, is_lost: bool) {
        if is_lost && self.own.lost.insert(reference) {
            self.spans.push(Span { reference, from_ns: self.own.now_ns, until_ns: None });
        } else if !is_lost && self.own.lost.remove(&reference) {
            let open = |span: &&mut Span| span.reference == reference && span.until_ns.is_none();
            if let Some(span) = self.spans.iter_mut().rev().find(open) {
                span.until_ns = Some(self.own.now_ns);
            }
        }
    }

    /// Takes out the agents that have lost a measurement, and gives back those that have all.
    fn tell_availability(&mut self) -> Result<(), CallError> {
        let variables = self.inner.variables();
        let agents = self.agents.get_or_insert_with(|| Agents::find(variables));
        let out: BTreeSet<u32> =
            self.own.lost.iter().filter_map(|lost| agents.of.get(lost).copied()).collect();
        for agent in out.iter().filter(|agent| !self.own.held_back.contains_key(agent)).collect::<Vec<_>>() {
            let Some(reference) = agents.available.get(agent) else { continue };
            let mut wanted = [0];
            self.inner.get_boolean(&[*reference], &mut wanted)?;
            self.inner.set_boolean(&[*reference], &[0])?;
            let [wanted] = wanted;
            self.own.held_back.insert(*agent, wanted);
        }
        let back: Vec<u32> =
            self.own.held_back.keys().filter(|agent| !out.contains(agent)).copied().collect();
        for agent in back {
            let wanted = self.own.held_back.remove(&agent);
            if let (Some(reference), Some(wanted)) = (agents.available.get(&agent), wanted) {
                self.inner.set_boolean(&[*reference], &[wanted])?;
            }
        }
        Ok(())
    }

    /// Brings the faults of the present about where nothing new was set since the last step.
    fn refresh(&mut self) -> Result<(), CallError> {
        if self.signals.is_empty() {
            return Ok(());
        }
        self.references.clear();
        self.values.clear();
        for signal in &mut self.signals {
            if let Some(truth) = signal.memory.truth.filter(|_| signal.memory.at_ns != Some(self.own.now_ns))
            {
                self.references.push(signal.reference);
                self.values.push(signal.arrives(truth, self.own.now_ns));
            }
        }
        if self.references.is_empty() { Ok(()) } else { self.pass() }
    }

    fn remember(&mut self) -> Own {
        self.own.signals = self.signals.iter().map(|signal| signal.memory).collect();
        self.own.clone()
    }

    fn recall(&mut self, own: Own) {
        for (signal, memory) in self.signals.iter_mut().zip(&own.signals) {
            signal.memory = *memory;
        }
        self.own = own;
    }
}

impl Participant for Screened {
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
        self.own.now_ns = start_ns;
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
        let is_sound = !self.takes_agents_out || values.iter().all(|value| value.is_finite());
        if is_sound && self.signals.is_empty() && self.own.lost.is_empty() {
            return self.inner.set_real(references, values);
        }
        self.references.clear();
        self.values.clear();
        for (&reference, &value) in references.iter().zip(values) {
            let faulty = self.signals.binary_search_by_key(&reference, |signal| signal.reference).ok();
            let signal = faulty.and_then(|place| self.signals.get_mut(place));
            self.references.push(reference);
            self.values.push(signal.map_or(value, |signal| signal.arrives(value, self.own.now_ns)));
        }
        self.pass()
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.inner.set_integer(references, values)
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        if self.own.held_back.is_empty() {
            return self.inner.set_boolean(references, values);
        }
        for (&reference, &value) in references.iter().zip(values) {
            let agents = self.agents.iter().flat_map(|agents| &agents.available);
            let agent = agents.into_iter().find(|(_, own)| **own == reference).map(|(agent, _)| *agent);
            match agent.and_then(|agent| self.own.held_back.get_mut(&agent)) {
                Some(wanted) => *wanted = value,
                None => self.inner.set_boolean(&[reference], &[value])?,
            }
        }
        Ok(())
    }

    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        self.own.now_ns = t_ns;
        self.refresh()?;
        self.inner.do_step(t_ns, h_ns)?;
        self.own.now_ns = t_ns.saturating_add(h_ns);
        Ok(())
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.inner.terminate()
    }

    fn reset(&mut self) -> Result<(), CallError> {
        self.inner.reset()?;
        self.signals.iter_mut().for_each(|signal| signal.memory = Memory::default());
        self.own = Own::default();
        self.spans.clear();
        Ok(())
    }

    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        let handle = self.inner.save_state()?;
        let own = self.remember();
        self.states.insert(handle.0, own);
        Ok(handle)
    }

    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError> {
        self.inner.restore_state(state)?;
        if let Some(own) = self.states.get(&state.0).cloned() {
            self.recall(own);
        }
        Ok(())
    }

    fn forget_state(&mut self, state: StateHandle) {
        self.states.remove(&state.0);
        self.inner.forget_state(state);
    }

    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        let function = "fmi2SerializeFMUstate";
        let inner = self.inner.serialise_state(state)?;
        let own = self.states.get(&state.0).cloned().unwrap_or_default();
        postcard::to_stdvec(&(own, inner)).map_err(|e| CallError::new(function, e.to_string()))
    }

    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        let function = "fmi2DeSerializeFMUstate";
        let read: Result<(Own, Vec<u8>), _> = postcard::from_bytes(bytes);
        let (own, inner) =
            read.map_err(|e| CallError::new(function, format!("no state of this run: {e}")))?;
        if own.signals.len() != self.signals.len() {
            let (found, expected) = (own.signals.len(), self.signals.len());
            let reason =
                format!("state with {found} faulty signals, expected {expected}: that of the same run");
            return Err(CallError::new(function, reason));
        }
        let handle = self.inner.deserialise_state(&inner)?;
        self.states.insert(handle.0, own);
        Ok(handle)
    }

    fn take_warnings(&mut self) -> Vec<String> {
        let mut warnings = self.inner.take_warnings();
        let count = self.spans.len();
        for span in self.spans.drain(..).take(WARNINGS) {
            let named = |v: &&Variable| v.reference == span.reference && v.kind == Kind::Real;
            let Some(Variable { name, .. }) = self.inner.variables().iter().find(named) else { continue };
            let agent = self.agents.as_ref().and_then(|agents| agents.of.get(&span.reference));
            let from_s = seconds(span.from_ns);
            let until = span.until_ns.map_or("the end".into(), |t| format!("{:?} s", seconds(t)));
            let meanwhile = match agent {
                Some(i) => {
                    format!("agent {i} was out meanwhile (available[{i}] = false) and held its setpoints")
                }
                None => "its last good value was held meanwhile".into(),
            };
            let participant = self.inner.name();
            warnings.push(format!(
                "{participant}.{name} was not a finite number from {from_s:?} s to {until}; {meanwhile}"
            ));
        }
        if count > WARNINGS {
            warnings.push(format!("{} more times an input was not a finite number", count - WARNINGS));
        }
        warnings
    }
}

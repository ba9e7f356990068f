//! All other federates as one participant of an ordinary run: its outputs are what was heard of them, its inputs are
//! what they are told. So a federate is our master with two participants, and a federation gives the bits of one process.
//!
//! At a communication point t the plant speaks first, because its measurements follow the setpoints of t at once: it is
//! granted t, hears what the controllers told when they had reached t, and tells the measurements of t. A controller tells
//! what it has reached at t, is granted t + 1 ns, and hears the measurements of t. Everyone tells everything at every
//! communication point; who is silent at one is gone.

use super::error::FederationError;
use super::session::Session;
use super::topics::Share;
use crate::harness::{CallError, Participant, StateHandle, Variable};
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;

/// Name of this participant in the plan of a federate.
pub const OTHERS: &str = "federation";

/// How much later than the plant a controller is granted a communication point, ns.
pub const LATER_NS: i64 = 1;

/// When a federate acts at a communication point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// First: its outputs follow its inputs at once.
    Plant,
    /// After the plant: its outputs are sampled.
    Controller,
}

/// How it joins.
#[derive(Clone, Debug)]
pub enum Joining {
    /// With all others, before time starts.
    AtStart,
    /// While the others are under way; the time at which it was let in, ns, goes into the cell.
    Late(Rc<Cell<i64>>),
}

/// What is kept in a state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Own {
    now_ns: i64,
    heard: Vec<f64>,
    told: Vec<f64>,
    /// When each sender fell silent, ns.
    silent: Vec<Option<i64>>,
}

/// The others.
pub struct Others {
    session: Session,
    turn: Turn,
    joining: Joining,
    variables: Vec<Variable>,
    own: Own,
    /// Outputs that say whether a sender's agents are there: index and sender.
    presence: Vec<(usize, usize)>,
    /// Sender whose silence ends the run.
    needed: Option<usize>,
    is_initialising: bool,
    passes: usize,
    /// Told in the last exchange before the start.
    told_last: Option<Vec<f64>>,
    has_started: bool,
    is_current: bool,
    /// Whether silence means anything yet.
    has_heard: bool,
    is_heard: Vec<bool>,
    /// Whether a call has failed: there is nobody to tell anything.
    is_broken: bool,
    states: BTreeMap<u64, Own>,
    next_state: u64,
    warnings: Vec<String>,
}

impl Others {
    /// The participant for this share. `starts` are the values heard before anything was, `presence` the outputs that
    /// become false while their sender is silent, `plant` the federate without which nothing goes on.
    pub fn new(
        session: Session,
        share: &Share,
        (turn, joining): (Turn, Joining),
        starts: Vec<f64>,
        presence: &[usize],
        plant: &str,
    ) -> Self {
        let senders = session.senders();
        let sender_of: Vec<usize> = share
            .heard
            .iter()
            .flat_map(|topic| {
                let sender = senders.iter().position(|sender| *sender == topic.from).unwrap_or(usize::MAX);
                std::iter::repeat_n(sender, topic.variables.len())
            })
            .collect();
        let presence =
            presence.iter().filter_map(|output| Some((*output, *sender_of.get(*output)?))).collect();
        let needed = senders.iter().position(|sender| sender == plant).filter(|_| turn == Turn::Controller);
        let count = senders.len();
        Self {
            turn,
            joining,
            variables: share.variables(),
            own: Own {
                now_ns: 0,
                heard: starts,
                told: vec![0.0; share.told_variables.len()],
                silent: vec![None; count],
            },
            presence,
            needed,
            is_initialising: false,
            passes: 0,
            told_last: None,
            has_started: false,
            is_current: false,
            has_heard: false,
            is_heard: vec![false; count],
            is_broken: false,
            states: BTreeMap::new(),
            next_state: 0,
            warnings: Vec::new(),
            session,
        }
    }

    fn has_joined_late(&self) -> Option<i64> {
        match &self.joining {
            Joining::AtStart => None,
            Joining::Late(at_ns) => Some(at_ns.get()),
        }
    }

    /// The exchange at this communication point, if it has not been yet.
    fn meet(&mut self) -> Result<(), FederationError> {
        if std::mem::replace(&mut self.is_current, true) {
            return Ok(());
        }
        let at_ns = match self.turn {
            Turn::Plant => self.own.now_ns,
            Turn::Controller => self.own.now_ns + LATER_NS,
        };
        // One who came late goes through what it missed alone.
        if self.has_joined_late().is_some_and(|joined_ns| at_ns <= joined_ns) {
            self.presence.iter().for_each(|(output, _)| zero(&mut self.own.heard, *output));
            return Ok(());
        }
        if self.turn == Turn::Controller {
            self.session.publish(&self.own.told)?;
        }
        // Time has started at 0 already.
        if at_ns > 0 {
            self.session.request(at_ns)?;
        }
        self.session.read(&mut self.own.heard, &mut self.is_heard)?;
        self.look_for_silence(at_ns)
    }

    fn look_for_silence(&mut self, at_ns: i64) -> Result<(), FederationError> {
        let late = self.has_joined_late();
        if !self.has_heard && late.is_some() {
            // What was told before this one was known to the others did not reach it: it is not there yet.
            self.has_heard = self.needed.is_none_or(|plant| self.is_heard.get(plant) == Some(&true));
            if let (false, Joining::Late(joined_ns)) = (self.has_heard, &self.joining) {
                joined_ns.set(at_ns);
                return Ok(());
            }
        }
        // Nobody has told the plant anything at the very start.
        if at_ns == 0 {
            return Ok(());
        }
        let t_s = self.own.now_ns as f64 / 1e9;
        for (k, silent) in self.own.silent.iter_mut().enumerate() {
            let name = self.session.senders().get(k).map_or("", String::as_str);
            match (self.is_heard.get(k) == Some(&true), *silent) {
                (false, None) if self.needed == Some(k) => {
                    return Err(FederationError::Gone { federate: name.to_owned(), time_s: t_s });
                }
                (false, None) => {
                    *silent = Some(self.own.now_ns);
                    self.session.note(name, true);
                    self.warnings
                        .push(format!("{name} fell silent at t = {t_s:?} s: what it told last is held"));
                }
                (true, Some(since_ns)) => {
                    *silent = None;
                    self.session.note(name, false);
                    let since_s = since_ns as f64 / 1e9;
                    self.warnings.push(format!(
                        "{name} is back at t = {t_s:?} s; it was silent from {since_s:?} s on"
                    ));
                }
                _ => {}
            }
        }
        for (output, sender) in &self.presence {
            if let (Some(Some(_)), Some(value)) =
                (self.own.silent.get(*sender), self.own.heard.get_mut(*output))
            {
                *value = 0.0;
            }
        }
        Ok(())
    }

    /// One exchange before time starts, or several, until something new was heard or everybody has come to rest.
    fn exchange_before_start(&mut self) -> Result<(), FederationError> {
        self.passes += 1;
        // In the first pass nothing was told yet, and what is heard are the inputs' own start values.
        if self.passes == 1 || self.has_started || self.has_joined_late().is_some() {
            return Ok(());
        }
        let before = self.own.heard.clone();
        while !self.has_started && self.own.heard == before {
            if self.told_last.as_ref() != Some(&self.own.told) {
                self.session.publish(&self.own.told)?;
                self.told_last = Some(self.own.told.clone());
            }
            self.has_started = !self.session.iterate()?;
            self.session.read(&mut self.own.heard, &mut self.is_heard)?;
        }
        Ok(())
    }
}

fn only_reals(function: &'static str) -> CallError {
    CallError::new(function, "a federation has Reals only")
}

fn zero(values: &mut [f64], place: usize) {
    if let Some(value) = values.get_mut(place) {
        *value = 0.0;
    }
}

fn refused(error: FederationError) -> CallError {
    let (function, reason) = match error {
        FederationError::Call { call, reason, hint, .. } => (call, format!("{reason}{hint}")),
        other => ("helicsFederateRequestTime", other.to_string()),
    };
    CallError::new(function, reason)
}

impl Participant for Others {
    fn name(&self) -> &str {
        OTHERS
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn identity(&self) -> String {
        self.session.senders().join(", ")
    }

    fn setup(&mut self, start_ns: i64, _: Option<i64>) -> Result<(), CallError> {
        self.own.now_ns = start_ns;
        Ok(())
    }

    fn enter_initialization(&mut self) -> Result<(), CallError> {
        self.is_initialising = true;
        match &self.joining {
            Joining::AtStart => self.session.enter_initializing().map_err(refused),
            Joining::Late(at_ns) => {
                at_ns.set(self.session.enter_executing().map_err(refused)?);
                self.has_started = true;
                Ok(())
            }
        }
    }

    fn exit_initialization(&mut self) -> Result<(), CallError> {
        self.is_initialising = false;
        if !self.has_started {
            self.session.enter_executing().map_err(refused)?;
            self.session.read(&mut self.own.heard, &mut self.is_heard).map_err(refused)?;
            self.has_started = true;
        }
        Ok(())
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        let met = if self.is_initialising { self.exchange_before_start() } else { self.meet() };
        self.is_broken |= met.is_err();
        met.map_err(refused)?;
        for (value, reference) in values.iter_mut().zip(references) {
            let heard = self.own.heard.get(*reference as usize);
            *value = *heard.ok_or_else(|| CallError::new("fmi2GetReal", "no such output"))?;
        }
        Ok(())
    }

    fn get_integer(&mut self, _: &[u32], _: &mut [i32]) -> Result<(), CallError> {
        Err(only_reals("fmi2GetInteger"))
    }

    fn get_boolean(&mut self, _: &[u32], _: &mut [i32]) -> Result<(), CallError> {
        Err(only_reals("fmi2GetBoolean"))
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        for (reference, value) in references.iter().zip(values) {
            let place = (*reference as usize).checked_sub(self.own.heard.len());
            let told = place.and_then(|place| self.own.told.get_mut(place));
            *told.ok_or_else(|| CallError::new("fmi2SetReal", "no such input"))? = *value;
        }
        Ok(())
    }

    fn set_integer(&mut self, _: &[u32], _: &[i32]) -> Result<(), CallError> {
        Err(only_reals("fmi2SetInteger"))
    }

    fn set_boolean(&mut self, _: &[u32], _: &[i32]) -> Result<(), CallError> {
        Err(only_reals("fmi2SetBoolean"))
    }

    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        let told = self.meet().and_then(|()| match self.turn {
            Turn::Plant => self.session.publish(&self.own.told),
            Turn::Controller => Ok(()),
        });
        self.is_broken |= told.is_err();
        told.map_err(refused)?;
        self.own.now_ns = t_ns.saturating_add(h_ns);
        self.is_current = false;
        Ok(())
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        // The controllers still want the measurements of the last communication point.
        if self.turn == Turn::Plant && self.has_started && !self.is_broken {
            self.session.publish(&self.own.told).map_err(refused)?;
        }
        self.session.leave().map_err(refused)
    }

    fn reset(&mut self) -> Result<(), CallError> {
        Err(CallError::new("fmi2Reset", "a federation cannot be reset"))
    }

    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        self.next_state += 1;
        self.states.insert(self.next_state, self.own.clone());
        Ok(StateHandle(self.next_state))
    }

    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError> {
        let kept = self.states.get(&state.0);
        self.own = kept.cloned().ok_or_else(|| CallError::new("fmi2SetFMUstate", "no such state"))?;
        // The communication point was met before the state was kept.
        self.is_current = true;
        Ok(())
    }

    fn forget_state(&mut self, state: StateHandle) {
        self.states.remove(&state.0);
    }

    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        let function = "fmi2SerializeFMUstate";
        let kept = self.states.get(&state.0).ok_or_else(|| CallError::new(function, "no such state"))?;
        postcard::to_stdvec(kept).map_err(|error| CallError::new(function, error.to_string()))
    }

    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        let function = "fmi2DeSerializeFMUstate";
        let own: Own = postcard::from_bytes(bytes)
            .map_err(|error| CallError::new(function, format!("no state of this run: {error}")))?;
        let lengths = |own: &Own| (own.heard.len(), own.told.len(), own.silent.len());
        if lengths(&own) != lengths(&self.own) {
            return Err(CallError::new(function, "a state of another federation"));
        }
        self.next_state += 1;
        self.states.insert(self.next_state, own);
        Ok(StateHandle(self.next_state))
    }

    fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }
}

//! One sequence of calls: a few instances and states of one FMU, and what is known about each. Every call goes
//! through `check`, which compares what came with what must come, and the state before with the state after a refusal.

mod derivatives;
mod life;
mod pointers;
mod states;
mod steps;
mod values;

use crate::choices::Choices;
use crate::functions::Functions;
use crate::log::Log;
use crate::subject::{Export, Subject};
use crate::tally::Tally;
use crate::verdict::Verdict;
use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Function, State};
use states::{Blob, Slot};
use std::ptr::null_mut;
use std::rc::Rc;

const INSTANCES: usize = 3;
const SLOTS: usize = 4;
/// Bytes of a state that takes its time.
const LARGE: usize = 16 * 1024;

/// How often which function is called, and `Start`, which enters and leaves initialization mode.
const WEIGHTS: &[(Option<Function>, u32)] = &[
    (None, 24),
    (Some(Function::GetTypesPlatform), 1),
    (Some(Function::GetVersion), 1),
    (Some(Function::SetDebugLogging), 1),
    (Some(Function::Instantiate), 1),
    (Some(Function::FreeInstance), 1),
    (Some(Function::SetupExperiment), 3),
    (Some(Function::EnterInitializationMode), 2),
    (Some(Function::ExitInitializationMode), 2),
    (Some(Function::Terminate), 1),
    (Some(Function::Reset), 1),
    (Some(Function::GetReal), 14),
    (Some(Function::GetInteger), 4),
    (Some(Function::GetBoolean), 4),
    (Some(Function::GetString), 1),
    (Some(Function::SetReal), 14),
    (Some(Function::SetInteger), 4),
    (Some(Function::SetBoolean), 5),
    (Some(Function::SetString), 1),
    (Some(Function::GetFmuState), 4),
    (Some(Function::SetFmuState), 4),
    (Some(Function::FreeFmuState), 3),
    (Some(Function::SerializedFmuStateSize), 3),
    (Some(Function::SerializeFmuState), 4),
    (Some(Function::DeSerializeFmuState), 5),
    (Some(Function::GetDirectionalDerivative), 5),
    (Some(Function::SetRealInputDerivatives), 4),
    (Some(Function::GetRealOutputDerivatives), 4),
    (Some(Function::DoStep), 24),
    (Some(Function::CancelStep), 1),
    (Some(Function::GetStatus), 1),
    (Some(Function::GetRealStatus), 1),
    (Some(Function::GetIntegerStatus), 1),
    (Some(Function::GetBooleanStatus), 1),
    (Some(Function::GetStringStatus), 1),
];

/// Functions that change nothing when they are accepted.
const PURE: &[Function] = &[
    Function::SetDebugLogging,
    Function::GetString,
    Function::SetString,
    Function::GetFmuState,
    Function::FreeFmuState,
    Function::SerializedFmuStateSize,
    Function::SerializeFmuState,
    Function::DeSerializeFmuState,
    Function::GetRealStatus,
    Function::GetBooleanStatus,
];

/// A living instance.
struct Live {
    c: fmi2Component,
    /// Shared with the instance, which holds its address: a `Box` would claim it for itself when moved.
    log: Rc<Log>,
    /// Whether it was given a logger.
    heard: bool,
    export: usize,
    /// Where in its life it is; unknown after a state with forged contents was taken over.
    state: Option<State>,
    /// Whether the next step moves inputs.
    ramped: bool,
    /// Its serialised state, where nothing has changed since.
    known: Option<Vec<u8>>,
    /// Length of it when last seen.
    size: usize,
}

/// A sequence under way.
pub struct World<'a> {
    subject: &'a Subject,
    /// A state of another FMU, 0 if there is none.
    foreign: fmi2FMUstate,
    choices: Choices<'a>,
    /// The exports that this sequence instantiates.
    exports: [usize; 2],
    live: [Option<Live>; INSTANCES],
    slots: [Slot; SLOTS],
    blobs: Vec<Blob>,
    /// Steps of more than a second that are still to be had where each may take a minute.
    long_steps: u32,
    tally: Tally,
    trace: bool,
}

impl<'a> World<'a> {
    /// Plays the sequence that these bytes are; returns what was called. A finding is a panic. `foreign` is NULL or a
    /// living state of another FMU.
    pub fn play(subject: &'a Subject, foreign: fmi2FMUstate, bytes: &'a [u8], trace: bool) -> Tally {
        let mut choices = Choices::new(bytes);
        choices.tame = !choices.once_in(5);
        let small = subject.exports.len() - subject.traits.large;
        let costs: Vec<u32> = (0..subject.exports.len()).map(|k| if k < small { 16 } else { 1 }).collect();
        let exports = [choices.weighted(&costs), choices.weighted(&costs)];
        let mut world = World {
            subject,
            foreign,
            choices,
            exports,
            live: Default::default(),
            slots: Default::default(),
            blobs: Vec::new(),
            long_steps: 2,
            tally: Tally::default(),
            trace,
        };
        world.instantiate_well(0, exports[0]);
        let weights: Vec<u32> = WEIGHTS.iter().map(|(_, weight)| *weight).collect();
        while !world.choices.is_over() {
            if world.live.iter().all(|live| live.is_none()) && !world.choices.once_in(8) {
                let which = world.choices.below(2);
                world.instantiate_well(0, exports[which]);
            }
            let which = world.choices.weighted(&weights);
            let k = world.instance();
            world.call(WEIGHTS[which].0, k);
        }
        world.finish()
    }

    /// Mostly one that lives.
    fn instance(&mut self) -> usize {
        let k = self.choices.weighted(&[8, 3, 1]);
        if self.live[k].is_some() || self.choices.once_in(16) {
            return k;
        }
        self.live.iter().position(|live| live.is_some()).unwrap_or(k)
    }

    /// To where the steps are, by a way that is open.
    fn start(&mut self, k: usize) {
        match self.live[k].as_ref().and_then(|live| live.state) {
            Some(State::Instantiated) => {
                self.enter(k);
                self.exit(k);
            }
            Some(State::Initialization) => self.exit(k),
            Some(State::Step) => self.do_step(k),
            Some(State::Terminated) | None => self.reset(k),
            Some(State::Fatal) => self.instantiate_well(k, self.exports[0]),
        }
    }

    fn call(&mut self, function: Option<Function>, k: usize) {
        let Some(function) = function else { return self.start(k) };
        match function {
            Function::GetTypesPlatform | Function::GetVersion => self.inquire(),
            Function::SetDebugLogging => self.set_debug_logging(k),
            Function::Instantiate => self.instantiate(k),
            Function::FreeInstance => self.free_instance(k),
            Function::SetupExperiment => self.setup_experiment(k),
            Function::EnterInitializationMode => self.enter(k),
            Function::ExitInitializationMode => self.exit(k),
            Function::Terminate => self.terminate(k),
            Function::Reset => self.reset(k),
            Function::GetReal => self.get_real(k),
            Function::GetInteger => self.get_integer(k),
            Function::GetBoolean => self.get_boolean(k),
            Function::GetString => self.strings(k, function),
            Function::SetReal => self.set_real(k),
            Function::SetInteger => self.set_integer(k),
            Function::SetBoolean => self.set_boolean(k),
            Function::SetString => self.strings(k, function),
            Function::GetFmuState => self.get_state(k),
            Function::SetFmuState => self.set_state(k),
            Function::FreeFmuState => self.free_state(k),
            Function::SerializedFmuStateSize => self.state_size(k),
            Function::SerializeFmuState => self.serialize(k),
            Function::DeSerializeFmuState => self.deserialize(k),
            Function::GetDirectionalDerivative => self.directional_derivative(k),
            Function::SetRealInputDerivatives => self.input_derivatives(k),
            Function::GetRealOutputDerivatives => self.output_derivatives(k),
            Function::DoStep => self.do_step(k),
            Function::CancelStep => self.cancel(k),
            Function::GetStatus
            | Function::GetRealStatus
            | Function::GetIntegerStatus
            | Function::GetBooleanStatus
            | Function::GetStringStatus => self.status(k, function),
        }
    }

    /// The export of instance `k`, or of the one that would be instantiated there.
    fn export(&self, k: usize) -> &'a Export {
        let number = self.live[k].as_ref().map_or(self.exports[0], |live| live.export);
        &self.subject.exports[number]
    }

    /// What must come of a legal call that the model has a say in.
    fn up_to_the_model(&self, k: usize) -> Verdict {
        let known = self.live[k].as_ref().is_some_and(|live| live.state.is_some());
        let certain = self.choices.tame && known && !self.subject.traits.may_refuse;
        if certain { Verdict::Accept } else { Verdict::Either }
    }

    /// Makes a call on instance `k`, NULL if there is none; returns whether it was accepted.
    fn check(
        &mut self,
        k: usize,
        function: Function,
        verdict: Verdict,
        call: impl FnOnce(&Functions, fmi2Component) -> fmi2Status,
    ) -> bool {
        let Some(live) = &self.live[k] else {
            let status = call(&self.subject.functions, null_mut());
            self.tally.count(function, status);
            assert_eq!(status, fmi2Status_fmi2Error, "{function} with a NULL component");
            return false;
        };
        let verdict = match live.state {
            None => Verdict::Any,
            Some(state) if function.is_allowed(state) => verdict,
            Some(State::Fatal) => Verdict::Fatal,
            Some(state) => Verdict::refuse([&format!("not allowed in state \"{state}\""), "expected one of"]),
        };
        let fatal = live.state == Some(State::Fatal);
        // Delays make a state of hundreds of kilobytes: that is not written out before every call.
        let sampled = live.size < LARGE || self.tally.calls().is_multiple_of(32);
        if verdict.may_refuse() && !fatal && live.known.is_none() && sampled {
            let bytes = self.bytes(k);
            if let Some(live) = &mut self.live[k] {
                live.size = bytes.len();
                live.known = Some(bytes);
            }
        }
        let Some(live) = &mut self.live[k] else { return false };
        live.log.take();
        if self.trace {
            eprintln!("{k} {function} {verdict:?}");
        }
        let status = call(&self.subject.functions, live.c);
        self.tally.count(function, status);
        let lines = live.heard.then(|| live.log.take());
        if self.trace {
            eprintln!("    -> {status} {lines:?}");
        }
        let fault = verdict.fault(function, status, lines.as_deref(), self.subject.traits.may_panic);
        if let Some(fault) = fault {
            panic!("{}: {fault}", self.subject.name);
        }
        if status == fmi2Status_fmi2Fatal {
            (live.state, live.known) = (Some(State::Fatal), None);
            return false;
        }
        if status == fmi2Status_fmi2OK {
            if !PURE.contains(&function) {
                live.known = None;
            }
            return true;
        }
        if let Some(before) = live.known.take() {
            let after = self.bytes(k);
            assert!(
                before == after,
                "{}: {function} was refused ({lines:?}) and changed the state",
                self.subject.name
            );
            if let Some(live) = &mut self.live[k] {
                live.known = Some(after);
            }
        }
        false
    }

    fn finish(mut self) -> Tally {
        if self.live.iter().all(|live| live.is_none()) {
            self.instantiate_well(0, self.exports[0]);
        }
        let k = self.live.iter().position(|live| live.is_some()).unwrap_or(0);
        for slot in 0..SLOTS {
            self.free_slot(k, slot);
        }
        for k in 0..INSTANCES {
            self.free_instance(k);
        }
        self.tally
    }
}

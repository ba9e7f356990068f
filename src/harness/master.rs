//! The master algorithm: fixed communication steps, Jacobi or Gauss-Seidel, events exactly on time.
//! Single-threaded and deterministic; knows no FMU, only participants.
//!
//! At a communication point: apply the events due, pass outputs on to inputs, read all outputs, show
//! the sample to the observer, step all. With Gauss-Seidel each participant, in the order given, gets
//! its inputs right before its own step, so that it sees what those before it have just computed.

mod due;
mod position;

pub use position::Position;

use due::{Due, record, resolve};

use super::coupling::{CouplingError, Endpoint};
use super::error::HarnessError;
use super::lookup::Lookup;
use super::observer::{Experiment, Observer, Sample};
use super::participant::{CallError, Participant};
use super::plan::{Algorithm, Plan, Setting, check_fixed_steps, check_times};
use super::schedule::Schedule;
use super::slave::seconds;
use super::wiring::{Port, Values, Wiring, WriteError};
use std::time::{Duration, Instant};

/// What happened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Communication steps.
    pub steps: u64,
    /// Events applied.
    pub events: usize,
    /// Exchanges of values in initialisation mode.
    pub initial_passes: usize,
    /// Whether the values stood still after the last of them.
    pub is_settled: bool,
    /// Wall time in `do_step`, one for each participant.
    pub stepping: Vec<Duration>,
    /// Wall time of the whole run, from initialisation on.
    pub total: Duration,
    /// What went wrong without spoiling the results.
    pub warnings: Vec<String>,
    /// From where this run began, or went on, to where it came, ns.
    pub span_ns: (i64, i64),
}

/// Exchanges of values in initialisation mode, at most.
const INITIAL_PASSES: usize = 10;

/// Runs the plan from initialisation to termination. The observer finishes in any case.
pub fn run(
    participants: &mut [Box<dyn Participant>],
    plan: &Plan,
    observer: &mut dyn Observer,
) -> Result<Outcome, HarnessError> {
    let (outcome, result) = run_from(participants, plan, observer, None);
    result.map(|()| outcome)
}

/// The same, with what happened also where an error ended it; from a position that an earlier run of the same
/// participants and plan has handed to its observer, it goes on as if it had never been interrupted.
pub fn run_from(
    participants: &mut [Box<dyn Participant>],
    plan: &Plan,
    observer: &mut dyn Observer,
    from: Option<&Position>,
) -> (Outcome, Result<(), HarnessError>) {
    let mut run = match Run::prepare(participants, plan) {
        Ok(run) => run,
        Err(error) => return (Outcome::default(), Err(error.into())),
    };
    let experiment = Experiment {
        start_ns: plan.start_ns,
        stop_ns: plan.stop_ns,
        step_ns: plan.step_ns,
        columns: run.wiring.columns.clone(),
    };
    let begun = Instant::now();
    let mut result = observer
        .begin(&experiment)
        .map_err(HarnessError::from)
        .and_then(|()| run.initialise(participants))
        .and_then(|()| from.map_or(Ok(()), |position| run.go_to(participants, position)))
        .and_then(|()| run.simulate(participants, observer, from.is_some()));
    run.outcome.span_ns.1 = run.schedule.now_ns();
    for participant in participants.iter_mut() {
        if let Err(error) = participant.terminate() {
            run.outcome.warnings.push(format!("{}: {error}", participant.name()));
        }
    }
    for participant in participants.iter_mut() {
        run.outcome.warnings.extend(participant.take_warnings());
    }
    let finished = observer.finish(result.as_ref().err());
    if let (Ok(()), Err(error)) = (&result, finished) {
        result = Err(error.into());
    }
    run.outcome.total = begun.elapsed();
    (run.outcome, result)
}

struct Run {
    wiring: Wiring,
    schedule: Schedule,
    algorithm: Algorithm,
    initial: Vec<(usize, Values)>,
    /// Sorted by time.
    events: Vec<Due>,
    values: Vec<f64>,
    /// Whose outputs in `values` are older than its last step or event.
    is_stale: Vec<bool>,
    plan_stop_ns: i64,
    next_event: usize,
    outcome: Outcome,
}

impl Run {
    fn prepare(participants: &[Box<dyn Participant>], plan: &Plan) -> Result<Self, CouplingError> {
        check_times(plan)?;
        let schedule = Schedule::new(plan.start_ns, plan.stop_ns, plan.step_ns);
        check_fixed_steps(participants, plan, &schedule)?;
        let set_by_event = |setting: &Setting| Endpoint::new(&*setting.participant, &*setting.variable);
        let recorded = plan.events.iter().flat_map(|event| event.sets.iter().map(set_by_event)).collect();
        let wiring = Wiring::compile(participants, &plan.connections, &recorded)?;
        let lookup = Lookup::new(participants);
        let mut values = vec![0.0; wiring.columns.len()];
        let mut events = Vec::new();
        for event in plan.events.iter().filter(|event| event.at_ns <= plan.stop_ns) {
            let place = format!("event at {:?} s", seconds(event.at_ns));
            let (sets, records) = resolve(&lookup, &wiring, &place, &event.sets, true)?;
            events.push(Due { at_ns: event.at_ns, sets, records });
        }
        for endpoint in &recorded {
            let (_, variable) = lookup.find("event", endpoint)?;
            if let (Some(column), Some(start)) = (wiring.set_column(endpoint), variable.start)
                && let Some(value) = values.get_mut(column)
            {
                *value = start.as_f64();
            }
        }
        let (initial, records) = resolve(&lookup, &wiring, "initial value", &plan.initial, false)?;
        record(&mut values, &records);
        events.sort_by_key(|event| event.at_ns);
        let outcome = Outcome {
            stepping: vec![Duration::ZERO; participants.len()],
            span_ns: (plan.start_ns, plan.start_ns),
            ..Outcome::default()
        };
        let is_stale = vec![true; participants.len()];
        let (algorithm, plan_stop_ns) = (plan.algorithm, plan.stop_ns);
        let next_event = 0;
        Ok(Self {
            wiring,
            schedule,
            algorithm,
            initial,
            events,
            values,
            is_stale,
            plan_stop_ns,
            next_event,
            outcome,
        })
    }

    /// Values, setup, and initialisation mode with outputs passed on to inputs until nothing changes, so
    /// that each starts from what the others start from.
    fn initialise(&mut self, participants: &mut [Box<dyn Participant>]) -> Result<(), HarnessError> {
        let start_ns = self.schedule.now_ns();
        for (index, values) in &self.initial {
            let Some(participant) = participants.get_mut(*index) else { continue };
            values
                .apply(participant.as_mut())
                .map_err(|source| failed(participant.as_ref(), start_ns, source))?;
        }
        let stop_ns = Some(self.plan_stop_ns);
        for_each(participants, start_ns, |participant| participant.setup(start_ns, stop_ns))?;
        for_each(participants, start_ns, |participant| participant.enter_initialization())?;
        while !self.outcome.is_settled && self.outcome.initial_passes < INITIAL_PASSES {
            self.outcome.initial_passes += 1;
            self.is_stale.fill(true);
            self.read(participants)?;
            self.outcome.is_settled = true;
            for index in 0..participants.len() {
                self.outcome.is_settled &= !self.write(participants, index)?;
            }
        }
        if !self.outcome.is_settled {
            self.outcome.warnings.push(format!(
                "initialisation: values still change after {INITIAL_PASSES} exchanges; the start may not be \
                 an equilibrium"
            ));
        }
        for_each(participants, start_ns, |participant| participant.exit_initialization())?;
        self.is_stale.fill(true);
        Ok(())
    }

    /// `is_sampled` where this communication point was told before.
    fn simulate(
        &mut self,
        participants: &mut [Box<dyn Participant>],
        observer: &mut dyn Observer,
        mut is_sampled: bool,
    ) -> Result<(), HarnessError> {
        loop {
            let t_ns = self.schedule.now_ns();
            let last = self.schedule.is_last();
            if !std::mem::take(&mut is_sampled) {
                self.settle(participants, t_ns)?;
                let regular = self.schedule.regular();
                observer.sample(Sample { t_ns, regular, last, values: &self.values })?;
                if observer.is_due(t_ns, last) {
                    observer.keep(self.position(participants)?)?;
                }
            }
            if last {
                return Ok(());
            }
            let to_ns = self.schedule.next_ns(self.events.get(self.next_event).map(|event| event.at_ns));
            self.step(participants, t_ns, to_ns)?;
            self.schedule.advance(to_ns);
            self.outcome.steps += 1;
        }
    }

    /// Applies the events due and passes outputs on.
    fn settle(&mut self, participants: &mut [Box<dyn Participant>], t_ns: i64) -> Result<(), HarnessError> {
        while let Some(event) = self.events.get(self.next_event).filter(|event| event.at_ns <= t_ns) {
            for (index, values) in &event.sets {
                let Some(participant) = participants.get_mut(*index) else { continue };
                let applied = values.apply(participant.as_mut());
                applied.map_err(|source| failed(participant.as_ref(), t_ns, source))?;
                mark(&mut self.is_stale, *index, true);
            }
            record(&mut self.values, &event.records);
            self.next_event += 1;
        }
        self.outcome.events = self.next_event;
        match self.algorithm {
            Algorithm::Jacobi => self.exchange(participants),
            Algorithm::GaussSeidel => self.read(participants),
        }
    }

    fn step(
        &mut self,
        participants: &mut [Box<dyn Participant>],
        t_ns: i64,
        to_ns: i64,
    ) -> Result<(), HarnessError> {
        for index in 0..participants.len() {
            if self.algorithm == Algorithm::GaussSeidel {
                self.write(participants, index)?;
            }
            let Some(participant) = participants.get_mut(index) else { continue };
            let begun = Instant::now();
            let stepped = participant.do_step(t_ns, to_ns - t_ns);
            if let Some(stepping) = self.outcome.stepping.get_mut(index) {
                *stepping += begun.elapsed();
            }
            stepped.map_err(|source| failed(participant.as_ref(), t_ns, source))?;
            mark(&mut self.is_stale, index, true);
            if self.algorithm == Algorithm::GaussSeidel {
                self.read_one(participants, index, Port::read)?;
                mark(&mut self.is_stale, index, false);
            }
        }
        Ok(())
    }

    /// Gives every input the value of this communication point, even where an output follows an input at
    /// once: outputs are passed on participant by participant, and read again where new inputs moved them.
    /// Without this a loop with feedthrough would run one step late.
    fn exchange(&mut self, participants: &mut [Box<dyn Participant>]) -> Result<(), HarnessError> {
        for index in 0..participants.len() {
            if index > 0 {
                self.write(participants, index)?;
            }
            self.read_one(participants, index, Port::read_sources)?;
        }
        for index in 0..participants.len() {
            self.write(participants, index)?;
        }
        self.read(participants)
    }

    /// Reads all outputs of those whose values are stale.
    fn read(&mut self, participants: &mut [Box<dyn Participant>]) -> Result<(), HarnessError> {
        for index in 0..participants.len() {
            if self.is_stale.get(index) == Some(&true) {
                self.read_one(participants, index, Port::read)?;
                mark(&mut self.is_stale, index, false);
            }
        }
        Ok(())
    }

    fn read_one(
        &mut self,
        participants: &mut [Box<dyn Participant>],
        index: usize,
        read: fn(&mut Port, &mut dyn Participant, &mut [f64]) -> Result<(), CallError>,
    ) -> Result<(), HarnessError> {
        let t_ns = self.schedule.now_ns();
        let (Some(participant), Some(port)) = (participants.get_mut(index), self.wiring.ports.get_mut(index))
        else {
            return Ok(());
        };
        read(port, participant.as_mut(), &mut self.values)
            .map_err(|source| failed(participant.as_ref(), t_ns, source))
    }

    /// Sets the connected inputs where one is new, whose outputs are then stale; says whether.
    fn write(
        &mut self,
        participants: &mut [Box<dyn Participant>],
        index: usize,
    ) -> Result<bool, HarnessError> {
        let t_ns = self.schedule.now_ns();
        let (Some(participant), Some(port)) = (participants.get_mut(index), self.wiring.ports.get_mut(index))
        else {
            return Ok(false);
        };
        let is_new = port.write(participant.as_mut(), &self.values).map_err(|error| match error {
            WriteError::Call(source) => failed(participant.as_ref(), t_ns, source),
            WriteError::Conversion { column, to, found, expected } => HarnessError::Conversion {
                from: self.wiring.columns.get(column).map_or_else(String::new, |column| column.label()),
                to: format!("{}.{to}", participant.name()),
                found,
                expected,
                time_s: seconds(t_ns),
            },
        })?;
        if is_new {
            mark(&mut self.is_stale, index, true);
        }
        Ok(is_new)
    }
}

fn mark(flags: &mut [bool], index: usize, value: bool) {
    if let Some(flag) = flags.get_mut(index) {
        *flag = value;
    }
}

fn for_each(
    participants: &mut [Box<dyn Participant>],
    t_ns: i64,
    mut call: impl FnMut(&mut dyn Participant) -> Result<(), CallError>,
) -> Result<(), HarnessError> {
    participants.iter_mut().try_for_each(|participant| {
        call(participant.as_mut()).map_err(|source| failed(participant.as_ref(), t_ns, source))
    })
}

fn failed(participant: &dyn Participant, t_ns: i64, source: CallError) -> HarnessError {
    HarnessError::Run { participant: participant.name().to_owned(), time_s: seconds(t_ns), source }
}

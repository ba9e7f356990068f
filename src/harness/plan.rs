//! What is to be simulated: times, connections, values, events. Data only, with the checks that need
//! no more than the plan itself.

use super::coupling::{Connection, CouplingError};
use super::participant::Participant;
use super::schedule::Schedule;
use super::slave::seconds;
use super::value::Value;

/// In which order participants see each other's outputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Algorithm {
    /// All step with the outputs of the communication point.
    #[default]
    Jacobi,
    /// Each steps with the newest outputs of those before it.
    GaussSeidel,
}

/// A value for a variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Whose variable.
    pub participant: String,
    /// Which.
    pub variable: String,
    /// Its value; converted to the type of the variable.
    pub value: Value,
}

impl Setting {
    /// A value for a variable.
    pub fn new(participant: impl Into<String>, variable: impl Into<String>, value: Value) -> Self {
        Self { participant: participant.into(), variable: variable.into(), value }
    }
}

/// Values set while the simulation runs. A step is cut where an event falls into it.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// When, ns.
    pub at_ns: i64,
    /// What, in this order.
    pub sets: Vec<Setting>,
}

/// What is to be simulated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// Start, ns.
    pub start_ns: i64,
    /// End, ns; not before the start.
    pub stop_ns: i64,
    /// Communication step, ns; positive.
    pub step_ns: i64,
    /// Order of exchange.
    pub algorithm: Algorithm,
    /// Which output feeds which input.
    pub connections: Vec<Connection>,
    /// Set before the experiment is set up.
    pub initial: Vec<Setting>,
    /// In any order; those of one time are applied in the order given. Events after the end are ignored.
    pub events: Vec<Event>,
}

pub(super) fn check_times(plan: &Plan) -> Result<(), CouplingError> {
    let time = |place, ns, expected| Err(CouplingError::Time { place, found_s: seconds(ns), expected });
    if plan.step_ns <= 0 {
        return time("communication step", plan.step_ns, "a positive time");
    }
    if plan.stop_ns < plan.start_ns {
        return time("end of the run", plan.stop_ns, "a time not before the start");
    }
    match plan.events.iter().find(|event| event.at_ns < plan.start_ns) {
        Some(event) => time("event", event.at_ns, "a time not before the start of the run"),
        None => Ok(()),
    }
}

pub(super) fn check_fixed_steps(
    participants: &[Box<dyn Participant>],
    plan: &Plan,
    schedule: &Schedule,
) -> Result<(), CouplingError> {
    let Some(fixed) = participants.iter().find(|participant| !participant.can_vary_step()) else {
        return Ok(());
    };
    let events = plan.events.iter().map(|event| ("an event", event.at_ns));
    let mut cuts =
        events.filter(|(_, at_ns)| *at_ns <= plan.stop_ns).chain([("the end of the run", plan.stop_ns)]);
    match cuts.find(|(_, at_ns)| !schedule.is_regular(*at_ns)) {
        Some((cause, at_ns)) => Err(CouplingError::FixedStep {
            participant: fixed.name().to_owned(),
            cause,
            time_s: seconds(at_ns),
        }),
        None => Ok(()),
    }
}

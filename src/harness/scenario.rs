//! A scenario as something that runs: who takes part, what is connected, what happens when. Computes
//! nothing and writes nothing.

use super::closed_loop;
use super::coupling::{Connection, Endpoint, connect};
use super::description::Causality;
use super::error::HarnessError;
use super::fmu::Fmu;
use super::in_process::InProcess;
use super::isolation::{self, Isolation};
use super::parted::Parted;
use super::participant::{CallError, Participant};
use super::plan::{Algorithm, Event, Plan, Setting};
use super::screened::Screened;
use super::value::Value;
use crate::fmi::{Instance, Interface, Logger, Model, ModelError};
use crate::models::fleet::{Cut, Fleet};
use crate::models::{Controller, Grid};
use crate::scenario::document::Master;
use crate::scenario::{Resolved, nanoseconds};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Name of the controller in plans and results.
pub const CONTROLLER: &str = "controller";
/// Name of the grid in plans and results.
pub const GRID: &str = "grid";

/// Where a participant comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Origin {
    /// Our own model, without any C.
    #[default]
    InProcess,
    /// An FMU.
    Fmu(PathBuf),
    /// Our own model of the controller in parts, each on its own but for messages.
    Parts(Cut),
}

/// Who takes part.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cast {
    /// In the controller's place.
    pub controller: Origin,
    /// In the grid's place.
    pub grid: Origin,
}

/// Participants, and the plan that couples them.
pub type Staged = (Vec<Box<dyn Participant>>, Plan);

/// The participants of a scenario, the controller first, and the plan that couples them.
///
/// An FMU gets the scenario's parameters where it has parameters of those names, so that a changed
/// scenario also changes what an FMU exported earlier does.
pub fn stage(resolved: &Resolved, cast: &Cast) -> Result<Staged, HarnessError> {
    stage_isolated(resolved, cast, None)
}

/// The same, with each FMU in a process of its own if that is wished.
pub fn stage_isolated(
    resolved: &Resolved,
    cast: &Cast,
    isolation: Option<&Isolation>,
) -> Result<Staged, HarnessError> {
    let own = [
        in_process(CONTROLLER, Controller::new(Controller::resource(resolved))),
        in_process(GRID, Grid::resource(resolved).and_then(Grid::new)),
    ];

    let mut participants: Vec<Box<dyn Participant>> = Vec::with_capacity(2);
    let mut initial = Vec::new();
    for ((own, origin), name) in own.into_iter().zip([&cast.controller, &cast.grid]).zip([CONTROLLER, GRID]) {
        match origin {
            Origin::InProcess => participants.push(own?),
            Origin::Parts(cut) => participants.push(parted(resolved, *cut, own?.as_ref())?),
            Origin::Fmu(path) => {
                let fmu: Box<dyn Participant> = match isolation {
                    Some(isolation) => isolation::start(path, name, isolation)?,
                    None => Box::new(Fmu::open(path)?.instantiate(name)?),
                };
                // Without a network there is no grid of our own whose parameters could be passed on.
                if name == CONTROLLER || resolved.grid.is_some() {
                    initial.extend(parameters(own?.as_ref(), fmu.as_ref()));
                }
                participants.push(fmu);
            }
        }
    }
    let plan = plan(resolved, &participants, initial)?;
    let mut screened: Vec<Box<dyn Participant>> = Vec::with_capacity(2);
    for participant in participants {
        let is_controller = participant.name() == CONTROLLER;
        screened.push(Box::new(Screened::new(participant, &resolved.faults, is_controller)?));
    }
    Ok((screened, plan))
}

impl Cast {
    /// Who takes part according to the scenario itself.
    pub fn of(resolved: &Resolved) -> Self {
        let origin = |fmu: Option<PathBuf>| fmu.map_or(Origin::InProcess, Origin::Fmu);
        Self { controller: origin(resolved.controller_fmu()), grid: origin(resolved.grid_fmu()) }
    }
}

/// The controller in parts; `whole` is there for its variables.
fn parted(
    resolved: &Resolved,
    cut: Cut,
    whole: &dyn Participant,
) -> Result<Box<dyn Participant>, HarnessError> {
    let fleet =
        Fleet::of(&Controller::resource(resolved), cut).map_err(|e| refused(CONTROLLER, e.to_string()))?;
    let parts = fleet.parts.iter().map(|part| in_process(&part.name, Controller::new(part.resource.clone())));
    let parts = parts.collect::<Result<_, _>>()?;
    Ok(Box::new(Parted::new(CONTROLLER, &fleet, whole.variables(), parts)))
}

pub(super) fn refused(participant: &str, reason: String) -> HarnessError {
    HarnessError::Call {
        participant: participant.to_owned(),
        source: CallError::new("fmi2Instantiate", reason),
    }
}

pub(super) fn in_process<M: Model>(
    name: &str,
    model: Result<M, ModelError>,
) -> Result<Box<dyn Participant>, HarnessError> {
    let refused = |reason: String| self::refused(name, reason);
    let model = model.map_err(|e| refused(e.to_string()))?;
    let instance = Instance::from_model(name, model, Interface::Structured, Logger::silent())
        .map_err(|e| refused(e.to_string()))?;
    Ok(Box::new(InProcess::new(name, instance)))
}

/// The parameters of `own` that `fmu` has too, with their values in `own`.
fn parameters(own: &dyn Participant, fmu: &dyn Participant) -> Vec<Setting> {
    let theirs: BTreeSet<&str> = names_of_parameters(fmu).collect();
    own.variables()
        .iter()
        .filter(|v| v.causality == Causality::Parameter && theirs.contains(v.name.as_str()))
        .filter_map(|v| v.start.map(|value| Setting::new(fmu.name(), v.name.as_str(), value)))
        .collect()
}

fn names_of_parameters(participant: &dyn Participant) -> impl Iterator<Item = &str> {
    let variables = participant.variables().iter();
    variables.filter(|v| v.causality == Causality::Parameter).map(|v| v.name.as_str())
}

/// The plan that couples these participants, called [`CONTROLLER`] and [`GRID`], as the scenario has it;
/// `initial` comes before the scenario's own values. Refuses a loop in which a unit or a measurement is amiss.
pub fn plan(
    resolved: &Resolved,
    participants: &[Box<dyn Participant>],
    mut initial: Vec<Setting>,
) -> Result<Plan, HarnessError> {
    let scenario = &resolved.scenario;
    let table: Vec<Connection> = resolved
        .wires
        .iter()
        .map(|wire| Connection {
            from: endpoint(&wire.from),
            to: endpoint(&wire.to),
            factor: wire.factor,
            offset: wire.offset,
        })
        .collect();
    initial.extend(settings(&scenario.initial));
    let plan = Plan {
        start_ns: 0,
        stop_ns: resolved.stop_ns(),
        step_ns: resolved.step_ns(),
        algorithm: match scenario.master {
            Master::Jacobi => Algorithm::Jacobi,
            Master::GaussSeidel => Algorithm::GaussSeidel,
        },
        connections: connect(participants, &table)?,
        initial,
        events: scenario
            .events
            .iter()
            .map(|event| Event { at_ns: nanoseconds(event.at_s), sets: settings(&event.set) })
            .collect(),
    };
    closed_loop::check_table(participants, &plan.connections)?;
    closed_loop::check_units(participants, &resolved.wires, &plan.connections)?;
    closed_loop::check_sources(participants, &plan, resolved)?;
    Ok(plan)
}

/// `grid.dP_load[12]` as participant and variable; the participant's name ends at the first dot.
fn endpoint(name: &str) -> Endpoint {
    let (participant, variable) = name.split_once('.').unwrap_or(("", name));
    Endpoint::new(participant, variable)
}

fn settings(values: &serde_json::Map<String, serde_json::Value>) -> Vec<Setting> {
    let setting = |(name, value): (&String, &serde_json::Value)| {
        let Endpoint { participant, variable } = endpoint(name);
        let value = value.as_bool().map(Value::Boolean).or_else(|| value.as_f64().map(Value::Real))?;
        Some(Setting { participant, variable, value })
    };
    values.iter().filter_map(setting).collect()
}

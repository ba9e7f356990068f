//! A scenario as something that runs: who takes part, what is connected, what happens when. Computes
//! nothing and writes nothing.

use super::coupling::{Connection, Endpoint, connect};
use super::description::Causality;
use super::error::HarnessError;
use super::fmu::Fmu;
use super::in_process::InProcess;
use super::master::{Algorithm, Event, Plan, Setting};
use super::participant::Participant;
use super::value::Value;
use crate::models::{Controller, Grid};
use crate::scenario::document::Master;
use crate::scenario::{Resolved, nanoseconds};
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
}

/// Who takes part.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cast {
    /// In the controller's place.
    pub controller: Origin,
    /// In the grid's place.
    pub grid: Origin,
}

/// The participants of a scenario, the controller first, and the plan that couples them.
///
/// An FMU gets the scenario's parameters where it has parameters of those names, so that a changed
/// scenario also changes what an FMU exported earlier does.
pub fn stage(resolved: &Resolved, cast: &Cast) -> Result<(Vec<Box<dyn Participant>>, Plan), HarnessError> {
    let refused = |participant: &str, error: crate::fmi::ModelError| HarnessError::Model {
        participant: participant.to_owned(),
        reason: error.to_string(),
    };
    let controller = Controller::new(Controller::resource(resolved)).map_err(|e| refused(CONTROLLER, e))?;
    let grid = Grid::new(Grid::resource(resolved)).map_err(|e| refused(GRID, e))?;
    let own: [Box<dyn Participant>; 2] =
        [Box::new(InProcess::new(CONTROLLER, controller)), Box::new(InProcess::new(GRID, grid))];

    let mut participants: Vec<Box<dyn Participant>> = Vec::with_capacity(2);
    let mut initial = Vec::new();
    for (mut own, origin) in own.into_iter().zip([&cast.controller, &cast.grid]) {
        match origin {
            Origin::InProcess => participants.push(own),
            Origin::Fmu(path) => {
                let slave = Fmu::open(path)?.instantiate(own.name())?;
                initial.extend(parameters(own.as_mut(), &slave)?);
                participants.push(Box::new(slave));
            }
        }
    }
    let plan = plan(resolved, &participants, initial)?;
    Ok((participants, plan))
}

/// The parameters of `own` that `fmu` has too, with their values in `own`.
fn parameters(own: &mut dyn Participant, fmu: &dyn Participant) -> Result<Vec<Setting>, HarnessError> {
    let theirs = |name: &str| {
        fmu.variables().iter().any(|v| v.name == name && v.causality == Causality::Parameter)
    };
    let shared: Vec<_> = own
        .variables()
        .iter()
        .filter(|v| v.causality == Causality::Parameter && theirs(&v.name))
        .cloned()
        .collect();
    let mut settings = Vec::with_capacity(shared.len());
    for variable in shared {
        if let Some(value) = variable.start {
            settings.push(Setting::new(fmu.name(), variable.name, value));
        }
    }
    Ok(settings)
}

fn plan(
    resolved: &Resolved,
    participants: &[Box<dyn Participant>],
    mut initial: Vec<Setting>,
) -> Result<Plan, HarnessError> {
    let scenario = &resolved.scenario;
    let table: Vec<Connection> = scenario
        .connections
        .iter()
        .map(|c| Connection { from: endpoint(&c.from), to: endpoint(&c.to), factor: c.factor, offset: c.offset })
        .collect();
    initial.extend(settings(&scenario.initial));
    Ok(Plan {
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
    })
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

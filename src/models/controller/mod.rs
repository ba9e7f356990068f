//! The consensus controller behind the FMI trait.

mod parameters;
mod variables;

use super::resource::Resource;
use crate::control;
use crate::control::config::Config;
use crate::fmi::{Group, Log, LogLevel, Model, ModelError, Phase, Step};
use std::ops::{Deref, DerefMut};
use std::path::Path;

/// The model of `BessConsensus.fmu`.
#[derive(Clone)]
pub struct Controller {
    experiment: (f64, f64),
    controller: control::Controller,
}

impl Controller {
    /// File in `resources/` that makes the model: a [`Resource`] of a [`Config`].
    pub const RESOURCE: &'static str = "controller.json";

    /// What a scenario puts into the FMU.
    #[cfg(feature = "host")]
    pub fn resource(resolved: &crate::scenario::Resolved) -> Resource<Config> {
        let scenario = &resolved.scenario;
        Resource { stop_s: scenario.stop_s, step_s: scenario.step_s, config: resolved.control.clone() }
    }

    /// The model of this configuration, in its start state.
    pub fn new(resource: Resource<Config>) -> Result<Self, ModelError> {
        let controller =
            control::Controller::new(resource.config).map_err(|e| ModelError::new(e.to_string()))?;
        Ok(Self { experiment: (resource.stop_s, resource.step_s), controller })
    }
}

impl Deref for Controller {
    type Target = control::Controller;
    fn deref(&self) -> &Self::Target {
        &self.controller
    }
}

impl DerefMut for Controller {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.controller
    }
}

impl Model for Controller {
    const IDENTIFIER: &'static str = "BessConsensus";
    const DESCRIPTION: &'static str = "Distributed step-by-step finite-time consensus controller for battery energy storage systems with droop";
    type State = control::State;

    fn load(resources: &Path) -> Result<Self, ModelError> {
        Self::new(Resource::load(resources, Self::RESOURCE)?)
    }

    fn variables(&self) -> Vec<Group<Self>> {
        variables::variables(self.controller.agents(), self.controller.topologies().count())
    }

    fn state(&self) -> &control::State {
        self.controller.state()
    }

    fn set_state(&mut self, state: &control::State) -> Result<(), ModelError> {
        self.controller.set_state(state).map_err(|e| ModelError::new(e.to_string()))
    }

    fn refresh(&mut self, phase: Phase, log: &mut dyn Log) -> Result<(), ModelError> {
        if phase == Phase::Initialization {
            self.controller.initialise();
        }
        self.controller.refresh(&mut |event| report(event, log));
        Ok(())
    }

    fn step(&mut self, step: Step, log: &mut dyn Log) -> Result<(), ModelError> {
        self.controller.step(step.start_ns, step.duration_ns, &mut |event| report(event, log));
        Ok(())
    }

    fn default_experiment(&self) -> (f64, f64) {
        self.experiment
    }
}

/// Hands an event of the graph to the importer's log.
fn report(event: control::Event, log: &mut dyn Log) {
    let level = if event.is_warning() { LogLevel::Warning } else { LogLevel::Event };
    log.log(level, format_args!("{event}"));
}

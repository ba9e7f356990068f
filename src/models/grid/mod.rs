//! The grid behind the FMI trait.

mod variables;

use super::resource::Resource;
use crate::fmi::{Group, Log, Model, ModelError, Phase, Step};
use crate::grid::{Config, GridModel, State};
use std::ops::{Deref, DerefMut};
use std::path::Path;

/// The model of `BessGrid.fmu`.
#[derive(Clone)]
pub struct Grid {
    experiment: (f64, f64),
    grid: GridModel,
}

impl Grid {
    /// File in `resources/` that makes the model: a [`Resource`] of a [`Config`].
    pub const RESOURCE: &'static str = "grid.json";

    /// What a scenario puts into the FMU, if it describes a network.
    #[cfg(feature = "host")]
    pub fn resource(resolved: &crate::scenario::Resolved) -> Result<Resource<Config>, ModelError> {
        let scenario = &resolved.scenario;
        let none = || {
            let text = "grid.case is \"none\": there is no built-in grid; expected a case, or an FMU as grid.fmu or \
                        --grid";
            ModelError::new(text.to_owned())
        };
        let config = resolved.grid.clone().ok_or_else(none)?;
        Ok(Resource { stop_s: scenario.stop_s, step_s: scenario.step_s, config })
    }

    /// The model of this configuration, in its start state.
    pub fn new(resource: Resource<Config>) -> Result<Self, ModelError> {
        let grid = GridModel::new(&resource.config).map_err(|e| ModelError::new(e.to_string()))?;
        Ok(Self { experiment: (resource.stop_s, resource.step_s), grid })
    }
}

impl Deref for Grid {
    type Target = GridModel;
    fn deref(&self) -> &Self::Target {
        &self.grid
    }
}

impl DerefMut for Grid {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.grid
    }
}

impl Model for Grid {
    const IDENTIFIER: &'static str = "BessGrid";
    const DESCRIPTION: &'static str = "Power network with droop-controlled battery inverters, constant-admittance loads and a breaker to the main grid";
    const INITIAL_STATE_FOLLOWS_INPUTS: bool = true;

    type State = State;

    fn load(resources: &Path) -> Result<Self, ModelError> {
        Self::new(Resource::load(resources, Self::RESOURCE)?)
    }

    fn variables(&self) -> Vec<Group<Self>> {
        variables::variables(self.grid.n(), self.grid.n_bus())
    }

    fn state(&self) -> &State {
        self.grid.state()
    }

    fn set_state(&mut self, state: &State) -> Result<(), ModelError> {
        self.grid.set_state(state).map_err(|e| ModelError::new(e.to_string()))
    }

    fn refresh(&mut self, phase: Phase, _log: &mut dyn Log) -> Result<(), ModelError> {
        let done = match phase {
            Phase::Initialization => self.grid.initialise(),
            Phase::Step => self.grid.refresh(),
        };
        done.map_err(|e| ModelError::new(e.to_string()))
    }

    fn step(&mut self, step: Step, _log: &mut dyn Log) -> Result<(), ModelError> {
        self.grid.step(step.start_ns, step.duration_ns).map_err(|e| ModelError::new(e.to_string()))
    }

    fn default_experiment(&self) -> (f64, f64) {
        self.experiment
    }
}

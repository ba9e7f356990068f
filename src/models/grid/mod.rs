//! The grid behind the FMI trait.

mod variables;

use super::planes::Planes;
use super::resource::Resource;
use crate::fmi::{Along, Group, Log, Model, ModelError, Phase, Plane, Shape, Size, Step, fingerprint};
use crate::grid::tangent::{Direction, Tangents};
use crate::grid::{Config, GridError, GridModel, Inputs, State};
use std::ops::{Deref, DerefMut};
use std::path::Path;

/// The model of `BessGrid.fmu`.
#[derive(Clone)]
pub struct Grid {
    experiment: (f64, f64),
    /// Of its configuration.
    fingerprint: u128,
    planes: Planes<GridModel, Tangents>,
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
        let grid = GridModel::new(&resource.config).map_err(refused)?;
        let fingerprint = fingerprint(&resource.config);
        Ok(Self { experiment: (resource.stop_s, resource.step_s), fingerprint, planes: Planes::new(grid) })
    }

    fn inputs(&self) -> &Inputs {
        self.planes.get(GridModel::inputs, |d| &d.inputs)
    }

    fn inputs_mut(&mut self) -> &mut Inputs {
        self.planes.get_mut(GridModel::inputs_mut, |d| &mut d.inputs)
    }
}

impl Deref for Grid {
    type Target = GridModel;
    fn deref(&self) -> &Self::Target {
        &self.planes.values
    }
}

impl DerefMut for Grid {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.planes.values
    }
}

impl Model for Grid {
    const IDENTIFIER: &'static str = "BessGrid";
    const DESCRIPTION: &'static str = "Power network with droop-controlled battery inverters, constant-admittance loads and a breaker to the main grid";
    const INITIAL_STATE_FOLLOWS_INPUTS: bool = true;
    const HAS_TANGENTS: bool = true;

    type State = State;

    fn load(resources: &Path) -> Result<Self, ModelError> {
        Self::new(Resource::load(resources, Self::RESOURCE)?)
    }

    fn variables(&self) -> Vec<Group<Self>> {
        let grid = &self.planes.values;
        variables::variables(grid.n(), grid.n_bus(), grid.has_tie())
    }

    fn shape(&self) -> Shape {
        let grid = &self.planes.values;
        let size = |name, description, value| Size {
            name,
            description,
            value,
            min: value,
            max: value,
            mend: "the network of this FMU has that many; export another scenario for another",
        };
        let sizes = vec![
            size("n", "Number of batteries", grid.n() as u64),
            size("n_bus", "Number of buses", grid.n_bus() as u64),
        ];
        Shape { sizes, arrays: Vec::new() }
    }

    fn fingerprint(&self) -> u128 {
        self.fingerprint
    }

    fn state(&self) -> &State {
        self.planes.values.state()
    }

    fn set_state(&mut self, state: &State) -> Result<(), ModelError> {
        self.planes.values.set_state(state).map_err(refused)
    }

    fn refresh(&mut self, phase: Phase, _log: &mut dyn Log) -> Result<(), ModelError> {
        let done = match phase {
            Phase::Initialization => self.planes.values.initialise(),
            Phase::Step => self.planes.values.refresh(),
        };
        done.map_err(refused)
    }

    fn step(&mut self, step: Step, _log: &mut dyn Log) -> Result<(), ModelError> {
        self.planes.values.step(step.start_ns, step.duration_ns).map_err(refused)
    }

    fn step_ramped(&mut self, step: Step, _log: &mut dyn Log) -> Result<(), ModelError> {
        match self.planes.both() {
            (grid, Some(d)) => grid.step_ramped(step.start_ns, step.duration_ns, &d.inputs).map_err(refused),
            (grid, None) => grid.step(step.start_ns, step.duration_ns).map_err(refused),
        }
    }

    fn look_at(&mut self, plane: Plane) {
        match plane {
            Plane::Values => self.planes.show_values(),
            Plane::Tangents => self.planes.show_tangents(GridModel::tangents, Tangents::clear),
        }
    }

    fn differentiate(&mut self, along: Along, phase: Phase) -> Result<(), ModelError> {
        let direction = match (along, phase) {
            (Along::Knowns, Phase::Initialization) => Direction::SteadyState,
            (Along::Knowns, Phase::Step) => Direction::Inputs,
            (Along::Time, _) => Direction::Time,
        };
        match self.planes.both() {
            (grid, Some(tangents)) => grid.differentiate(direction, tangents).map_err(refused),
            (_, None) => Ok(()),
        }
    }

    fn default_experiment(&self) -> (f64, f64) {
        self.experiment
    }
}

/// What the FMI shell is told.
fn refused(error: GridError) -> ModelError {
    ModelError::new(error.to_string())
}

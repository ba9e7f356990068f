//! The consensus controller behind the FMI trait.

mod parameters;
mod part;
mod shape;
mod variables;

use super::planes::Planes;
use super::resource::Resource;
use crate::control;
use crate::control::config::Config;
use crate::control::order::Order;
use crate::control::tangent::{Direction, Tangents};
use crate::control::{Inputs, Outputs, Parameters};
use crate::fmi::{Along, Group, Log, LogLevel, Model, ModelError, Phase, Plane, Shape, Step, fingerprint};
use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::sync::Arc;

/// The model of `BessConsensus.fmu`.
#[derive(Clone)]
pub struct Controller {
    experiment: (f64, f64),
    /// Of its configuration.
    fingerprint: u128,
    /// Many agents are numbered anew inside, such that neighbours are close.
    order: Order,
    /// Places of a part's own agents; empty where it is the whole fleet.
    own: Vec<usize>,
    /// Numbers in the fleet of all agents of a part, from 1; empty alike.
    numbers: Vec<u32>,
    planes: Planes<control::Controller, Tangents>,
    /// What others are made of, where that has been asked for.
    recipe: Option<Arc<Recipe>>,
}

/// What the file says, and what has been chosen beyond it.
struct Recipe {
    file: Arc<Resource<Config>>,
    shape: Shape,
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
        let refused = |e: control::ConfigError| ModelError::new(e.to_string());
        // Before anything is renumbered, so that what is wrong is told by the user's numbers.
        resource.config.validate().map_err(refused)?;
        // A part keeps its order: sums over its links are then those of the whole fleet, to the last bit.
        let is_part = resource.config.part.is_some();
        let order = if is_part { Order::default() } else { Order::local(&resource.config) };
        let fingerprint = fingerprint(&resource.config);
        let controller = control::Controller::new(order.renumbered(resource.config)).map_err(refused)?;
        let experiment = (resource.stop_s, resource.step_s);
        let own = if controller.part().is_some() { controller.own_agents() } else { Vec::new() };
        let numbers = controller.part().map_or_else(Vec::new, |part| part.agents.clone());
        Ok(Self {
            experiment,
            fingerprint,
            order,
            own,
            numbers,
            planes: Planes::new(controller),
            recipe: None,
        })
    }

    /// The same, of which others can be made.
    fn from_recipe(file: Arc<Resource<Config>>, shape: Shape) -> Result<Self, ModelError> {
        let config = shape::configured(&file.config, &shape)?;
        let made = Self::new(Resource { stop_s: file.stop_s, step_s: file.step_s, config })?;
        Ok(Self { recipe: Some(Arc::new(Recipe { file, shape })), ..made })
    }

    /// Where the agents are inside.
    fn order(&self) -> &Order {
        &self.order
    }

    /// Place of agent `i` in the arrays.
    #[inline]
    fn at(&self, i: usize) -> usize {
        self.own.get(i).copied().unwrap_or_else(|| self.order.at(i))
    }

    /// Itself where agents stand inside as they are numbered outside.
    #[inline]
    fn ordered(&self) -> Option<&Self> {
        (self.order.is_as_given() && self.own.is_empty()).then_some(self)
    }

    /// The same to be changed.
    #[inline]
    fn ordered_mut(&mut self) -> Option<&mut Self> {
        if self.order.is_as_given() && self.own.is_empty() { Some(self) } else { None }
    }

    fn inputs(&self) -> &Inputs {
        self.planes.get(control::Controller::inputs, |d| &d.inputs)
    }

    fn inputs_mut(&mut self) -> &mut Inputs {
        self.planes.get_mut(control::Controller::inputs_mut, |d| &mut d.inputs)
    }

    fn parameters(&self) -> &Parameters {
        self.planes.get(control::Controller::parameters, |d| &d.parameters)
    }

    fn parameters_mut(&mut self) -> &mut Parameters {
        self.planes.get_mut(control::Controller::parameters_mut, |d| &mut d.parameters)
    }

    fn outputs(&self) -> &Outputs {
        self.planes.get(control::Controller::outputs, |d| &d.outputs)
    }
}

impl Deref for Controller {
    type Target = control::Controller;
    fn deref(&self) -> &Self::Target {
        &self.planes.values
    }
}

impl DerefMut for Controller {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.planes.values
    }
}

impl Model for Controller {
    const IDENTIFIER: &'static str = "BessConsensus";
    const DESCRIPTION: &'static str = "Distributed step-by-step finite-time consensus controller for battery energy storage systems with droop";
    const HAS_TANGENTS: bool = true;
    type State = control::State;

    fn load(resources: &Path) -> Result<Self, ModelError> {
        Self::new(Resource::load(resources, Self::RESOURCE)?)
    }

    fn load_shapeable(resources: &Path) -> Result<Self, ModelError> {
        let file = Arc::new(Resource::<Config>::load(resources, Self::RESOURCE)?);
        if file.config.part.is_some() {
            return Err(ModelError::new(
                "clusters and agents alone are FMUs of FMI 2.0; expected a whole fleet",
            ));
        }
        let shape = shape::shape(file.config.agents());
        Self::from_recipe(file, shape)
    }

    fn shape(&self) -> Shape {
        match &self.recipe {
            Some(recipe) => recipe.shape.clone(),
            None => shape::shape(self.planes.values.agents()),
        }
    }

    fn reshaped(&self, shape: &Shape) -> Result<Self, ModelError> {
        let unknown = || ModelError::new("the file that the model was made from has not been kept");
        let recipe = self.recipe.as_ref().ok_or_else(unknown)?;
        Self::from_recipe(Arc::clone(&recipe.file), shape.clone())
    }

    fn variables(&self) -> Vec<Group<Self>> {
        let controller = &self.planes.values;
        match controller.part() {
            Some(_) => part::variables(controller),
            None => variables::variables(controller.agents(), controller.topologies()),
        }
    }

    fn distinction(&self) -> String {
        // Two equal batteries are not the same one.
        let of =
            |part: &control::part::Part| format!("part {} of {}: {:?}", part.number, part.parts, part.agents);
        self.planes.values.part().map_or_else(String::new, of)
    }

    fn fingerprint(&self) -> u128 {
        self.fingerprint
    }

    fn state(&self) -> &control::State {
        self.planes.values.state()
    }

    fn set_state(&mut self, state: &control::State) -> Result<(), ModelError> {
        self.planes.values.set_state(state).map_err(|e| ModelError::new(e.to_string()))
    }

    fn refresh(&mut self, phase: Phase, log: &mut dyn Log) -> Result<(), ModelError> {
        if phase == Phase::Initialization {
            self.planes.values.initialise();
        }
        let (order, numbers) = (&self.order, self.numbers.as_slice());
        self.planes.values.refresh(&mut |event| report(event, (order, numbers), log));
        Ok(())
    }

    fn step(&mut self, step: Step, log: &mut dyn Log) -> Result<(), ModelError> {
        let (order, numbers) = (&self.order, self.numbers.as_slice());
        let step = (step.start_ns, step.duration_ns);
        // The shell has the outputs that follow inputs brought in line before anybody reads them.
        self.planes.values.step_unseen(step.0, step.1, &mut |event| report(event, (order, numbers), log));
        Ok(())
    }

    fn look_at(&mut self, plane: Plane) {
        match plane {
            Plane::Values => self.planes.show_values(),
            Plane::Tangents => self.planes.show_tangents(control::Controller::tangents, Tangents::clear),
        }
    }

    fn differentiate(&mut self, along: Along, _: Phase) -> Result<(), ModelError> {
        let direction = match along {
            Along::Knowns => Direction::Knowns,
            Along::Time => Direction::Time,
        };
        if let (controller, Some(tangents)) = self.planes.both() {
            controller.differentiate(direction, tangents);
        }
        Ok(())
    }

    fn default_experiment(&self) -> (f64, f64) {
        self.experiment
    }
}

/// Hands an event of the graph to the importer's log.
fn report(event: control::Event, (order, numbers): (&Order, &[u32]), log: &mut dyn Log) {
    let in_fleet = |place: usize| numbers.get(place).map(|&number| number as usize - 1);
    let event = event.renumbered(|place| in_fleet(place).unwrap_or_else(|| order.agent(place)));
    let level = if event.is_warning() { LogLevel::Warning } else { LogLevel::Event };
    log.log(level, format_args!("{event}"));
}

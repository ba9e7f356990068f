//! The one trait that a model implements to become an FMU. A model knows no C and no call order:
//! the shell checks every call first, and calls a model only with finite values and valid indices.

use super::registry::Group;
use super::shape::Shape;
use serde::{Serialize, de::DeserializeOwned};
use std::path::Path;

/// A model behind the FMI shell.
///
/// `Clone` and a serde `State` are all that get/set and serialisation of FMU states need. A method that
/// fails leaves the model as it was.
pub trait Model: Clone + Send + 'static {
    /// `modelIdentifier`: a C identifier, and the file name of the shared library.
    const IDENTIFIER: &'static str;
    /// One sentence for the model description.
    const DESCRIPTION: &'static str;

    /// Whether outputs follow all inputs at the end of initialisation, even those that are states or
    /// sampled afterwards: the model starts from a steady state that it solves for.
    const INITIAL_STATE_FOLLOWS_INPUTS: bool = false;

    /// Whether the model has tangents: [`Model::look_at`], [`Model::differentiate`] and
    /// [`Model::step_ramped`] do what they say. The model description declares it.
    const HAS_TANGENTS: bool = false;

    /// Everything that inputs, parameters and steps change; not what `load` read.
    type State: Clone + Serialize + DeserializeOwned;

    /// Reads the model from the FMU's unpacked `resources/` folder, in its start state.
    fn load(resources: &Path) -> Result<Self, ModelError>;

    /// All variables, in order; the same list for the whole life of the model.
    fn variables(&self) -> Vec<Group<Self>>;

    /// What tells it from another model with the same variables; part of the GUID, because importers keep what they
    /// have unpacked by that. Empty where nothing does.
    fn distinction(&self) -> String {
        String::new()
    }

    /// Hash of all that it was made from, as by [`fingerprint`](super::fingerprint): a model that was made from something else
    /// does not take its states.
    fn fingerprint(&self) -> u128 {
        0
    }

    /// The present state.
    fn state(&self) -> &Self::State;

    /// Takes over a state of this model, perhaps from another process: lengths and values are checked
    /// before anything changes.
    fn set_state(&mut self, state: &Self::State) -> Result<(), ModelError>;

    /// Brings everything that can be read in line with the inputs and parameters set so far.
    /// Called before reads after a set or a step, and when initialisation ends ([`Phase::Initialization`]: find
    /// the initial state; [`Phase::Step`]: only what follows inputs at once; not called for outputs that declare
    /// no dependencies, which a step leaves as they are read).
    fn refresh(&mut self, phase: Phase, log: &mut dyn Log) -> Result<(), ModelError>;

    /// Advances by one communication step with the inputs held; allocates nothing.
    fn step(&mut self, step: Step, log: &mut dyn Log) -> Result<(), ModelError>;

    /// The same with every input moving from its present value at the rate in the tangent plane (per s),
    /// u(t) = u_0 + du (t - t_0); what the plane holds for parameters does not count. The inputs' values stay
    /// u_0: the shell moves them on. A model that samples its inputs when a step begins need not see the ramp.
    fn step_ramped(&mut self, step: Step, log: &mut dyn Log) -> Result<(), ModelError> {
        self.step(step, log)
    }

    /// Chooses what the functions of [`Model::variables`] read and write from now on. Changing to the tangent
    /// plane sets all tangents to 0; changing back does not touch them.
    fn look_at(&mut self, plane: Plane) {
        let _ = plane;
    }

    /// Makes the tangents of the Real outputs, at the present point, from those of the Real inputs and tunable
    /// Real parameters. Exact up to rounding; where an output has a kink, a one-sided value.
    /// [`Phase::Initialization`]: as the initial state follows the inputs. Changes no value.
    fn differentiate(&mut self, along: Along, phase: Phase) -> Result<(), ModelError> {
        let (_, _) = (along, phase);
        Ok(())
    }

    /// Reads the model such that others can be made of it, [`Model::reshaped`]: FMI 3.0 asks for that.
    fn load_shapeable(resources: &Path) -> Result<Self, ModelError> {
        Self::load(resources)
    }

    /// What this model is built from beside its resources; the same sizes and arrays, by name and order, for the whole
    /// life of the model and all that are made of it.
    fn shape(&self) -> Shape {
        Shape::default()
    }

    /// A model of the same resources and another shape, in its start state. The shape that `load` gave leads
    /// to the model that `load` gave. Not called where no size and no array can change.
    fn reshaped(&self, shape: &Shape) -> Result<Self, ModelError> {
        let _ = shape;
        Ok(self.clone())
    }

    /// `DefaultExperiment`: stop time and step size, s.
    fn default_experiment(&self) -> (f64, f64) {
        (120.0, 0.01)
    }
}

/// Where in its life a model is asked to bring its outputs in line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Up to the end of initialisation mode.
    Initialization,
    /// Between two communication steps.
    Step,
}

/// What the functions of the variables work on. A tangent is the rate of change of a variable along a
/// direction; each variable has a place for it beside its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// The values: always, but within one call of the shell.
    Values,
    /// The tangents.
    Tangents,
}

/// A direction in which a model is differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Along {
    /// That of the tangents given to inputs and parameters, the states held (fmi2GetDirectionalDerivative).
    Knowns,
    /// Time: the inputs move as their tangents say, per s, and the states by their own equations
    /// (fmi2GetRealOutputDerivatives). An output that is held until the next step has rate 0.
    Time,
}

/// One communication step. Time is counted in nanoseconds, so that it neither drifts nor rounds an
/// event away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Communication point at which the step begins, ns.
    pub start_ns: i64,
    /// Length of the step, ns; positive.
    pub duration_ns: i64,
}

impl Step {
    /// Length of the step, s.
    pub fn duration_s(self) -> f64 {
        self.duration_ns as f64 * 1e-9
    }

    /// Beginning of the step, s.
    pub fn start_s(self) -> f64 {
        self.start_ns as f64 * 1e-9
    }
}

/// Where a model reports what a user should know; the shell hands it to the importer's logger.
pub trait Log {
    /// One line, without a line break. `level` becomes the FMI status and category of the message.
    fn log(&mut self, level: LogLevel, message: std::fmt::Arguments<'_>);
}

/// How much a log line matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogLevel {
    /// Category `logEvents`.
    Event,
    /// Category `logStatusWarning`.
    Warning,
}

/// Why a model refused: what, where, found, expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ModelError {
    /// One line for the importer's log.
    pub message: String,
}

impl ModelError {
    /// An error with this message.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into() }
    }
}

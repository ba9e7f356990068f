//! One instance of a model with everything that FMI demands of it, in safe code: call order, counted
//! time, checked values, states. The C layer and an in-process master drive the same type.
//!
//! A refused call changes nothing. Errors are returned, not logged: whoever called decides.

use super::call_order::{Function, State};
use super::derivatives::Ramps;
use super::error::Error;
use super::guid::Guid;
use super::known::Known;
use super::logging::{Category, Logger};
use super::lookup::{Interface, Registry};
use super::model::{Model, Phase};
use super::state::{Life, Maker, Snapshot};
use super::time;
use std::path::Path;

/// A model under FMI's rules.
pub struct Instance<M: Model> {
    name: String,
    pub(super) model: M,
    pub(super) registry: Registry<M>,
    guid: Guid,
    /// What reset gives back.
    start: M::State,
    pub(super) logger: Logger,
    pub(super) life: Life,
    /// Rates at which inputs move during the next step.
    pub(super) ramps: Ramps,
    /// Reals read, and set, before.
    pub(super) read: Known,
    pub(super) set: Known,
}

const BORN: Life = Life { state: State::Instantiated, time_ns: 0, initialized: false, stale: true };

impl<M: Model> Instance<M> {
    /// Loads the model from an unpacked `resources/` folder, without a logger.
    pub fn new(instance_name: &str, resources: &Path) -> Result<Self, Error> {
        let model = M::load(resources).map_err(Error::model(Function::Instantiate))?;
        Self::from_model(instance_name, model, Interface::Structured, Logger::silent())
    }

    /// An instance of a freshly loaded model.
    pub fn from_model(
        instance_name: &str,
        model: M,
        interface: Interface,
        logger: Logger,
    ) -> Result<Self, Error> {
        let registry = Registry::new(&model, interface)
            .map_err(|e| Error::Load { function: Function::Instantiate, reason: e.to_string() })?;
        let guid = Guid::of(&registry, &model);
        Ok(Self::from_parts(instance_name, model, registry, guid, logger))
    }

    pub(super) fn from_parts(
        instance_name: &str,
        model: M,
        registry: Registry<M>,
        guid: Guid,
        logger: Logger,
    ) -> Self {
        let start = model.state().clone();
        let (name, ramps) = (instance_name.to_owned(), Ramps::default());
        let (read, set) = (Known::default(), Known::default());
        Self { name, model, registry, guid, start, logger, life: BORN, ramps, read, set }
    }

    /// The name given at instantiation; need not be unique.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The variables.
    pub fn registry(&self) -> &Registry<M> {
        &self.registry
    }

    /// The model behind it.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// The GUID of its model description.
    pub fn guid(&self) -> Guid {
        self.guid
    }

    /// Where in its life it stands.
    pub fn state(&self) -> State {
        self.life.state
    }

    /// End of the last step, s.
    pub fn time_s(&self) -> f64 {
        time::to_s(self.life.time_ns)
    }

    /// End of the last step, ns.
    pub fn time_ns(&self) -> i64 {
        self.life.time_ns
    }

    /// Where its log lines go.
    pub fn logger(&mut self) -> &mut Logger {
        &mut self.logger
    }

    /// Makes it unusable: after a panic nothing is known about the model.
    pub fn poison(&mut self) {
        self.life.state = State::Fatal;
    }

    /// Whether it is unusable.
    pub fn is_poisoned(&self) -> bool {
        self.life.state == State::Fatal
    }

    /// Whether the call-order table allows this function now.
    #[inline]
    pub fn allow(&self, function: Function) -> Result<(), Error> {
        let state = self.life.state;
        if function.is_allowed(state) {
            Ok(())
        } else if self.is_poisoned() {
            Err(Error::Poisoned { function })
        } else {
            Err(Error::CallOrder { function, state })
        }
    }

    /// fmi2SetupExperiment: the start time, s, any finite value; the stop time only informs.
    pub fn setup_experiment(&mut self, start_s: f64, stop_s: Option<f64>) -> Result<(), Error> {
        let function = Function::SetupExperiment;
        self.allow(function)?;
        let Some(start_ns) = time::to_ns(start_s) else {
            let expected = "a finite time within 292 years of 0".to_owned();
            return Err(Error::Argument {
                function,
                argument: "startTime",
                found: format!("{start_s:?}"),
                expected,
            });
        };
        if let Some(stop) = stop_s
            && (stop.is_nan() || stop < start_s)
        {
            let line = format_args!("{function}: stopTime = {stop:?} is not after startTime = {start_s:?}");
            self.logger.write(Category::Warning, line);
        }
        self.life.time_ns = start_ns;
        Ok(())
    }

    /// fmi2EnterInitializationMode.
    pub fn enter_initialization_mode(&mut self) -> Result<(), Error> {
        self.allow(Function::EnterInitializationMode)?;
        self.life.state = State::Initialization;
        Ok(())
    }

    /// fmi2ExitInitializationMode: the model finds its initial state.
    pub fn exit_initialization_mode(&mut self) -> Result<(), Error> {
        self.allow(Function::ExitInitializationMode)?;
        self.bring_in_line(Function::ExitInitializationMode)?;
        self.life.state = State::Step;
        self.life.initialized = true;
        Ok(())
    }

    /// fmi2DoStep from `point_s` over `step_s`, s. The start may be off by rounding; a step of zero
    /// length changes nothing.
    pub fn do_step(&mut self, point_s: f64, step_s: f64) -> Result<(), Error> {
        let function = Function::DoStep;
        self.allow(function)?;
        let argument = |argument, found: f64, expected: &str| {
            Err(Error::Argument {
                function,
                argument,
                found: format!("{found:?}"),
                expected: expected.to_owned(),
            })
        };
        if !(step_s >= 0.0 && step_s.is_finite()) {
            return argument("communicationStepSize", step_s, "a finite length >= 0 s");
        }
        if !point_s.is_finite() {
            return argument("currentCommunicationPoint", point_s, "a finite time");
        }
        let tolerance_s = time::tolerance_s(self.life.time_ns, step_s);
        let expected_s = self.time_s();
        if (point_s - expected_s).abs() > tolerance_s {
            return Err(Error::WrongTime { function, found_s: point_s, expected_s, tolerance_s });
        }
        let Some(step) = time::plan(self.life.time_ns, point_s, step_s) else {
            return argument("communicationStepSize", step_s, "a step that ends within 292 years of 0");
        };
        if step_s > 0.0 && step.duration_ns > 0 {
            if self.ramps.is_flat() {
                self.model.step(step, &mut self.logger).map_err(Error::model(function))?;
            } else {
                self.step_ramped(step)?;
            }
            self.ramps.end();
            self.life.time_ns = step.start_ns.saturating_add(step.duration_ns);
            // What follows inputs and states at once is brought in line when somebody reads it.
            self.life.stale = true;
        }
        Ok(())
    }

    /// fmi2Terminate; may be repeated.
    pub fn terminate(&mut self) -> Result<(), Error> {
        self.allow(Function::Terminate)?;
        self.life.state = State::Terminated;
        Ok(())
    }

    /// fmi2Reset: the state after instantiation. Log settings stay.
    pub fn reset(&mut self) -> Result<(), Error> {
        self.allow(Function::Reset)?;
        self.model.set_state(&self.start).map_err(Error::model(Function::Reset))?;
        self.life = BORN;
        self.ramps.end();
        Ok(())
    }

    /// fmi2GetFMUstate: a deep copy.
    pub fn snapshot(&self) -> Result<Snapshot<M>, Error> {
        self.allow(Function::GetFmuState)?;
        let (maker, life, ramps) = (self.maker(), self.life, self.ramps.clone());
        Ok(Snapshot { maker, life, ramps, state: self.model.state().clone() })
    }

    /// fmi2SetFMUstate: back, or forth, to a snapshot of any instance of this FMU.
    pub fn restore(&mut self, snapshot: &Snapshot<M>) -> Result<(), Error> {
        let function = Function::SetFmuState;
        self.allow(function)?;
        self.maker().check(&snapshot.maker).map_err(Error::format(function))?;
        self.model.set_state(&snapshot.state).map_err(Error::model(function))?;
        self.life = snapshot.life;
        self.ramps.clone_from(&snapshot.ramps);
        Ok(())
    }

    /// fmi2SerializeFMUstate.
    pub fn serialize(&self, snapshot: &Snapshot<M>) -> Result<Vec<u8>, Error> {
        self.allow(Function::SerializeFmuState)?;
        snapshot.serialize().map_err(Error::format(Function::SerializeFmuState))
    }

    /// fmi2DeSerializeFMUstate: bytes of any process and instance of this FMU.
    pub fn deserialize(&self, bytes: &[u8]) -> Result<Snapshot<M>, Error> {
        self.allow(Function::DeSerializeFmuState)?;
        Snapshot::deserialize(bytes, self.maker()).map_err(Error::format(Function::DeSerializeFmuState))
    }

    /// Whose states are this instance's.
    pub(super) fn maker(&self) -> Maker {
        Maker { guid: self.guid, resources: self.model.fingerprint() }
    }

    /// Lets outputs follow what has been set.
    pub(super) fn bring_in_line(&mut self, function: Function) -> Result<(), Error> {
        let phase = if self.life.initialized { Phase::Step } else { Phase::Initialization };
        self.model.refresh(phase, &mut self.logger).map_err(Error::model(function))?;
        self.life.stale = false;
        Ok(())
    }
}

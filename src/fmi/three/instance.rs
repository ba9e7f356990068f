//! One instance of a model as FMI 3.0 sees it, in safe code: states, configuration mode, and the building anew of a
//! model whose sizes or arrays have been changed. Values, steps and time are those of [`crate::fmi::Instance`].
//!
//! A refused call changes nothing. Reasons are returned, not logged: whoever called decides.

use super::call_order::{Function, State};
use super::error::{Outcome, Reason};
use super::state::Snapshot;
use super::table::Table;
use crate::fmi::call_order::State as CommonState;
use crate::fmi::guid::Guid;
use crate::fmi::instance::Instance as Common;
use crate::fmi::logging::{Category, Logger};
use crate::fmi::lookup::{Interface, Registry};
use crate::fmi::model::Model;
use crate::fmi::registry::Access;
use crate::fmi::shape::Shape;

/// A model under the rules of FMI 3.0.
pub struct Instance<M: Model> {
    pub(super) inner: Common<M>,
    token: Guid,
    /// What loading gave; reset goes back to it.
    first: Shape,
    /// What `inner` was built from.
    pub(super) built: Shape,
    /// What has been set since and `inner` does not follow yet.
    pub(super) wanted: Option<Shape>,
    pub(super) configuring: bool,
    pub(super) scratch: Scratch,
}

/// Room for the FMI 2.0 value references of a call's elements, so that a call between steps allocates nothing.
#[derive(Default)]
pub(super) struct Scratch {
    /// 1 to the number of elements: those of groups that follow each other stand here as they are.
    pub all: Vec<u32>,
    /// Those of a call that jumps between groups.
    pub some: [Vec<u32>; 2],
    /// As many 1 as a call asks for: orders of derivatives.
    pub ones: Vec<i32>,
}

impl<M: Model> Instance<M> {
    /// An instance of a freshly loaded model.
    pub fn from_model(instance_name: &str, model: M, logger: Logger) -> Outcome<Self> {
        let first = model.shape();
        let inner = made(instance_name, model, logger)?;
        let token = inner.guid().token(&first);
        let (built, scratch) = (first.clone(), Scratch::of(inner.registry().len()));
        Ok(Self { inner, token, first, built, wanted: None, configuring: false, scratch })
    }

    /// The instantiation token of its model description.
    pub fn token(&self) -> Guid {
        self.token
    }

    /// The model behind it.
    pub fn model(&self) -> &M {
        &self.inner.model
    }

    /// The value reference of a variable.
    pub fn reference(&self, name: &str) -> Option<u32> {
        self.table().reference(name)
    }

    /// The shape as it has been set.
    pub fn shape(&self) -> &Shape {
        self.wanted.as_ref().unwrap_or(&self.built)
    }

    /// Where in its life it stands.
    pub fn state(&self) -> State {
        match self.inner.state() {
            CommonState::Instantiated if self.configuring => State::Configuration,
            CommonState::Instantiated => State::Instantiated,
            CommonState::Initialization => State::Initialization,
            CommonState::Step => State::Step,
            CommonState::Terminated => State::Terminated,
            CommonState::Fatal => State::Fatal,
        }
    }

    /// End of the last step, s.
    pub fn time_s(&self) -> f64 {
        self.inner.time_s()
    }

    /// Where its log lines go.
    pub fn logger(&mut self) -> &mut Logger {
        self.inner.logger()
    }

    /// Makes it unusable: after a panic nothing is known about the model.
    pub fn poison(&mut self) {
        self.inner.poison();
    }

    /// Whether the call-order table allows this function now.
    pub fn allow(&self, function: Function) -> Outcome<()> {
        match self.state() {
            state if function.is_allowed(state) => Ok(()),
            State::Fatal => Err(Reason::Poisoned),
            state => Err(Reason::CallOrder { state, allowed: function.describe_allowed() }),
        }
    }

    pub(super) fn table(&self) -> Table<'_, M> {
        Table { registry: self.inner.registry(), shape: self.shape() }
    }

    /// fmi3EnterConfigurationMode.
    pub fn enter_configuration_mode(&mut self) -> Outcome<()> {
        self.allow(Function::EnterConfigurationMode)?;
        self.configuring = true;
        Ok(())
    }

    /// fmi3ExitConfigurationMode: the model is built with the sizes set. What was set before stays where an array has
    /// kept its length, and has the model's own start values where it has not.
    pub fn exit_configuration_mode(&mut self) -> Outcome<()> {
        self.allow(Function::ExitConfigurationMode)?;
        if self.shape().has_sizes_of(&self.built) {
            self.configuring = false;
            return Ok(());
        }
        self.on_built(|_| Ok(()))?;
        self.configuring = false;
        Ok(())
    }

    /// fmi3EnterInitializationMode: start and stop time, s; the stop time only informs.
    pub fn enter_initialization_mode(&mut self, start_s: f64, stop_s: Option<f64>) -> Outcome<()> {
        let function = Function::EnterInitializationMode;
        self.allow(function)?;
        self.inner.setup_experiment(start_s, None)?;
        if let Some(stop) = stop_s
            && (stop.is_nan() || stop < start_s)
        {
            let line = format_args!("{function}: stopTime = {stop:?} is not after startTime = {start_s:?}");
            self.inner.logger.write(Category::Warning, line);
        }
        Ok(self.inner.enter_initialization_mode()?)
    }

    /// fmi3ExitInitializationMode: the model finds its initial state.
    pub fn exit_initialization_mode(&mut self) -> Outcome<()> {
        self.allow(Function::ExitInitializationMode)?;
        self.on_built(|inner| Ok(inner.exit_initialization_mode()?))
    }

    /// fmi3DoStep from `point_s` over `step_s`, s; the time at which it ends, s.
    pub fn do_step(&mut self, point_s: f64, step_s: f64) -> Outcome<f64> {
        self.allow(Function::DoStep)?;
        self.inner.do_step(point_s, step_s)?;
        Ok(self.time_s())
    }

    /// fmi3Terminate; may be repeated.
    pub fn terminate(&mut self) -> Outcome<()> {
        self.allow(Function::Terminate)?;
        self.inner.terminate()?;
        // Sizes that were about to be, and have no model yet.
        self.wanted.take_if(|wanted| !wanted.has_sizes_of(&self.built));
        self.configuring = false;
        Ok(())
    }

    /// fmi3Reset: the state after instantiation, with the sizes that it had then. Log settings stay.
    pub fn reset(&mut self) -> Outcome<()> {
        self.allow(Function::Reset)?;
        if self.built == self.first {
            self.inner.reset()?;
        } else {
            let model = self.inner.model.reshaped(&self.first)?;
            let fresh = made(self.inner.name(), model, Logger::silent())?;
            self.replace(fresh, self.first.clone());
        }
        self.wanted = None;
        self.configuring = false;
        Ok(())
    }

    /// Does something with the instance of the shape that is wanted: with the present one where that is the one, else
    /// with a new one, which takes the present one's place if all goes well.
    pub(super) fn on_built<R>(&mut self, body: impl FnOnce(&mut Common<M>) -> Outcome<R>) -> Outcome<R> {
        let Some(shape) = self.wanted.as_ref().filter(|shape| **shape != self.built) else {
            let done = body(&mut self.inner)?;
            self.wanted = None;
            return Ok(done);
        };
        let (fresh, lost) = self.rebuilt(shape)?;
        let mut trial = Trial::new(&mut self.inner, fresh);
        let done = body(&mut trial.fresh)?;
        trial.succeed();
        drop(trial);
        for line in lost {
            self.inner.logger.write(Category::Warning, format_args!("{line}"));
        }
        self.scratch = Scratch::of(self.inner.registry().len());
        if let Some(shape) = self.wanted.take() {
            self.built = shape;
        }
        Ok(done)
    }

    /// An instance of another shape, in the same state of its life, with what has been set to this one; and a line for
    /// each value that it does not accept.
    fn rebuilt(&self, shape: &Shape) -> Outcome<(Common<M>, Vec<String>)> {
        let model = self.inner.model.reshaped(shape)?;
        let mut fresh = made(self.inner.name(), model, Logger::silent())?;
        let lost = carry_over(&self.inner, &mut fresh);
        fresh.life = self.inner.life;
        fresh.life.stale = true;
        Ok((fresh, lost))
    }

    /// Puts another instance, built from this shape, in the place of the present one; the logger stays.
    pub(super) fn replace(&mut self, fresh: Common<M>, shape: Shape) {
        let mut trial = Trial::new(&mut self.inner, fresh);
        trial.succeed();
        drop(trial);
        self.built = shape;
        self.scratch = Scratch::of(self.inner.registry().len());
    }

    /// A fresh instance of another shape, for a snapshot to be put into.
    pub(super) fn fresh(&self, shape: &Shape) -> Outcome<Common<M>> {
        made(self.inner.name(), self.inner.model.reshaped(shape)?, Logger::silent())
    }

    /// fmi3GetFMUState: a deep copy.
    pub fn snapshot(&self) -> Outcome<Snapshot<M>> {
        self.allow(Function::GetFMUState)?;
        Ok(Snapshot {
            token: self.token,
            configuring: self.configuring,
            built: self.built.values(),
            wanted: self.wanted.as_ref().map(Shape::values),
            inner: self.inner.snapshot()?,
        })
    }
}

impl Scratch {
    fn of(elements: usize) -> Self {
        Self { all: (1..=elements as u32).collect(), ..Self::default() }
    }
}

/// An instance of FMI 2.0 of this model.
fn made<M: Model>(name: &str, model: M, logger: Logger) -> Outcome<Common<M>> {
    let registry =
        Registry::new(&model, Interface::Structured).map_err(|error| Reason::Load(error.to_string()))?;
    let guid = Guid::of(&registry, &model);
    Ok(Common::from_parts(name, model, registry, guid, logger))
}

/// Copies every value that can be set, where both have as many and the other accepts it; of one that it does not accept a
/// line says so.
fn carry_over<M: Model>(from: &Common<M>, to: &mut Common<M>) -> Vec<String> {
    let mut lost = Vec::new();
    for (_, group) in to.registry.groups() {
        let known = from.registry.group(group.name).filter(|(_, old)| old.len() == group.len());
        let Some((_, old)) = known else { continue };
        let mut lose = |value: &dyn std::fmt::Display| {
            let (name, range) = (group.name, &group.range);
            lost.push(format!("{name} = {value} is not kept in the model as it is now; expected {range}"));
        };
        for index in 0..group.len() {
            match (&old.access, &group.access) {
                (Access::Real(get, _), Access::Real(_, Some(set))) => {
                    let value = get(&from.model, index);
                    if group.range.contains(value) {
                        set(&mut to.model, index, value);
                    } else {
                        lose(&value);
                    }
                }
                (Access::Integer(get, _), Access::Integer(_, Some(set))) => {
                    let value = get(&from.model, index);
                    if group.range.contains(f64::from(value)) {
                        set(&mut to.model, index, value);
                    } else {
                        lose(&value);
                    }
                }
                (Access::Boolean(get, _), Access::Boolean(_, Some(set))) => {
                    set(&mut to.model, index, get(&from.model, index));
                }
                _ => {}
            }
        }
    }
    lost
}

/// Two instances of which one will stay; the importer's logger is with the one that is asked meanwhile, and with the
/// one that stays whatever happens.
struct Trial<'a, M: Model> {
    present: &'a mut Common<M>,
    fresh: Common<M>,
    succeeded: bool,
}

impl<'a, M: Model> Trial<'a, M> {
    fn new(present: &'a mut Common<M>, mut fresh: Common<M>) -> Self {
        std::mem::swap(&mut present.logger, &mut fresh.logger);
        Self { present, fresh, succeeded: false }
    }

    fn succeed(&mut self) {
        std::mem::swap(self.present, &mut self.fresh);
        self.succeeded = true;
    }
}

impl<M: Model> Drop for Trial<'_, M> {
    fn drop(&mut self) {
        if !self.succeeded {
            std::mem::swap(&mut self.present.logger, &mut self.fresh.logger);
        }
    }
}

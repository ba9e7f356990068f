//! A model of ours as a participant, without any C in between: for tests and for runs that want no
//! FMU. The same call order and checks as behind the C interface, because it is the same instance.

use super::description::{Causality, Variability, Variable};
use super::participant::{CallError, Participant, StateHandle};
use super::slave::seconds;
use super::value::{Kind, Value};
use crate::fmi::{self, Instance, Interface, Model, Snapshot};
use std::collections::BTreeMap;
use std::path::Path;

/// A model in this process.
pub struct InProcess<M: Model> {
    name: String,
    instance: Instance<M>,
    variables: Vec<Variable>,
    states: BTreeMap<u64, Snapshot<M>>,
    next_state: u64,
    /// Booleans on their way in, so that a set allocates nothing.
    truths: Vec<bool>,
}

impl<M: Model> InProcess<M> {
    /// Loads the model from a folder like the `resources/` of its FMU.
    pub fn load(name: &str, resources: &Path) -> Result<Self, CallError> {
        Instance::new(name, resources)
            .map(|instance| Self::new(name, instance))
            .map_err(refused("fmi2Instantiate"))
    }

    /// Wraps a fresh instance.
    pub fn new(name: &str, instance: Instance<M>) -> Self {
        let variables = variables(&instance);
        Self {
            name: name.to_owned(),
            truths: Vec::with_capacity(variables.len()),
            instance,
            variables,
            states: BTreeMap::new(),
            next_state: 0,
        }
    }

    /// The instance inside.
    pub fn instance(&self) -> &Instance<M> {
        &self.instance
    }

    fn kept(&self, function: &'static str, state: StateHandle) -> Result<&Snapshot<M>, CallError> {
        self.states.get(&state.0).ok_or_else(|| {
            CallError::new(function, format!("not called: state {} is not kept by this instance", state.0))
        })
    }

    fn keep(&mut self, state: Snapshot<M>) -> StateHandle {
        let handle = self.next_state;
        self.next_state += 1;
        self.states.insert(handle, state);
        StateHandle(handle)
    }
}

fn refused(function: &'static str) -> impl Fn(fmi::Error) -> CallError {
    // The message of the shell begins with the function's name, which a CallError shows itself.
    move |error| {
        let text = error.to_string();
        let reason = text.strip_prefix(function).and_then(|text| text.strip_prefix(": ")).unwrap_or(&text);
        CallError::new(function, reason)
    }
}

impl<M: Model> Participant for InProcess<M> {
    fn name(&self) -> &str {
        &self.name
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn identity(&self) -> String {
        self.instance.guid().to_string()
    }

    fn setup(&mut self, start_ns: i64, stop_ns: Option<i64>) -> Result<(), CallError> {
        let setup = self.instance.setup_experiment(seconds(start_ns), stop_ns.map(seconds));
        setup.map_err(refused("fmi2SetupExperiment"))
    }

    fn enter_initialization(&mut self) -> Result<(), CallError> {
        self.instance.enter_initialization_mode().map_err(refused("fmi2EnterInitializationMode"))
    }

    fn exit_initialization(&mut self) -> Result<(), CallError> {
        self.instance.exit_initialization_mode().map_err(refused("fmi2ExitInitializationMode"))
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.instance.get_real(references, values).map_err(refused("fmi2GetReal"))
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.instance.get_integer(references, values).map_err(refused("fmi2GetInteger"))
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.instance.get_boolean(references, values).map_err(refused("fmi2GetBoolean"))
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.instance.set_real(references, values).map_err(refused("fmi2SetReal"))
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.instance.set_integer(references, values).map_err(refused("fmi2SetInteger"))
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.truths.clear();
        self.truths.extend(values.iter().map(|value| *value != 0));
        self.instance.set_boolean(references, &self.truths).map_err(refused("fmi2SetBoolean"))
    }

    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        self.instance.do_step(seconds(t_ns), seconds(h_ns)).map_err(refused("fmi2DoStep"))
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.instance.terminate().map_err(refused("fmi2Terminate"))
    }

    fn reset(&mut self) -> Result<(), CallError> {
        self.instance.reset().map_err(refused("fmi2Reset"))
    }

    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        let state = self.instance.snapshot().map_err(refused("fmi2GetFMUstate"))?;
        Ok(self.keep(state))
    }

    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError> {
        let function = "fmi2SetFMUstate";
        let Some(snapshot) = self.states.get(&state.0) else { return self.kept(function, state).map(|_| ()) };
        self.instance.restore(snapshot).map_err(refused(function))
    }

    fn forget_state(&mut self, state: StateHandle) {
        self.states.remove(&state.0);
    }

    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        let function = "fmi2SerializeFMUstate";
        self.instance.serialize(self.kept(function, state)?).map_err(refused(function))
    }

    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        let state = self.instance.deserialize(bytes).map_err(refused("fmi2DeSerializeFMUstate"))?;
        Ok(self.keep(state))
    }
}

/// The registry as an importer sees it in the model description. Start values are the present ones.
fn variables<M: Model>(instance: &Instance<M>) -> Vec<Variable> {
    let registry = instance.registry();
    let mut variables = Vec::with_capacity(registry.len());
    for reference in 1..=registry.len() as u32 {
        let (Some((group, index)), Some(name)) = (registry.locate(reference), registry.name(reference))
        else {
            continue;
        };
        let causality = match group.causality {
            fmi::Causality::Input => Causality::Input,
            fmi::Causality::Output => Causality::Output,
            fmi::Causality::Parameter => Causality::Parameter,
        };
        let variability = match group.variability {
            fmi::Variability::Fixed => Variability::Fixed,
            fmi::Variability::Tunable => Variability::Tunable,
            fmi::Variability::Discrete => Variability::Discrete,
            fmi::Variability::Continuous => Variability::Continuous,
        };
        let interface: Interface = registry.interface;
        let (kind, value) = match group.value(instance.model(), index, interface) {
            fmi::lookup::Value::Real(value) => (Kind::Real, Value::Real(value)),
            fmi::lookup::Value::Integer(value) => (Kind::Integer, Value::Integer(value)),
            fmi::lookup::Value::Boolean(value) => (Kind::Boolean, Value::Boolean(value)),
        };
        variables.push(Variable {
            name,
            reference,
            kind,
            causality,
            variability,
            initial: None,
            start: (causality != Causality::Output).then_some(value),
            unit: group.unit.filter(|_| kind == Kind::Real).map(|unit| unit.name().to_owned()),
            description: Some(group.description.to_owned()),
        });
    }
    variables
}

//! One FMU of the system as the descriptions need it: its variables with the values that they start with.
//! The model itself checks the values, so that nothing is written that it would refuse.

use super::{PARAMETER_SET, Start, SystemError};
use crate::fmi::lookup::{Registry, Value};
use crate::fmi::{Causality, Instance, Interface, Logger, Model, Type};

/// A component of the system.
pub struct Part {
    /// `controller`, `grid`, or what a part of a fleet is called.
    pub name: String,
    /// The archive path of the FMU.
    pub source: String,
    /// All variables, in order.
    pub variables: Vec<Variable>,
}

/// One variable of a component.
pub struct Variable {
    /// As the FMU of this interface calls it.
    pub name: String,
    /// As scenarios call it: `P[1]`.
    pub structured: String,
    /// Who sets it.
    pub causality: Causality,
    /// Its type in this interface.
    pub kind: Type,
    /// Value at the start; of an output, nothing to rely on.
    pub value: Value,
    /// Whether the FMU would start with this value anyway.
    pub unchanged: bool,
}

impl Part {
    /// The component of a model with the values that are meant for it.
    pub fn new<M: Model>(
        (name, source): (&str, String),
        model: M,
        interface: Interface,
        start: &[Start],
    ) -> Result<Self, SystemError> {
        let refused = |path: &str, reason: String| SystemError::Refused { path: path.to_owned(), reason };
        let structured =
            Registry::new(&model, Interface::Structured).map_err(|e| refused(name, e.to_string()))?;
        // The portable interface takes every type as a number.
        let mut instance = Instance::from_model(name, model.clone(), Interface::Portable, Logger::silent())
            .map_err(|e| refused(name, e.to_string()))?;
        for Start { path, variable, value } in start {
            let Some((_, found)) = variable.split_once('.').filter(|(owner, _)| *owner == name) else {
                continue;
            };
            let reference = structured.reference(found).ok_or_else(|| SystemError::Unknown {
                path: path.clone(),
                found: variable.clone(),
                expected: "variable of the FMU; as grid.dP_load[12]",
            })?;
            instance.set_real(&[reference], &[*value]).map_err(|e| refused(path, e.to_string()))?;
        }
        let shown = Registry::new(&model, interface).map_err(|e| refused(name, e.to_string()))?;
        let mut variables = Vec::with_capacity(shown.len());
        for (first, group) in shown.groups() {
            for (index, reference) in (first..).take(group.len()).enumerate() {
                let value = group.value(instance.model(), index, interface);
                variables.push(Variable {
                    name: shown.name(reference).unwrap_or_default(),
                    structured: structured.name(reference).unwrap_or_default(),
                    causality: group.causality,
                    kind: group.type_in(interface),
                    value,
                    unchanged: value == group.value(&model, index, interface),
                });
            }
        }
        Ok(Self { name: name.to_owned(), source, variables })
    }

    /// The archive path of its parameter set.
    pub fn parameter_file(&self) -> String {
        format!("resources/{}-{PARAMETER_SET}.ssv", self.name)
    }

    /// The variable that scenarios call this, with the causality asked for.
    pub fn find(&self, structured: &str, causality: Causality) -> Option<&Variable> {
        self.variables.iter().find(|v| v.causality == causality && v.structured == structured)
    }
}

/// Every value is for one of these components.
pub fn check_owners(start: &[Start], owners: &[&str]) -> Result<(), SystemError> {
    let known = |s: &&Start| s.variable.split_once('.').is_some_and(|(owner, _)| owners.contains(&owner));
    match start.iter().find(|s| !known(s)) {
        None => Ok(()),
        Some(Start { path, variable, .. }) => Err(SystemError::Unknown {
            path: path.clone(),
            found: variable.clone(),
            expected: "variable of controller or grid; as grid.dP_load[12]",
        }),
    }
}

//! Getting and setting values: the whole array is checked before the first value moves. Nothing here
//! allocates unless a call is refused.

use super::call_order::{Function, State};
use super::error::Error;
use super::instance::Instance;
use super::known::Stretch;
use super::lookup::{Interface, Run, Type};
use super::model::Model;
use super::registry::{Access, Causality, Dependencies, Group, Range, Variability};

impl<M: Model> Instance<M> {
    /// fmi2GetReal.
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), Error> {
        if self.get_known(references, values)? {
            return Ok(());
        }
        self.prepare_get(Function::GetReal, Type::Real, references, values.len())?;
        for run in self.registry.runs(references).flatten() {
            let (group, values) = (run.group, run.values_mut(values));
            if run.range().is_some_and(|range| group.read_row(&self.model, range, values)) {
                continue;
            }
            let places = run.indices().zip(values);
            match group.access {
                Access::Real(get, _) => places.for_each(|(i, v)| *v = get(&self.model, i)),
                Access::Integer(get, _) => places.for_each(|(i, v)| *v = f64::from(get(&self.model, i))),
                Access::Boolean(get, _) => {
                    places.for_each(|(i, v)| *v = if get(&self.model, i) { 1.0 } else { 0.0 });
                }
            }
        }
        if self.registry.interface == Interface::Structured {
            self.read.keep(&self.registry, references);
        }
        Ok(())
    }

    /// The same of an array that was read before; false where it was not, or where there is something to refuse.
    fn get_known(&mut self, references: &[u32], values: &mut [f64]) -> Result<bool, Error> {
        let Some(array) = self.read.find(references).filter(|_| references.len() == values.len()) else {
            return Ok(false);
        };
        let function = Function::GetReal;
        self.allow(function)?;
        let follows = if self.life.initialized { array.has_follower } else { array.has_output };
        if follows && self.life.stale {
            self.bring_in_line(function)?;
        }
        let Some(array) = self.read.find(references) else { return Ok(false) };
        for Stretch { group, indices, places } in &array.stretches {
            let (Some(group), Some(values)) =
                (self.registry.numbered(*group), values.get_mut(places.clone()))
            else {
                return Ok(false);
            };
            if group.read_row(&self.model, indices.clone(), values) {
                continue;
            }
            if let Access::Real(get, _) = group.access {
                for (i, value) in indices.clone().zip(values) {
                    *value = get(&self.model, i);
                }
            } else {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// fmi2GetInteger.
    pub fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), Error> {
        self.prepare_get(Function::GetInteger, Type::Integer, references, values.len())?;
        for (reference, value) in references.iter().zip(values) {
            if let Some((&Group { access: Access::Integer(get, _), .. }, index)) =
                self.registry.locate(*reference)
            {
                *value = get(&self.model, index);
            }
        }
        Ok(())
    }

    /// fmi2GetBoolean, into `bool` or into C's integers.
    pub fn get_boolean<B: From<bool>>(&mut self, references: &[u32], values: &mut [B]) -> Result<(), Error> {
        self.prepare_get(Function::GetBoolean, Type::Boolean, references, values.len())?;
        for (reference, value) in references.iter().zip(values) {
            if let Some((&Group { access: Access::Boolean(get, _), .. }, index)) =
                self.registry.locate(*reference)
            {
                *value = get(&self.model, index).into();
            }
        }
        Ok(())
    }

    /// fmi2SetReal.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), Error> {
        if self.set_known(references, values) {
            return Ok(());
        }
        let function = Function::SetReal;
        self.check_set(function, Type::Real, references, values.len())?;
        for run in self.registry.runs(references).flatten() {
            let (group, values) = (run.group, run.values(values));
            for (reference, value) in run.references.iter().zip(values) {
                let accepted = match group.access {
                    Access::Real(..) => group.range.contains(*value),
                    Access::Integer(..) => {
                        group.range.contains(value.round()) && to_integer(*value).is_some()
                    }
                    Access::Boolean(..) => value.is_finite() && group.range.contains(number(*value >= 0.5)),
                };
                self.check_value(function, *reference, group, *value, accepted)?;
            }
        }
        for run in self.registry.runs(references).flatten() {
            let (group, values) = (run.group, run.values(values));
            if run.range().is_some_and(|range| group.write_row(&mut self.model, range, values)) {
                continue;
            }
            let (model, places) = (&mut self.model, run.indices().zip(values));
            match group.access {
                Access::Real(_, Some(set)) => places.for_each(|(i, v)| set(model, i, *v)),
                Access::Integer(_, Some(set)) => {
                    places.for_each(|(i, v)| set(model, i, to_integer(*v).unwrap_or_default()));
                }
                Access::Boolean(_, Some(set)) => places.for_each(|(i, v)| set(model, i, *v >= 0.5)),
                _ => {}
            }
        }
        self.life.stale |= !references.is_empty();
        if self.registry.interface == Interface::Structured {
            self.set.keep(&self.registry, references);
        }
        Ok(())
    }

    /// The same of an array that was set before; false, and nothing set, where it was not, or where there is
    /// something to refuse.
    fn set_known(&mut self, references: &[u32], values: &[f64]) -> bool {
        let Some(array) = self.set.find(references).filter(|_| references.len() == values.len()) else {
            return false;
        };
        let before_steps = matches!(self.life.state, State::Instantiated | State::Initialization);
        if self.allow(Function::SetReal).is_err() || array.has_fixed && !before_steps {
            return false;
        }
        let accepts = |stretch: &Stretch| {
            let range = self.registry.numbered(stretch.group).map(|group| group.range);
            range.zip(values.get(stretch.places.clone())).is_some_and(|(range, values)| range.contain(values))
        };
        if array.has_bounds && !array.stretches.iter().all(accepts) || !Range::all_sound(values) {
            return false;
        }
        for Stretch { group, indices, places } in &array.stretches {
            let (Some(group), Some(values)) = (self.registry.numbered(*group), values.get(places.clone()))
            else {
                continue;
            };
            if group.write_row(&mut self.model, indices.clone(), values) {
                continue;
            }
            if let Access::Real(_, Some(set)) = group.access {
                for (i, value) in indices.clone().zip(values) {
                    set(&mut self.model, i, *value);
                }
            }
        }
        self.life.stale = true;
        true
    }

    /// fmi2SetInteger.
    pub fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), Error> {
        let function = Function::SetInteger;
        self.check_set(function, Type::Integer, references, values.len())?;
        for (reference, value) in references.iter().zip(values) {
            if let Some((group, _)) = self.registry.locate(*reference) {
                let value = f64::from(*value);
                self.check_value(function, *reference, group, value, group.range.contains(value))?;
            }
        }
        for (reference, value) in references.iter().zip(values) {
            if let Some((&Group { access: Access::Integer(_, Some(set)), .. }, index)) =
                self.registry.locate(*reference)
            {
                set(&mut self.model, index, *value);
            }
        }
        self.life.stale |= !references.is_empty();
        Ok(())
    }

    /// fmi2SetBoolean.
    pub fn set_boolean(&mut self, references: &[u32], values: &[bool]) -> Result<(), Error> {
        self.set_boolean_from(references, values, |value| value)
    }

    /// The same from another representation of truth.
    pub(super) fn set_boolean_from<B: Copy>(
        &mut self,
        references: &[u32],
        values: &[B],
        truth: fn(B) -> bool,
    ) -> Result<(), Error> {
        let function = Function::SetBoolean;
        self.check_set(function, Type::Boolean, references, values.len())?;
        for (reference, value) in references.iter().zip(values) {
            if let Some((group, _)) = self.registry.locate(*reference) {
                let value = number(truth(*value));
                self.check_value(function, *reference, group, value, group.range.contains(value))?;
            }
        }
        for (reference, value) in references.iter().zip(values) {
            if let Some((&Group { access: Access::Boolean(_, Some(set)), .. }, index)) =
                self.registry.locate(*reference)
            {
                set(&mut self.model, index, truth(*value));
            }
        }
        self.life.stale |= !references.is_empty();
        Ok(())
    }

    /// Checks a get and, where an output that follows inputs is asked for after a set or a step, brings the outputs
    /// in line. A state or a sampled output is what the last step left, once there was an initialisation.
    fn prepare_get(
        &mut self,
        function: Function,
        expected: Type,
        references: &[u32],
        values: usize,
    ) -> Result<(), Error> {
        let (mut follows, initialized) = (false, self.life.initialized);
        self.check_call(function, expected, references, values, |run| {
            let is_held = initialized && matches!(run.group.dependencies, Dependencies::None);
            follows |= run.group.causality == Causality::Output && !is_held;
            Ok(())
        })?;
        if follows && self.life.stale { self.bring_in_line(function) } else { Ok(()) }
    }

    /// Checks everything about a set but the values.
    fn check_set(
        &self,
        function: Function,
        expected: Type,
        references: &[u32],
        values: usize,
    ) -> Result<(), Error> {
        let before_steps = matches!(self.life.state, State::Instantiated | State::Initialization);
        self.check_call(function, expected, references, values, |run| {
            let reason = match (run.group.causality, run.group.variability) {
                (Causality::Output, _) => "it is an output",
                (Causality::Parameter, Variability::Fixed) if !before_steps => {
                    "it is a fixed parameter; expected to be set before initialization ends"
                }
                _ => return Ok(()),
            };
            Err(Error::NotSettable { function, name: self.name_of(run.references), reason })
        })
    }

    /// Checks call order, lengths, references and types, then each run by `check`.
    #[inline]
    pub(super) fn check_call(
        &self,
        function: Function,
        expected: Type,
        references: &[u32],
        values: usize,
        mut check: impl FnMut(&Run<'_, M>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.allow(function)?;
        if references.len() != values {
            return Err(Error::Length { function, references: references.len(), values });
        }
        for run in self.registry.runs(references) {
            let run = run.map_err(|position| Error::UnknownReference {
                function,
                position,
                found: references.get(position).copied().unwrap_or_default(),
                count: self.registry.len(),
            })?;
            let found = run.group.type_in(self.registry.interface);
            if found != expected {
                return Err(Error::WrongType {
                    function,
                    name: self.name_of(run.references),
                    found,
                    expected,
                });
            }
            check(&run)?;
        }
        Ok(())
    }

    #[inline]
    pub(super) fn check_value(
        &self,
        function: Function,
        reference: u32,
        group: &Group<M>,
        found: f64,
        accepted: bool,
    ) -> Result<(), Error> {
        if accepted {
            return Ok(());
        }
        let expected = match group.access {
            Access::Boolean(..) if found.is_finite() => "false".to_owned(),
            Access::Boolean(..) => "a finite value".to_owned(),
            _ => group.range.instead_of(found),
        };
        Err(Error::Value { function, name: self.name_of(&[reference]), found, expected })
    }

    /// The name of the first of these.
    pub(super) fn name_of(&self, references: &[u32]) -> String {
        references.first().and_then(|reference| self.registry.name(*reference)).unwrap_or_default()
    }
}

/// 0 or 1.
fn number(truth: bool) -> f64 {
    if truth { 1.0 } else { 0.0 }
}

/// The nearest integer, for the portable interface.
fn to_integer(value: f64) -> Option<i32> {
    let rounded = value.round();
    (rounded >= f64::from(i32::MIN) && rounded <= f64::from(i32::MAX)).then_some(rounded as i32)
}

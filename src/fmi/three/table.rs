//! From a value reference of FMI 3.0 to what it stands for. 0 is the time, then come the groups of the registry, one
//! variable each, then the sizes, then the arrays of the model's shape. The same numbers whatever the sizes are.

use super::error::{Outcome, Reason};
use crate::fmi::lookup::{Interface, Registry, Type as Kind};
use crate::fmi::model::Model;
use crate::fmi::registry::Group;
use crate::fmi::shape::{Array, Shape, Size, Values};
use std::fmt;

/// The value reference of the independent variable.
pub const TIME: u32 = 0;

/// The types of this FMU's variables.
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    Float64,
    Int32,
    UInt64,
    Boolean,
}

impl Type {
    /// Its name in the model description and in `fmi3Get...`.
    pub fn name(self) -> &'static str {
        match self {
            Type::Float64 => "Float64",
            Type::Int32 => "Int32",
            Type::UInt64 => "UInt64",
            Type::Boolean => "Boolean",
        }
    }

    /// That of a group's variables.
    pub(super) fn of<M>(group: &Group<M>) -> Self {
        match group.type_in(Interface::Structured) {
            Kind::Real => Type::Float64,
            Kind::Integer => Type::Int32,
            Kind::Boolean => Type::Boolean,
        }
    }
}

impl fmt::Display for Type {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What a value reference stands for.
pub(super) enum Variable<'a, M> {
    Time,
    /// A group, with the FMI 2.0 value reference of its first element.
    Group(u32, &'a Group<M>),
    /// A size, by its position among the sizes.
    Size(usize, &'a Size),
    /// An array of the shape, by its position among them.
    Array(usize, &'a Array),
}

impl<M> Variable<'_, M> {
    pub fn name(&self) -> &'static str {
        match self {
            Variable::Time => "time",
            Variable::Group(_, group) => group.name,
            Variable::Size(_, size) => size.name,
            Variable::Array(_, array) => array.name,
        }
    }

    pub fn kind(&self) -> Type {
        match self {
            Variable::Time => Type::Float64,
            Variable::Group(_, group) => Type::of(group),
            Variable::Size(..) => Type::UInt64,
            Variable::Array(_, array) => match array.values {
                Values::UInt64(_) => Type::UInt64,
                Values::Float64(_) => Type::Float64,
            },
        }
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        match self {
            Variable::Time | Variable::Size(..) => 1,
            Variable::Group(_, group) => group.len(),
            Variable::Array(_, array) => array.values.len(),
        }
    }
}

/// Registry and shape of one model as one list.
pub(super) struct Table<'a, M> {
    pub registry: &'a Registry<M>,
    pub shape: &'a Shape,
}

impl<'a, M: Model> Table<'a, M> {
    /// What a value reference stands for.
    pub fn get(&self, reference: u32) -> Option<Variable<'a, M>> {
        let Some(number) = (reference as usize).checked_sub(1) else { return Some(Variable::Time) };
        if let Some((first, group)) = self.registry.nth(number) {
            return Some(Variable::Group(first, group));
        }
        let position = number - self.groups();
        if let Some(size) = self.shape.sizes.get(position) {
            return Some(Variable::Size(position, size));
        }
        let position = position - self.shape.sizes.len();
        self.shape.arrays.get(position).map(|array| Variable::Array(position, array))
    }

    /// The same of an element of a caller's array.
    pub fn at(&self, position: usize, reference: u32) -> Outcome<Variable<'a, M>> {
        let unknown = || Reason::UnknownReference { position, found: reference, last: self.last() };
        self.get(reference).ok_or_else(unknown)
    }

    /// The largest value reference.
    pub fn last(&self) -> u32 {
        (self.groups() + self.shape.sizes.len() + self.shape.arrays.len()) as u32
    }

    /// The value reference of a variable.
    pub fn reference(&self, name: &str) -> Option<u32> {
        (0..=self.last()).find(|reference| self.get(*reference).is_some_and(|found| found.name() == name))
    }

    fn groups(&self) -> usize {
        self.registry.groups().len()
    }

    /// Checks that all variables are of a type; the number of their elements together.
    pub fn count(&self, references: &[u32], expected: Type) -> Outcome<usize> {
        let mut sum = 0_usize;
        for (position, reference) in references.iter().enumerate() {
            let variable = self.at(position, *reference)?;
            if variable.kind() != expected {
                let (name, found) = (variable.name().to_owned(), variable.kind());
                return Err(Reason::WrongType { name, found, expected: expected.name() });
            }
            sum = sum.saturating_add(variable.len());
        }
        Ok(sum)
    }

    /// Checks an array of values, the argument of that name, against the elements of these variables.
    pub fn check_length(
        &self,
        references: &[u32],
        expected: usize,
        argument: &'static str,
        found: usize,
    ) -> Outcome<()> {
        if found == expected {
            return Ok(());
        }
        let shown = references.iter().take(3).filter_map(|reference| self.get(*reference));
        let mut variables: Vec<String> =
            shown.map(|variable| format!("{} ({})", variable.name(), variable.len())).collect();
        if references.len() > 3 {
            variables.push("...".to_owned());
        }
        let variables = if variables.is_empty() { "no variables".to_owned() } else { variables.join(", ") };
        Err(Reason::Length { argument, found, expected, variables })
    }
}

//! From a value reference to the model's variable and back: the flat view of a model's groups.
//!
//! The value reference of a variable is its 1-based position. One table entry of two bytes per
//! variable makes a look-up two loads, however many variables there are.

use super::model::Model;
use super::registry::{Access, Causality, Group, Variability};
use std::fmt::{self, Write};
use std::ops::Range;

/// How the same variables are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// `P[1]`, with Integers and Booleans (`variableNamingConvention="structured"`).
    Structured,
    /// `P_1`, all Real (a Boolean is true from 0.5 on): for tools that know nothing else (`"flat"`).
    Portable,
}

/// The FMI type of a variable.
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    Real,
    Integer,
    Boolean,
}

impl fmt::Display for Type {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Type::Real => "Real",
            Type::Integer => "Integer",
            Type::Boolean => "Boolean",
        })
    }
}

/// A value together with its type.
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    Real(f64),
    Integer(i32),
    Boolean(bool),
}

impl<M> Group<M> {
    /// The type of its variables.
    pub fn type_in(&self, interface: Interface) -> Type {
        match (&self.access, interface) {
            (Access::Real(..), _) | (_, Interface::Portable) => Type::Real,
            (Access::Integer(..), _) => Type::Integer,
            (Access::Boolean(..), _) => Type::Boolean,
        }
    }

    /// Number of its variables.
    pub fn len(&self) -> usize {
        self.count.unwrap_or(1)
    }

    /// Whether it has no variables at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Present value of the variable at this 0-based index.
    pub fn value(&self, model: &M, index: usize, interface: Interface) -> Value {
        match (&self.access, interface) {
            (Access::Real(get, _), _) => Value::Real(get(model, index)),
            (Access::Integer(get, _), Interface::Structured) => Value::Integer(get(model, index)),
            (Access::Integer(get, _), Interface::Portable) => Value::Real(f64::from(get(model, index))),
            (Access::Boolean(get, _), Interface::Structured) => Value::Boolean(get(model, index)),
            (Access::Boolean(get, _), Interface::Portable) => {
                Value::Real(if get(model, index) { 1.0 } else { 0.0 })
            }
        }
    }
}

/// A list of variables that no FMU could have. Says which group and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("variable group {group}: {problem}")]
pub struct RegistryError {
    /// The group's name.
    pub group: &'static str,
    /// What is wrong, and what was expected.
    pub problem: String,
}

/// All variables of a model.
pub struct Registry<M> {
    groups: Vec<Group<M>>,
    /// Value reference of each group's first variable.
    first: Vec<u32>,
    /// Group of each variable.
    group_of: Vec<u16>,
    /// Groups in the order of their names.
    by_name: Vec<u16>,
    /// How names and types are shown.
    pub interface: Interface,
}

impl<M: Model> Registry<M> {
    /// Checks the list of a freshly loaded model: names, legal combinations, start values in range.
    pub fn new(model: &M, interface: Interface) -> Result<Self, RegistryError> {
        let groups = model.variables();
        let mut first = Vec::with_capacity(groups.len());
        let mut group_of = Vec::new();
        for (number, group) in groups.iter().enumerate() {
            check(group, model)?;
            let problem = |text: &str| RegistryError { group: group.name, problem: text.to_owned() };
            let number = u16::try_from(number).map_err(|_| problem("expected at most 65535 groups"))?;
            let next = u32::try_from(group_of.len() + 1).map_err(|_| problem("too many variables"))?;
            if group_of.len().checked_add(group.len()).is_none_or(|n| n > i32::MAX as usize) {
                return Err(problem("expected at most 2147483647 variables in all"));
            }
            first.push(next);
            group_of.resize(group_of.len() + group.len(), number);
        }
        let mut by_name: Vec<u16> = (0..groups.len() as u16).collect();
        by_name.sort_by_key(|g| groups.get(usize::from(*g)).map(|group| group.name));
        let registry = Self { groups, first, group_of, by_name, interface };
        registry.check_names()?;
        Ok(registry)
    }

    /// Number of variables; the value references are 1 to this.
    pub fn len(&self) -> usize {
        self.group_of.len()
    }

    /// Whether there are no variables.
    pub fn is_empty(&self) -> bool {
        self.group_of.is_empty()
    }

    /// The groups, in order, each with the value reference of its first variable.
    pub fn groups(&self) -> impl ExactSizeIterator<Item = (u32, &Group<M>)> {
        self.first.iter().copied().zip(&self.groups)
    }

    /// Position of the group of a value reference among the groups.
    #[inline]
    pub(super) fn number_of(&self, reference: u32) -> Option<usize> {
        self.group_of.get((reference as usize).wrapping_sub(1)).map(|number| usize::from(*number))
    }

    /// The group at that position.
    #[inline]
    pub(super) fn numbered(&self, number: usize) -> Option<&Group<M>> {
        self.groups.get(number)
    }

    /// The group of this number, from 0, with the value reference of its first variable.
    pub(super) fn nth(&self, number: usize) -> Option<(u32, &Group<M>)> {
        Some((*self.first.get(number)?, self.groups.get(number)?))
    }

    /// Group and 0-based index of a value reference.
    #[inline]
    pub fn locate(&self, reference: u32) -> Option<(&Group<M>, usize)> {
        let number = self.number_of(reference)?;
        let (group, first) = (self.groups.get(number)?, self.first.get(number)?);
        Some((group, reference.wrapping_sub(*first) as usize))
    }

    /// Cuts an array of value references into runs of one group each, so that what depends on the group
    /// is looked at once per run. An unknown reference ends it with its position.
    pub(super) fn runs<'a>(&'a self, references: &'a [u32]) -> Runs<'a, M> {
        Runs { registry: self, references, position: 0 }
    }

    /// The group of this name, with the value reference of its first variable.
    pub fn group(&self, name: &str) -> Option<(u32, &Group<M>)> {
        let at = |g: &u16| self.groups.get(usize::from(*g));
        let position =
            self.by_name.binary_search_by(|g| at(g).map(|group| group.name).cmp(&Some(name))).ok()?;
        let number = usize::from(*self.by_name.get(position)?);
        Some((*self.first.get(number)?, self.groups.get(number)?))
    }

    /// The value reference of `name`, `name[i]` or, in the portable interface, `name_i`.
    pub fn reference(&self, name: &str) -> Option<u32> {
        if let Some((first, Group { count: None, .. })) = self.group(name) {
            return Some(first);
        }
        let (base, index) = match self.interface {
            Interface::Structured => name.strip_suffix(']')?.split_once('[')?,
            Interface::Portable => name.rsplit_once('_')?,
        };
        let (first, group) = self.group(base)?;
        let count = group.count?;
        // Only the canonical spelling: "1", not "01" or "+1".
        let number: usize = index.parse().ok()?;
        ((1..=count).contains(&number) && number.to_string() == index).then(|| first + (number - 1) as u32)
    }

    /// The name of a value reference.
    pub fn name(&self, reference: u32) -> Option<String> {
        let (group, index) = self.locate(reference)?;
        let mut name = String::new();
        self.write_name(&mut name, group, index);
        Some(name)
    }

    /// Appends the name of one variable.
    pub(super) fn write_name(&self, out: &mut String, group: &Group<M>, index: usize) {
        out.push_str(group.name);
        // Writing into a String cannot fail.
        let _ = match (group.count, self.interface) {
            (None, _) => Ok(()),
            (Some(_), Interface::Structured) => write!(out, "[{}]", index + 1),
            (Some(_), Interface::Portable) => write!(out, "_{}", index + 1),
        };
    }

    /// Names are unique in both interfaces.
    fn check_names(&self) -> Result<(), RegistryError> {
        for pair in self.by_name.windows(2) {
            let names = pair.iter().map(|g| self.groups.get(usize::from(*g)).map(|group| group.name));
            let names: Vec<&'static str> = names.flatten().collect();
            if let [a, b] = names[..]
                && a == b
            {
                return Err(RegistryError {
                    group: a,
                    problem: "appears twice; expected unique names".into(),
                });
            }
        }
        for group in self.groups.iter().filter(|group| group.count.is_none()) {
            let Some((base, index)) = group.name.rsplit_once('_') else { continue };
            let clash = self.group(base).and_then(|(_, other)| other.count).zip(index.parse::<usize>().ok());
            if clash.is_some_and(|(count, number)| (1..=count).contains(&number)) {
                let problem = format!("is also the portable name of {base}[{index}]; expected unique names");
                return Err(RegistryError { group: group.name, problem });
            }
        }
        Ok(())
    }
}

/// Neighbouring value references of one group.
pub(super) struct Run<'a, M> {
    pub group: &'a Group<M>,
    /// Value reference of the group's first variable.
    pub first: u32,
    pub references: &'a [u32],
    /// Position of the first of them in the whole array.
    pub position: usize,
    /// Whether each is one more than that before.
    is_straight: bool,
}

impl<M> Run<'_, M> {
    /// The values of these variables out of those of the whole array.
    #[inline]
    pub fn values<'v>(&self, values: &'v [f64]) -> &'v [f64] {
        values.get(self.position..self.position + self.references.len()).unwrap_or_default()
    }

    /// The same to be written.
    #[inline]
    pub fn values_mut<'v>(&self, values: &'v mut [f64]) -> &'v mut [f64] {
        values.get_mut(self.position..self.position + self.references.len()).unwrap_or_default()
    }

    /// 0-based indices within the group.
    #[inline]
    pub fn indices(&self) -> impl Iterator<Item = usize> {
        self.references.iter().map(|reference| reference.wrapping_sub(self.first) as usize)
    }

    /// The indices as a range, where each is one more than that before.
    #[inline]
    pub fn range(&self) -> Option<Range<usize>> {
        let from = self.references.first()?.wrapping_sub(self.first) as usize;
        let is_straight = self.is_straight || self.references.len() == 1;
        is_straight.then(|| from..from + self.references.len())
    }
}

/// See [`Registry::runs`].
pub(super) struct Runs<'a, M> {
    registry: &'a Registry<M>,
    references: &'a [u32],
    position: usize,
}

impl<'a, M: Model> Iterator for Runs<'a, M> {
    type Item = Result<Run<'a, M>, usize>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.references.get(self.position..)?;
        let head = *rest.first()?;
        let Some((group, index)) = self.registry.locate(head) else {
            let position = self.position;
            self.position = self.references.len();
            return Some(Err(position));
        };
        let first = head.wrapping_sub(index as u32);
        // Mostly they count up, which is found out with one comparison for each.
        let room = rest.get(..rest.len().min(group.len().saturating_sub(index))).unwrap_or_default();
        let mut length = room.iter().zip(head..).take_while(|(found, next)| **found == *next).count();
        let is_straight = length > 1 || rest.len() == 1;
        if !is_straight {
            let belongs = |reference: &&u32| (reference.wrapping_sub(first) as usize) < group.len();
            length = rest.iter().take_while(belongs).count();
        }
        let position = self.position;
        self.position += length;
        rest.get(..length).map(|references| Ok(Run { group, first, references, position, is_straight }))
    }
}

/// What the standard demands of one group.
fn check<M: Model>(group: &Group<M>, model: &M) -> Result<(), RegistryError> {
    let refuse = |problem: String| Err(RegistryError { group: group.name, problem });
    let mut letters = group.name.chars();
    let head = letters.next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    if !head || !letters.all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return refuse("is no C identifier".into());
    }
    let settable = match &group.access {
        Access::Real(_, set) => set.is_some(),
        Access::Integer(_, set) => set.is_some(),
        Access::Boolean(_, set) => set.is_some(),
    };
    let real = matches!(group.access, Access::Real(..));
    let legal = match group.causality {
        Causality::Parameter => matches!(group.variability, Variability::Fixed | Variability::Tunable),
        Causality::Input | Causality::Output => match group.variability {
            Variability::Continuous => real,
            Variability::Discrete => true,
            Variability::Fixed | Variability::Tunable => false,
        },
    };
    if !legal {
        let found = (group.causality, group.variability);
        return refuse(format!("{found:?} is no legal combination for its type (FMI 2.0.1, section 2.2.7)"));
    }
    if settable == (group.causality == Causality::Output) {
        return refuse("expected a set function for inputs and parameters, and none for outputs".into());
    }
    if group.causality == Causality::Output {
        return Ok(());
    }
    for index in 0..group.len() {
        let start = match group.value(model, index, Interface::Structured) {
            Value::Real(value) => value,
            Value::Integer(value) => f64::from(value),
            Value::Boolean(_) => continue,
        };
        if !group.range.contains(start) {
            return refuse(format!("start value {start:?} at [{}]; expected {}", index + 1, group.range));
        }
    }
    Ok(())
}

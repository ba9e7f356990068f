//! Getting and setting variables, arrays whole: everything about a call is checked before the first value moves. Nothing
//! here allocates unless a call is refused or sets sizes or arrays of the model's shape.

use super::call_order::Function;
use super::error::{Outcome, Reason};
use super::instance::{Instance, Scratch};
use super::table::{Table, Type, Variable};
use crate::fmi::instance::Instance as Common;
use crate::fmi::model::Model;
use crate::fmi::registry::Causality;
use crate::fmi::shape::Values;

/// The FMI 2.0 value references of the elements of groups, one after the other.
pub(super) fn elements<'a, M: Model>(
    table: &Table<'_, M>,
    all: &'a [u32],
    some: &'a mut Vec<u32>,
    references: &[u32],
) -> &'a [u32] {
    let groups = references.iter().filter_map(|reference| match table.get(*reference) {
        Some(Variable::Group(first, group)) => {
            let first = first as usize - 1;
            Some(first..first + group.len())
        }
        _ => None,
    });
    let mut span = None;
    for range in groups.clone() {
        match &mut span {
            None => span = Some(range),
            Some(so_far) if so_far.end == range.start => so_far.end = range.end,
            Some(_) => {
                some.clear();
                groups.for_each(|range| some.extend_from_slice(all.get(range).unwrap_or_default()));
                return some;
            }
        }
    }
    span.and_then(|span| all.get(span)).unwrap_or_default()
}

/// What a call asks for beside groups.
#[derive(Default)]
struct Asked {
    others: bool,
    groups: bool,
    outputs: bool,
}

impl<M: Model> Instance<M> {
    /// fmi3GetFloat64.
    pub fn get_float64(&mut self, references: &[u32], values: &mut [f64]) -> Outcome<()> {
        self.get(Function::GetFloat64, Type::Float64, references, values, |inner, references, values| {
            Ok(inner.get_real(references, values)?)
        })
    }

    /// fmi3GetInt32.
    pub fn get_int32(&mut self, references: &[u32], values: &mut [i32]) -> Outcome<()> {
        self.get(Function::GetInt32, Type::Int32, references, values, |inner, references, values| {
            Ok(inner.get_integer(references, values)?)
        })
    }

    /// fmi3GetBoolean, into `bool` or into C's bytes.
    pub fn get_boolean<B: From<bool> + Element>(
        &mut self,
        references: &[u32],
        values: &mut [B],
    ) -> Outcome<()> {
        self.get(Function::GetBoolean, Type::Boolean, references, values, |inner, references, values| {
            Ok(inner.get_boolean(references, values)?)
        })
    }

    /// fmi3GetUInt64: sizes and whole numbers of the shape.
    pub fn get_uint64(&mut self, references: &[u32], values: &mut [u64]) -> Outcome<()> {
        self.get(Function::GetUInt64, Type::UInt64, references, values, |_, _, _| Ok(()))
    }

    /// fmi3SetFloat64.
    pub fn set_float64(&mut self, references: &[u32], values: &[f64]) -> Outcome<()> {
        self.set(Function::SetFloat64, Type::Float64, references, values, |inner, references, values| {
            Ok(inner.set_real(references, values)?)
        })
    }

    /// fmi3SetInt32.
    pub fn set_int32(&mut self, references: &[u32], values: &[i32]) -> Outcome<()> {
        self.set(Function::SetInt32, Type::Int32, references, values, |inner, references, values| {
            Ok(inner.set_integer(references, values)?)
        })
    }

    /// fmi3SetBoolean.
    pub fn set_boolean(&mut self, references: &[u32], values: &[bool]) -> Outcome<()> {
        self.set(Function::SetBoolean, Type::Boolean, references, values, |inner, references, values| {
            Ok(inner.set_boolean(references, values)?)
        })
    }

    /// The same from C's bytes: all but 0 is true.
    pub(super) fn set_boolean_bytes(&mut self, references: &[u32], values: &[u8]) -> Outcome<()> {
        self.set(Function::SetBoolean, Type::Boolean, references, values, |inner, references, values| {
            Ok(inner.set_boolean_from(references, values, |byte| byte != 0)?)
        })
    }

    /// fmi3SetUInt64: sizes in configuration mode, whole numbers of the shape before and during initialisation.
    pub fn set_uint64(&mut self, references: &[u32], values: &[u64]) -> Outcome<()> {
        self.set(Function::SetUInt64, Type::UInt64, references, values, |_, _, _| Ok(()))
    }

    /// A function of a type that no variable has.
    pub(super) fn refuse_type(&self, function: Function, references: &[u32]) -> Outcome<()> {
        self.allow(function)?;
        let Some(reference) = references.first() else { return Ok(()) };
        let variable = self.table().at(0, *reference)?;
        let expected = function.name().trim_start_matches("fmi3Get").trim_start_matches("fmi3Set");
        Err(Reason::WrongType { name: variable.name().to_owned(), found: variable.kind(), expected })
    }

    fn get<T: Element>(
        &mut self,
        function: Function,
        kind: Type,
        references: &[u32],
        values: &mut [T],
        read: impl FnOnce(&mut Common<M>, &[u32], &mut [T]) -> Outcome<()>,
    ) -> Outcome<()> {
        let asked = self.check(function, kind, references, values.len())?;
        let mut scratch = std::mem::take(&mut self.scratch);
        let done = self.read_with(&mut scratch, &asked, references, values, read);
        // Where the model has been built anew there is a new one.
        if self.scratch.all.is_empty() {
            self.scratch = scratch;
        }
        done
    }

    fn read_with<T: Element>(
        &mut self,
        Scratch { all, some: [some, _], .. }: &mut Scratch,
        asked: &Asked,
        references: &[u32],
        values: &mut [T],
        read: impl FnOnce(&mut Common<M>, &[u32], &mut [T]) -> Outcome<()>,
    ) -> Outcome<()> {
        let elements = elements(&self.table(), all, some, references);
        if asked.groups {
            // Not more than there is room for: what stands beside the model is in `values` too.
            let target = values.get_mut(..elements.len()).unwrap_or_default();
            // Sizes do not change here, so that value references stay what they are.
            if asked.outputs {
                self.on_built(|inner| read(inner, elements, target))?;
            } else {
                read(&mut self.inner, elements, target)?;
            }
        }
        if asked.others {
            self.distribute(references, elements.len(), values);
        }
        Ok(())
    }

    /// Puts the `read` values of the model, which stand in front, where they belong, and what stands beside it between
    /// them: from the back on, so that none is overwritten before it has moved.
    fn distribute<T: Element>(&self, references: &[u32], mut read: usize, values: &mut [T]) {
        let (table, mut end) = (self.table(), values.len());
        for variable in references.iter().rev().filter_map(|reference| table.get(*reference)) {
            let Some(begin) = end.checked_sub(variable.len()) else { return };
            if let Variable::Group(..) = variable {
                let Some(from) = read.checked_sub(variable.len()).filter(|_| read <= end) else { return };
                values.copy_within(from..read, begin);
                (read, end) = (from, begin);
                continue;
            }
            let places = values.get_mut(begin..end).unwrap_or_default();
            end = begin;
            match variable {
                Variable::Group(..) => {}
                Variable::Time => places.fill(T::of_real(self.time_s())),
                Variable::Size(_, size) => places.fill(T::of_number(size.value)),
                Variable::Array(_, array) => match &array.values {
                    Values::UInt64(found) => {
                        places.iter_mut().zip(found).for_each(|(place, value)| *place = T::of_number(*value));
                    }
                    Values::Float64(found) => {
                        places.iter_mut().zip(found).for_each(|(place, value)| *place = T::of_real(*value));
                    }
                },
            }
        }
    }

    fn set<T: Element>(
        &mut self,
        function: Function,
        kind: Type,
        references: &[u32],
        values: &[T],
        write: impl FnOnce(&mut Common<M>, &[u32], &[T]) -> Outcome<()>,
    ) -> Outcome<()> {
        let asked = self.check(function, kind, references, values.len())?;
        let mut apart = Vec::new();
        if asked.others {
            self.check_others(references, values, &mut apart)?;
        }
        if asked.groups {
            let mut scratch = std::mem::take(&mut self.scratch);
            let (all, some) = (&scratch.all, &mut scratch.some[0]);
            let elements = elements(&self.table(), all, some, references);
            let done = write(&mut self.inner, elements, if asked.others { &apart } else { values });
            self.scratch = scratch;
            done?;
        }
        if asked.others {
            self.take_others(references, values);
        }
        Ok(())
    }

    /// Checks what is set beside the model, and hands back what is set to the model.
    fn check_others<T: Element>(&self, references: &[u32], values: &[T], groups: &mut Vec<T>) -> Outcome<()> {
        let (table, mut values) = (self.table(), values);
        for variable in references.iter().filter_map(|reference| table.get(*reference)) {
            let (given, rest) = values.split_at_checked(variable.len()).unwrap_or((values, &[]));
            values = rest;
            let name = variable.name();
            let refused = |name: String, value: &T, expected| {
                Err(Reason::Value { name, found: value.to_string(), expected })
            };
            let not_now = |why| Err(Reason::NotSettable { name: name.to_owned(), why });
            match variable {
                Variable::Group(..) => groups.extend_from_slice(given),
                Variable::Time => return not_now("it is the independent variable"),
                Variable::Size(..) if !self.configuring => {
                    return not_now("it is a structural parameter; expected to be set in configuration mode");
                }
                Variable::Size(_, size) => {
                    for value in given {
                        if !(size.min..=size.max).contains(&value.number()) {
                            let range = match (size.min, size.max) {
                                (min, max) if min == max => min.to_string(),
                                (min, max) => format!("{min} to {max}"),
                            };
                            return refused(name.to_owned(), value, format!("{range}; {}", size.mend));
                        }
                    }
                }
                Variable::Array(_, array) => {
                    if !self.is_before_steps() {
                        return not_now(
                            "it is a fixed parameter; expected to be set before initialization ends",
                        );
                    }
                    let largest = self.shape().largest(array);
                    for (index, value) in given.iter().enumerate() {
                        let element = || format!("{name}[{}]", index + 1);
                        match array.values {
                            Values::UInt64(_) if value.number() > largest => {
                                return refused(element(), value, format!("0 to {largest}"));
                            }
                            Values::Float64(_) if !array.range.contains(value.real()) => {
                                return refused(element(), value, array.range.instead_of(value.real()));
                            }
                            _ => {}
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Takes over what has been checked.
    fn take_others<T: Element>(&mut self, references: &[u32], values: &[T]) {
        let (mut wanted, mut values) = (self.shape().clone(), values);
        for reference in references {
            let Some(variable) = self.table().get(*reference) else { continue };
            let (given, rest) = values.split_at_checked(variable.len()).unwrap_or((values, &[]));
            values = rest;
            match variable {
                Variable::Size(position, _) => {
                    given.iter().for_each(|value| wanted.resize(position, value.number()));
                }
                Variable::Array(position, _) => {
                    match wanted.arrays.get_mut(position).map(|a| &mut a.values) {
                        Some(Values::UInt64(places)) => {
                            places.iter_mut().zip(given).for_each(|(place, value)| *place = value.number());
                        }
                        Some(Values::Float64(places)) => {
                            places.iter_mut().zip(given).for_each(|(place, value)| *place = value.real());
                        }
                        None => {}
                    }
                }
                Variable::Time | Variable::Group(..) => {}
            }
        }
        // What is built from follows when it is needed: edges come in more than one call.
        self.wanted = Some(wanted);
        self.inner.life.stale = true;
    }

    fn is_before_steps(&self) -> bool {
        use super::call_order::State::{Configuration, Initialization, Instantiated};
        matches!(self.state(), Instantiated | Configuration | Initialization)
    }

    /// Checks call order, references, types and lengths.
    fn check(&self, function: Function, kind: Type, references: &[u32], values: usize) -> Outcome<Asked> {
        self.allow(function)?;
        let table = self.table();
        let elements = table.count(references, kind)?;
        let mut asked = Asked::default();
        for (position, reference) in references.iter().enumerate() {
            let variable = table.at(position, *reference)?;
            if self.configuring && !matches!(variable, Variable::Size(..)) {
                return Err(Reason::NotNow { name: variable.name().to_owned() });
            }
            match variable {
                Variable::Group(_, group) => {
                    asked.groups = true;
                    asked.outputs |= group.causality == Causality::Output;
                }
                _ => asked.others = true,
            }
        }
        table.check_length(references, elements, "nValues", values)?;
        Ok(asked)
    }
}

/// A value of an array that a caller hands over.
pub trait Element: Copy + Default + std::fmt::Display {
    /// A Real as this type; 0 where it is none.
    fn of_real(value: f64) -> Self;
    /// A whole number as this type; 0 where it is none.
    fn of_number(value: u64) -> Self;
    /// As a Real.
    fn real(self) -> f64;
    /// As a whole number.
    fn number(self) -> u64;
}

macro_rules! element {
    ($type:ty, $of_real:expr, $of_number:expr, $real:expr, $number:expr) => {
        impl Element for $type {
            fn of_real(value: f64) -> Self {
                $of_real(value)
            }
            fn of_number(value: u64) -> Self {
                $of_number(value)
            }
            fn real(self) -> f64 {
                $real(self)
            }
            fn number(self) -> u64 {
                $number(self)
            }
        }
    };
}

element!(f64, |value| value, |_| 0.0, |value| value, |_| 0);
element!(u64, |_| 0, |value| value, |_| 0.0, |value| value);
// There are no arrays of the shape of these types.
element!(i32, |_| 0, |_| 0, |_| 0.0, |_| 0);
element!(u8, |_| 0, |_| 0, |_| 0.0, |_| 0);
element!(bool, |_| false, |_| false, |_| 0.0, |_| 0);

//! What a model shows: groups of variables of one quantity. The model description, fmi2Get/Set and
//! the GUID all read the same list. A group is `name` when scalar and `name[1]` .. `name[count]` when
//! not; the value reference of a variable is its 1-based position over all groups.

use std::f64::consts::PI;
use std::fmt;

/// One quantity: a scalar, or one variable per agent, bus, ...
pub struct Group<M> {
    /// The quantity, a C identifier: `omega_set`.
    pub name: &'static str,
    /// What it is, for a person.
    pub description: &'static str,
    /// Its unit; a Real without one has [`Unit::One`].
    pub unit: Option<Unit>,
    /// Number of variables, or `None` for a scalar.
    pub count: Option<usize>,
    /// Name of the [`Size`](super::shape::Size) that is this number, if the model can be built with another.
    pub size: Option<&'static str>,
    /// Who sets it.
    pub causality: Causality,
    /// When it may change.
    pub variability: Variability,
    /// How it is read and set; the type of the variable.
    pub access: Access<M>,
    /// What is accepted; values outside are refused by name.
    pub range: Range,
    /// For outputs: the inputs that they follow within a step.
    pub dependencies: Dependencies<M>,
    /// For Reals: where they stand one after the other, so that a call moves them together.
    pub row: Row<M>,
}

/// The values of a whole group in their order, where the model keeps them so; else `None`, and the functions of
/// [`Access`] do it one by one.
pub struct Row<M> {
    /// To be read.
    pub get: fn(&M) -> Option<&[f64]>,
    /// To be set.
    pub set: fn(&mut M) -> Option<&mut [f64]>,
}

impl<M> Row<M> {
    /// Not kept so.
    pub const NONE: Row<M> = Row { get: |_| None, set: |_| None };
}

impl<M> Group<M> {
    /// Reads the variables of these 0-based indices at once; false, and nothing read, where they are not kept so or
    /// the lengths differ.
    #[inline]
    pub(super) fn read_row(&self, model: &M, indices: std::ops::Range<usize>, values: &mut [f64]) -> bool {
        let row = (self.row.get)(model).and_then(|row| row.get(indices));
        let row = row.filter(|row| row.len() == values.len());
        row.map(|row| values.copy_from_slice(row)).is_some()
    }

    /// Sets them alike.
    #[inline]
    pub(super) fn write_row(&self, model: &mut M, indices: std::ops::Range<usize>, values: &[f64]) -> bool {
        let row = (self.row.set)(model).and_then(|row| row.get_mut(indices));
        let row = row.filter(|row| row.len() == values.len());
        row.map(|row| row.copy_from_slice(values)).is_some()
    }
}

/// Read and set functions; the index counts from 0 within the group (0 for a scalar).
pub enum Access<M> {
    /// fmi2Real.
    Real(fn(&M, usize) -> f64, Option<fn(&mut M, usize, f64)>),
    /// fmi2Integer.
    Integer(fn(&M, usize) -> i32, Option<fn(&mut M, usize, i32)>),
    /// fmi2Boolean.
    Boolean(fn(&M, usize) -> bool, Option<fn(&mut M, usize, bool)>),
}

/// FMI causality, as far as it is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Set by the master at every communication point.
    Input,
    /// Read by the master.
    Output,
    /// Set before, or with variability tunable also during, the simulation.
    Parameter,
}

/// FMI variability, as far as it is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variability {
    /// Set until initialisation ends.
    Fixed,
    /// A parameter that may be set between steps.
    Tunable,
    /// Changes at communication points only.
    Discrete,
    /// Real only.
    Continuous,
}

/// Accepted values: finite always; for Reals and Integers within these bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower bound.
    pub min: f64,
    /// Whether `min` itself is refused.
    pub min_excluded: bool,
    /// Upper bound, accepted.
    pub max: f64,
}

impl Range {
    /// Any value that a quantity can have.
    pub const ANY: Range = Range { min: f64::NEG_INFINITY, min_excluded: false, max: f64::INFINITY };
    /// Greater than zero.
    pub const POSITIVE: Range = Range { min: 0.0, min_excluded: true, max: f64::INFINITY };
    /// Of a Boolean: false only, because the model has nothing to switch on.
    pub const FALSE: Range = Range { min: 0.0, min_excluded: false, max: 0.0 };
    /// Zero or greater.
    pub const NOT_NEGATIVE: Range = Range { min: 0.0, min_excluded: false, max: f64::INFINITY };

    /// Numbers beyond this are a mistake like an infinite one: products of a few of them overflow, and what is no
    /// number spreads through a model for good.
    pub const LARGEST: f64 = 1e30;
    /// Where 0 itself is excluded, so is what is nearer to it than this and cannot be divided by.
    pub const SMALLEST: f64 = 1e-30;

    /// Whether a value is accepted: within the bounds and at most [`Self::LARGEST`] in size.
    #[inline]
    pub fn contains(&self, value: f64) -> bool {
        let above = if self.min_excluded { value - self.min >= Self::SMALLEST } else { value >= self.min };
        above && value <= self.max && value.abs() <= Self::LARGEST
    }

    /// Whether all of them are.
    #[inline]
    pub(super) fn contain(&self, values: &[f64]) -> bool {
        if self.is_open() {
            Self::all_sound(values)
        } else {
            values.iter().all(|value| self.contains(*value))
        }
    }

    /// Whether there are no bounds but those of every number.
    #[inline]
    pub(super) fn is_open(&self) -> bool {
        self.min == f64::NEG_INFINITY && self.max == f64::INFINITY
    }

    /// [`Self::contain`] of a range without bounds.
    #[inline]
    pub(super) fn all_sound(values: &[f64]) -> bool {
        const SIZE: u64 = i64::MAX as u64;
        // Bits of sizes are in the order of sizes, those of infinity and of what is no number beyond all. Whatever is
        // too large carries into the sign, which every processor does side by side.
        let carry = SIZE - Self::LARGEST.to_bits();
        let all = values.iter().fold(0, |all, value| all | ((value.to_bits() & SIZE) + carry));
        all <= SIZE
    }
}

impl Range {
    /// What to expect instead of a value that is refused, for an error message.
    pub(super) fn instead_of(&self, found: f64) -> String {
        let largest = Self::LARGEST;
        if found.is_finite() && found.abs() > largest {
            format!("{self}, at most {largest:e} in size")
        } else if self.min_excluded && found > self.min && found <= self.max {
            format!("{self}, by at least {:e}", Self::SMALLEST)
        } else {
            self.to_string()
        }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a finite value")?;
        if self.min > f64::NEG_INFINITY {
            write!(f, " {} {}", if self.min_excluded { ">" } else { ">=" }, self.min)?;
        }
        if self.max < f64::INFINITY {
            write!(f, "{} <= {}", if self.min > f64::NEG_INFINITY { " and" } else { "" }, self.max)?;
        }
        Ok(())
    }
}

/// Units of the interface, per unit being dimensionless; each is written with its SI base units into the model description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A pure number.
    One,
    /// Per unit of the system base: dimensionless.
    PerUnit,
    /// Per unit times hour: an energy on a power base.
    PerUnitHour,
    /// Per unit per second.
    PerUnitPerSecond,
    /// Per second.
    PerSecond,
    /// Second.
    Second,
    /// Radian.
    Radian,
    /// Radian per second.
    RadianPerSecond,
}

impl Unit {
    /// All units.
    pub const ALL: [Unit; 8] = [
        Unit::One,
        Unit::PerUnit,
        Unit::PerUnitHour,
        Unit::PerUnitPerSecond,
        Unit::PerSecond,
        Unit::Second,
        Unit::Radian,
        Unit::RadianPerSecond,
    ];

    /// Its name in the model description.
    pub fn name(self) -> &'static str {
        match self {
            Unit::One => "1",
            Unit::PerUnit => "pu",
            Unit::PerUnitHour => "pu.h",
            Unit::PerUnitPerSecond => "pu/s",
            Unit::PerSecond => "1/s",
            Unit::Second => "s",
            Unit::Radian => "rad",
            Unit::RadianPerSecond => "rad/s",
        }
    }

    /// Attributes of its `BaseUnit`: exponents of the SI base units and the factor to them.
    pub(super) fn base_attributes(self) -> &'static str {
        match self {
            Unit::One | Unit::PerUnit => "",
            Unit::PerUnitHour => r#" s="1" factor="3600.0""#,
            Unit::PerUnitPerSecond | Unit::PerSecond => r#" s="-1""#,
            Unit::Second => r#" s="1""#,
            Unit::Radian => r#" rad="1""#,
            Unit::RadianPerSecond => r#" s="-1" rad="1""#,
        }
    }

    /// The unit in which people read it, and how many of those one is.
    pub(super) fn display(self) -> Option<(&'static str, f64)> {
        match self {
            Unit::Radian => Some(("deg", 180.0 / PI)),
            Unit::RadianPerSecond => Some(("Hz", 0.5 / PI)),
            _ => None,
        }
    }
}

/// The inputs that an output follows within a step (`ModelStructure/Outputs/dependencies`).
pub enum Dependencies<M> {
    /// None: the output is sampled, or a state.
    None,
    /// The variables of the same index in these groups; whole scalars.
    SameIndex(&'static [&'static str]),
    /// All variables of these groups.
    All(&'static [&'static str]),
    /// What this function names for the variable of that index: (group, 0-based index).
    Of(fn(&M, usize) -> Vec<(&'static str, usize)>),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_unsound_value_is_found_wherever_it_stands() {
        let sound = [0.0, -0.0, 5e-324, -1.0, Range::LARGEST, -Range::LARGEST];
        let beyond = Range::LARGEST.next_up();
        for n in 0..20 {
            let values: Vec<f64> = (0..n).map(|k| sound[k % sound.len()]).collect();
            assert!(Range::all_sound(&values));
            for unsound in [beyond, -beyond, f64::MAX, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, -f64::NAN]
            {
                for place in 0..n {
                    let mut values = values.clone();
                    values[place] = unsound;
                    assert!(!Range::all_sound(&values), "{unsound} at {place} of {n}");
                }
            }
        }
    }
}

//! What a model is built from beside its resources: the sizes of its arrays, and arrays such as the edges of a
//! graph. FMI 3.0 shows sizes as structural parameters and the arrays as fixed parameters; FMI 2.0 shows neither.
//! Knows nothing of what they mean.

use super::registry::{Range, Unit};
use serde::{Deserialize, Serialize};

/// The length of some of a model's arrays.
#[derive(Clone, Debug, PartialEq)]
pub struct Size {
    /// A C identifier: `n`.
    pub name: &'static str,
    /// What it counts, for a person.
    pub description: &'static str,
    /// Present value.
    pub value: u64,
    /// Least accepted value.
    pub min: u64,
    /// Largest accepted value.
    pub max: u64,
    /// What to do instead where a value is refused.
    pub mend: &'static str,
}

/// An array that a model is built from.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// A C identifier: `edge_from`.
    pub name: &'static str,
    /// What it is, for a person.
    pub description: &'static str,
    /// Its unit, of Reals.
    pub unit: Option<Unit>,
    /// Name of the [`Size`] that is its length.
    pub size: &'static str,
    /// Name of the [`Size`] that no whole number in it exceeds.
    pub at_most: Option<&'static str>,
    /// What is accepted of Reals.
    pub range: Range,
    /// Present values; all 0 unless set.
    pub values: Values,
}

/// Values of one type.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// Whole numbers.
    UInt64(Vec<u64>),
    /// Reals.
    Float64(Vec<f64>),
}

impl Values {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Values::UInt64(values) => values.len(),
            Values::Float64(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// As many zeros of the same type.
    fn zeros(&self, length: usize) -> Self {
        match self {
            Values::UInt64(_) => Values::UInt64(vec![0; length]),
            Values::Float64(_) => Values::Float64(vec![0.0; length]),
        }
    }
}

/// All sizes and arrays of a model, always in the same order; an array is as long as its size says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// The sizes.
    pub sizes: Vec<Size>,
    /// The arrays.
    pub arrays: Vec<Array>,
}

/// The values of a shape without their names: what an FMU state holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct ShapeValues {
    sizes: Vec<u64>,
    arrays: Vec<Values>,
}

impl Shape {
    /// The size of this name.
    pub fn size(&self, name: &str) -> Option<u64> {
        self.sizes.iter().find(|size| size.name == name).map(|size| size.value)
    }

    /// The whole numbers of this name.
    pub fn numbers(&self, name: &str) -> &[u64] {
        match self.arrays.iter().find(|array| array.name == name).map(|array| &array.values) {
            Some(Values::UInt64(values)) => values,
            _ => &[],
        }
    }

    /// The Reals of this name.
    pub fn reals(&self, name: &str) -> &[f64] {
        match self.arrays.iter().find(|array| array.name == name).map(|array| &array.values) {
            Some(Values::Float64(values)) => values,
            _ => &[],
        }
    }

    /// Whether arrays are as long as those of `other`.
    pub(super) fn has_sizes_of(&self, other: &Shape) -> bool {
        self.sizes.iter().map(|size| size.value).eq(other.sizes.iter().map(|size| size.value))
    }

    /// Sets an accepted value of the size at this position; arrays of another length are zeros from then on, and so are
    /// those beside a whole number that has become too large.
    pub(super) fn resize(&mut self, position: usize, value: u64) {
        let Some(size) = self.sizes.get_mut(position) else { return };
        size.value = value;
        let (changed, length) = (size.name, usize::try_from(value).unwrap_or(usize::MAX));
        for array in self.arrays.iter_mut().filter(|array| array.size == changed) {
            if array.values.len() != length {
                array.values = array.values.zeros(length);
            }
        }
        let exceeds = |array: &&Array| {
            array.at_most == Some(changed)
                && matches!(&array.values, Values::UInt64(numbers) if numbers.iter().any(|number| *number > value))
        };
        // Edge columns go together: half an edge is none.
        while let Some(rows) = self.arrays.iter().find(exceeds).map(|array| array.size) {
            for array in self.arrays.iter_mut().filter(|array| array.size == rows) {
                array.values = array.values.zeros(array.values.len());
            }
        }
    }

    /// The largest accepted whole number in an array.
    pub(super) fn largest(&self, array: &Array) -> u64 {
        array.at_most.and_then(|name| self.size(name)).unwrap_or(u64::MAX)
    }

    /// The values alone.
    pub(super) fn values(&self) -> ShapeValues {
        ShapeValues {
            sizes: self.sizes.iter().map(|size| size.value).collect(),
            arrays: self.arrays.iter().map(|array| array.values.clone()).collect(),
        }
    }

    /// The same shape with other values, if they can be its: perhaps they come from a file.
    pub(super) fn with(&self, values: &ShapeValues) -> Option<Shape> {
        let mut shape = self.clone();
        if shape.sizes.len() != values.sizes.len() || shape.arrays.len() != values.arrays.len() {
            return None;
        }
        for (size, value) in shape.sizes.iter_mut().zip(&values.sizes) {
            if !(size.min..=size.max).contains(value) {
                return None;
            }
            size.value = *value;
        }
        for position in 0..shape.arrays.len() {
            let array = shape.arrays.get(position)?;
            let (found, largest) = (values.arrays.get(position)?, shape.largest(array));
            let fits = match (found, &array.values) {
                (Values::UInt64(found), Values::UInt64(_)) => found.iter().all(|value| *value <= largest),
                (Values::Float64(found), Values::Float64(_)) => {
                    found.iter().all(|value| array.range.contains(*value))
                }
                _ => false,
            };
            if !fits || shape.size(array.size) != Some(found.len() as u64) {
                return None;
            }
            shape.arrays.get_mut(position)?.values = found.clone();
        }
        Some(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape() -> Shape {
        let size = |name, value, min, max| Size { name, description: "", value, min, max, mend: "" };
        let array = |name, size, at_most, values| Array {
            name,
            description: "",
            unit: None,
            size,
            at_most,
            range: Range::NOT_NEGATIVE,
            values,
        };
        Shape {
            sizes: vec![size("n", 3, 1, 10), size("m", 1, 0, 10)],
            arrays: vec![
                array("from", "m", Some("n"), Values::UInt64(vec![2])),
                array("weight", "n", None, Values::Float64(vec![1.0, 2.0, 3.0])),
                array("length", "m", None, Values::Float64(vec![5.0])),
            ],
        }
    }

    #[test]
    fn a_new_size_zeroes_the_arrays_of_that_size_alone() {
        let mut changed = shape();
        changed.resize(0, 2);
        assert_eq!(changed.reals("weight"), [0.0, 0.0]);
        assert_eq!(changed.numbers("from"), [2]);
        assert_eq!(shape().with(&changed.values()), Some(changed.clone()));
        assert!(!changed.has_sizes_of(&shape()));
    }

    #[test]
    fn what_names_more_than_there_are_is_zeroed_with_what_stands_beside_it() {
        let mut changed = shape();
        changed.resize(0, 1);
        assert_eq!((changed.numbers("from"), changed.reals("length")), (&[0][..], &[0.0][..]));
        assert_eq!(shape().with(&changed.values()), Some(changed));
    }

    #[test]
    fn values_come_back_and_wrong_ones_are_turned_away() {
        let shape = shape();
        let values = shape.values();
        assert_eq!(shape.with(&values), Some(shape.clone()));
        for spoil in [
            (|v: &mut ShapeValues| v.sizes[0] = 11) as fn(&mut ShapeValues),
            |v| v.sizes[0] = 2,
            |v| v.sizes[1] = u64::MAX,
            |v| v.arrays[0] = Values::UInt64(vec![4]),
            |v| v.arrays[0] = Values::Float64(vec![1.0]),
            |v| v.arrays[1] = Values::Float64(vec![1.0, -1.0, 0.0]),
            |v| v.arrays[1] = Values::Float64(vec![1.0, f64::NAN, 0.0]),
            |v| v.arrays.truncate(1),
            |v| v.sizes.push(1),
        ] {
            let mut spoilt = values.clone();
            spoil(&mut spoilt);
            assert_eq!(shape.with(&spoilt), None, "{spoilt:?}");
        }
    }
}

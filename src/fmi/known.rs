//! Arrays of value references that were asked for before. Masters pass the same few arrays in every step; what they
//! are is then found out once. Never decides what a call may do: only finds again what was decided.

use super::lookup::Registry;
use super::model::Model;
use super::registry::{Causality, Dependencies, Variability};
use std::ops::Range;

/// Arrays kept for each function: those of a master, one for each quantity perhaps, and of the others that look on.
const KEPT: usize = 8;
/// The longest array kept, and the most stretches in it: room is made once, so that no call allocates. What a longer
/// one costs is in its values.
const LONGEST: usize = 512;
const STRETCHES: usize = 32;

/// Arrays of Reals of one function.
pub(super) struct Known {
    arrays: [Array; KEPT],
    /// Which is to be replaced next.
    next: usize,
}

/// One array, all of its variables being Real.
pub(super) struct Array {
    references: Vec<u32>,
    /// What it consists of.
    pub stretches: Vec<Stretch>,
    /// Whether there is an output in it, and one that follows inputs within a step.
    pub has_output: bool,
    pub has_follower: bool,
    /// Whether there is a parameter in it that is fixed when initialisation ends.
    pub has_fixed: bool,
    /// Whether there is a variable with bounds of its own in it.
    pub has_bounds: bool,
}

/// Neighbouring variables of one group.
pub(super) struct Stretch {
    /// Position of the group in the registry.
    pub group: usize,
    /// 0-based indices within the group.
    pub indices: Range<usize>,
    /// Places of their values in the array.
    pub places: Range<usize>,
}

impl Default for Known {
    fn default() -> Self {
        Self { arrays: std::array::from_fn(|_| Array::empty()), next: 0 }
    }
}

impl Known {
    /// The array of exactly these references.
    #[inline]
    pub fn find(&self, references: &[u32]) -> Option<&Array> {
        self.arrays.iter().find(|array| array.references == references && !references.is_empty())
    }

    /// Keeps an array that a call was just answered for, if it is short and consists of neighbours. Single variables are
    /// no arrays: who asks for one after the other would drive all arrays out.
    pub fn keep<M: Model>(&mut self, registry: &Registry<M>, references: &[u32]) {
        let Some(array) = self.arrays.get_mut(self.next) else { return };
        if references.len() < 2 || references.len() > LONGEST {
            return;
        }
        if array.set(registry, references).is_some() {
            self.next = (self.next + 1) % KEPT;
        } else {
            array.references.clear();
        }
    }
}

impl Array {
    fn empty() -> Self {
        Self {
            references: Vec::with_capacity(LONGEST),
            stretches: Vec::with_capacity(STRETCHES),
            has_output: false,
            has_follower: false,
            has_fixed: false,
            has_bounds: false,
        }
    }

    fn set<M: Model>(&mut self, registry: &Registry<M>, references: &[u32]) -> Option<()> {
        self.references.clear();
        self.stretches.clear();
        (self.has_output, self.has_follower) = (false, false);
        (self.has_fixed, self.has_bounds) = (false, false);
        for run in registry.runs(references) {
            let run = run.ok()?;
            let (group, indices) = (run.group, run.range()?);
            let is_output = group.causality == Causality::Output;
            self.has_output |= is_output;
            self.has_follower |= is_output && !matches!(group.dependencies, Dependencies::None);
            self.has_fixed |=
                group.causality == Causality::Parameter && group.variability == Variability::Fixed;
            self.has_bounds |= !group.range.is_open();
            if self.stretches.len() == STRETCHES {
                return None;
            }
            let places = run.position..run.position + indices.len();
            let group = registry.number_of(*run.references.first()?)?;
            self.stretches.push(Stretch { group, indices, places });
        }
        self.references.extend_from_slice(references);
        Some(())
    }
}

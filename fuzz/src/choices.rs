//! A string of bytes read as choices: what a coverage-guided fuzzer mutates and a seeded run draws. Every string is
//! a legal one; where it ends, so does the sequence of calls.

use arbitrary::{Arbitrary, Unstructured};
use bess_consensus::fmi::Range;

/// The rest of the bytes.
pub struct Choices<'a> {
    bytes: Unstructured<'a>,
    /// Whether finite values stay where a plant could be.
    pub tame: bool,
}

/// Numbers at which arithmetic breaks.
const WILD: [f64; 16] = [
    0.0,
    -0.0,
    f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    1e-160,
    1e-9,
    1e9,
    -1e9,
    1e18,
    1e100,
    -1e100,
    1e160,
    1e300,
    f64::MAX,
    f64::MIN,
];

impl<'a> Choices<'a> {
    /// Choices out of these bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes: Unstructured::new(bytes), tame: true }
    }

    /// Whether there is nothing left to choose from.
    pub fn is_over(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Any value of a type.
    pub fn any<T: Arbitrary<'a> + Default>(&mut self) -> T {
        self.bytes.arbitrary().unwrap_or_default()
    }

    /// A number below `n`, 0 when there is none.
    pub fn below(&mut self, n: usize) -> usize {
        self.bytes.int_in_range(0..=n.max(1) - 1).unwrap_or(0)
    }

    /// True once in `n` times.
    pub fn once_in(&mut self, n: usize) -> bool {
        self.below(n) == n - 1
    }

    /// One of these.
    pub fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }

    /// An index, each with its weight.
    pub fn weighted(&mut self, weights: &[u32]) -> usize {
        let sum: u32 = weights.iter().sum();
        let mut left = self.below(sum as usize) as u32;
        weights
            .iter()
            .position(|&w| {
                if left < w {
                    true
                } else {
                    left -= w;
                    false
                }
            })
            .unwrap_or(0)
    }

    /// Not a number, or infinite.
    pub fn not_finite(&mut self) -> f64 {
        self.of(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -f64::NAN])
    }

    /// Now and then a number that nobody can mean, else one that suits `range` near `about`.
    pub fn real(&mut self, range: &Range, about: f64) -> f64 {
        if self.once_in(48) {
            return match self.below(4) {
                0 => range.min.next_down(),
                1 if range.min_excluded => range.min,
                2 if range.max < f64::INFINITY => range.max.next_up(),
                _ => self.not_finite(),
            };
        }
        if !self.tame && self.once_in(4) {
            return match self.below(3) {
                0 => f64::from_bits(self.any()),
                _ => self.of(&WILD),
            };
        }
        let share = f64::from(self.any::<i16>()) / 32768.0;
        let value = if about == 0.0 { 0.1 * share } else { about * (1.0 + 0.02 * share) };
        if range.contains(value) { value } else { about }
    }
}

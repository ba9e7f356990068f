//! What an entry of a sparse matrix can be: a complex number (network equations) or a real 2 x 2 block
//! (the two equations of a bus in the power flow). Blocks spare three of four indices and let a bus
//! pivot within itself.

use faer::c64;
use faer::traits::ComplexField;

/// An entry of a sparse matrix, with the vector that it acts on.
pub trait Block: Copy + Send + Sync + 'static {
    /// What the entry acts on.
    type Vector: Copy + Send + Sync + 'static;
    /// What the entry is made of.
    type Scalar: ComplexField + Copy;

    /// Rows and columns of the entry.
    const SIZE: usize;
    /// The entry 0.
    const ZERO: Self;
    /// The vector 0.
    const ZERO_VECTOR: Self::Vector;

    /// `self -= a b`.
    fn subtract_product(&mut self, a: &Self, b: &Self);
    /// `self b`.
    fn times(&self, b: &Self) -> Self;
    /// The inverse; not finite when there is none.
    fn inverse(&self) -> Self;
    /// Whether every number in it is finite.
    fn is_finite(&self) -> bool;
    /// `self x`.
    fn apply(&self, x: Self::Vector) -> Self::Vector;
    /// `y - self x`.
    fn residual(&self, y: Self::Vector, x: Self::Vector) -> Self::Vector;
    /// The scalar in this row and column, both below `SIZE`.
    fn entry(&self, row: usize, column: usize) -> Self::Scalar;
    /// The largest magnitude in it, up to a factor of 2.
    fn size(&self) -> f64;
    /// The same of a vector.
    fn vector_size(x: Self::Vector) -> f64;
    /// A vector's scalars, written to `out`, which holds `SIZE` of them.
    fn unpack(x: Self::Vector, out: &mut [Self::Scalar]);
    /// The vector of these scalars.
    fn pack(scalars: &[Self::Scalar]) -> Self::Vector;
    /// A vector without symmetry for a test solve, from a number.
    fn probe(k: usize) -> Self::Vector;
}

impl Block for c64 {
    type Vector = c64;
    type Scalar = c64;
    const SIZE: usize = 1;
    const ZERO: Self = c64::ZERO;
    const ZERO_VECTOR: Self = c64::ZERO;

    #[inline]
    fn subtract_product(&mut self, a: &Self, b: &Self) {
        self.re -= a.re * b.re - a.im * b.im;
        self.im -= a.re * b.im + a.im * b.re;
    }

    #[inline]
    fn times(&self, b: &Self) -> Self {
        self * b
    }

    #[inline]
    fn inverse(&self) -> Self {
        self.inv()
    }

    #[inline]
    fn is_finite(&self) -> bool {
        self.re.is_finite() && self.im.is_finite()
    }

    #[inline]
    fn apply(&self, x: c64) -> c64 {
        self * x
    }

    #[inline]
    fn residual(&self, y: c64, x: c64) -> c64 {
        c64::new(y.re - (self.re * x.re - self.im * x.im), y.im - (self.re * x.im + self.im * x.re))
    }

    fn entry(&self, _row: usize, _column: usize) -> c64 {
        *self
    }

    fn size(&self) -> f64 {
        self.re.abs() + self.im.abs()
    }

    fn vector_size(x: c64) -> f64 {
        x.re.abs() + x.im.abs()
    }

    fn unpack(x: c64, out: &mut [c64]) {
        out[0] = x;
    }

    fn pack(scalars: &[c64]) -> c64 {
        scalars[0]
    }

    fn probe(k: usize) -> c64 {
        c64::new(uneven(k), uneven(k + 7919))
    }
}

/// A real 2 x 2 block, row after row.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(16))]
pub struct Real2(pub [f64; 4]);

impl Block for Real2 {
    type Vector = [f64; 2];
    type Scalar = f64;
    const SIZE: usize = 2;
    const ZERO: Self = Self([0.0; 4]);
    const ZERO_VECTOR: [f64; 2] = [0.0; 2];

    #[inline]
    fn subtract_product(&mut self, a: &Self, b: &Self) {
        let (a, b, c) = (&a.0, &b.0, &mut self.0);
        c[0] -= a[0] * b[0] + a[1] * b[2];
        c[1] -= a[0] * b[1] + a[1] * b[3];
        c[2] -= a[2] * b[0] + a[3] * b[2];
        c[3] -= a[2] * b[1] + a[3] * b[3];
    }

    #[inline]
    fn times(&self, b: &Self) -> Self {
        let (a, b) = (&self.0, &b.0);
        Self([
            a[0] * b[0] + a[1] * b[2],
            a[0] * b[1] + a[1] * b[3],
            a[2] * b[0] + a[3] * b[2],
            a[2] * b[1] + a[3] * b[3],
        ])
    }

    #[inline]
    fn inverse(&self) -> Self {
        let [a, b, c, d] = self.0;
        let scale = 1.0 / (a * d - b * c);
        Self([d * scale, -b * scale, -c * scale, a * scale])
    }

    #[inline]
    fn is_finite(&self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }

    #[inline]
    fn apply(&self, x: [f64; 2]) -> [f64; 2] {
        let a = &self.0;
        [a[0] * x[0] + a[1] * x[1], a[2] * x[0] + a[3] * x[1]]
    }

    #[inline]
    fn residual(&self, y: [f64; 2], x: [f64; 2]) -> [f64; 2] {
        let a = &self.0;
        [y[0] - (a[0] * x[0] + a[1] * x[1]), y[1] - (a[2] * x[0] + a[3] * x[1])]
    }

    fn entry(&self, row: usize, column: usize) -> f64 {
        self.0[2 * row + column]
    }

    fn size(&self) -> f64 {
        self.0.iter().fold(0.0, |most, x| largest(most, x.abs()))
    }

    fn vector_size(x: [f64; 2]) -> f64 {
        largest(x[0].abs(), x[1].abs())
    }

    fn unpack(x: [f64; 2], out: &mut [f64]) {
        out.copy_from_slice(&x);
    }

    fn pack(scalars: &[f64]) -> [f64; 2] {
        [scalars[0], scalars[1]]
    }

    fn probe(k: usize) -> [f64; 2] {
        [uneven(k), uneven(k + 7919)]
    }
}

/// The larger of two; NaN wins.
pub(crate) fn largest(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// Numbers in [-1, -0.1] and [0.1, 1] without a pattern that a grid could have.
fn uneven(k: usize) -> f64 {
    let bits = (k as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let bits = (bits ^ (bits >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let fraction = (bits >> 12) as f64 / (1u64 << 52) as f64;
    let magnitude = 0.1 + 0.9 * fraction;
    if bits & 1 == 0 { magnitude } else { -magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_times_its_inverse_is_one() {
        let a = Real2([3.0, -1.0, 2.0, 4.0]);
        let one = a.times(&a.inverse());
        for (found, expected) in one.0.iter().zip([1.0, 0.0, 0.0, 1.0]) {
            assert!((found - expected).abs() < 1e-15);
        }
        assert!(!Real2([1.0, 2.0, 2.0, 4.0]).inverse().is_finite());
        assert!(!c64::ZERO.inverse().is_finite());
    }

    #[test]
    fn probes_stay_away_from_zero() {
        for k in 0..1000 {
            assert!((0.1..=1.0).contains(&uneven(k).abs()));
        }
    }
}

//! The numbers that the laws work on: plain ones, and dual numbers that carry a derivative through the same
//! formulas (forward-mode differentiation: A. Griewank, A. Walther, "Evaluating Derivatives", chapter 3). So a
//! law and its derivative cannot drift apart. Where two branches meet, the derivative is that of the one taken.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number that the laws can work on.
pub trait Scalar:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Whether it carries a derivative.
    const CARRIES_TANGENT: bool;
    /// A number that does not vary.
    fn constant(value: f64) -> Self;
    /// The number itself.
    fn value(self) -> f64;
    /// Square root; its infinite slope at 0 counts as 0.
    fn sqrt(self) -> Self;
    /// Power of a base >= 0; an infinite slope at 0 counts as 0.
    fn powf(self, exponent: Self) -> Self;
    /// The same for an exponent in (0, 1], as the laws of many agents compute it (`power`).
    fn fraction(self, exponent: Self) -> Self;
    /// Arc tangent.
    fn atan(self) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Magnitude; at 0 as for positive numbers.
    fn abs(self) -> Self;
    /// The smaller of two; where they are equal, this one. Not a number only if both are not.
    fn min(self, other: Self) -> Self;
    /// The larger of two; where they are equal, this one. Not a number only if both are not.
    fn max(self, other: Self) -> Self;
    /// This magnitude with the sign of another number.
    fn copysign(self, sign: Self) -> Self;
    /// The value 0 of a function with this slope at the argument 0, which `self` is.
    fn through_zero(self, slope: impl FnOnce() -> f64) -> Self;

    /// Within 0 and 1.
    fn clamp_to_unit(self) -> Self {
        self.max(Self::constant(0.0)).min(Self::constant(1.0))
    }
}

impl Scalar for f64 {
    const CARRIES_TANGENT: bool = false;
    #[inline]
    fn constant(value: f64) -> Self {
        value
    }
    #[inline]
    fn value(self) -> f64 {
        self
    }
    #[inline]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline]
    fn powf(self, exponent: Self) -> Self {
        f64::powf(self, exponent)
    }
    #[inline]
    fn fraction(self, exponent: Self) -> Self {
        super::power::power(self, exponent)
    }
    #[inline]
    fn atan(self) -> Self {
        f64::atan(self)
    }
    #[inline]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    #[inline]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        f64::min(self, other)
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        f64::max(self, other)
    }
    #[inline]
    fn copysign(self, sign: Self) -> Self {
        f64::copysign(self, sign)
    }
    #[inline]
    fn through_zero(self, _: impl FnOnce() -> f64) -> Self {
        0.0
    }
    #[inline]
    fn clamp_to_unit(self) -> Self {
        self.clamp(0.0, 1.0)
    }
}

/// A number and its rate of change along some direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual {
    /// The number.
    pub value: f64,
    /// Its rate of change.
    pub tangent: f64,
}

impl Dual {
    /// A number that changes at this rate.
    pub fn new(value: f64, tangent: f64) -> Self {
        Self { value, tangent }
    }

    /// The value and the rate of a function of this number that has this value and slope here.
    fn times(self, value: f64, slope: f64) -> Self {
        Self { value, tangent: weigh(slope, self.tangent) }
    }
}

/// A rate times a factor: nothing that varies stays nothing, beside however large a factor.
fn weigh(factor: f64, rate: f64) -> f64 {
    if rate == 0.0 || factor == 0.0 { 0.0 } else { factor * rate }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.value + other.value, self.tangent + other.tangent)
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.value - other.value, self.tangent - other.tangent)
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let tangent = weigh(self.value, other.tangent) + weigh(other.value, self.tangent);
        Self::new(self.value * other.value, tangent)
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let tangent = weigh(1.0 / other.value, self.tangent) - weigh(value / other.value, other.tangent);
        Self::new(value, tangent)
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.value, -self.tangent)
    }
}

impl Scalar for Dual {
    const CARRIES_TANGENT: bool = true;
    fn constant(value: f64) -> Self {
        Self::new(value, 0.0)
    }
    fn value(self) -> f64 {
        self.value
    }
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.times(root, if root == 0.0 { 0.0 } else { 0.5 / root })
    }
    fn powf(self, exponent: Self) -> Self {
        let value = self.value.powf(exponent.value);
        if self.value == 0.0 {
            return Self::constant(value);
        }
        let tangent = weigh(exponent.value * value / self.value, self.tangent)
            + weigh(value * self.value.ln(), exponent.tangent);
        Self::new(value, tangent)
    }
    fn fraction(self, exponent: Self) -> Self {
        self.powf(exponent)
    }
    fn atan(self) -> Self {
        self.times(self.value.atan(), 1.0 / (1.0 + self.value * self.value))
    }
    fn exp(self) -> Self {
        self.times(self.value.exp(), self.value.exp())
    }
    fn abs(self) -> Self {
        if self.value < 0.0 { -self } else { self }
    }
    fn min(self, other: Self) -> Self {
        if other.value < self.value || self.value.is_nan() { other } else { self }
    }
    fn max(self, other: Self) -> Self {
        if other.value > self.value || self.value.is_nan() { other } else { self }
    }
    fn copysign(self, sign: Self) -> Self {
        if self.value.is_sign_negative() == sign.value.is_sign_negative() { self } else { -self }
    }
    fn through_zero(self, slope: impl FnOnce() -> f64) -> Self {
        self.times(0.0, slope())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A formula with all operations, once in numbers, once in dual numbers.
    fn formula<S: Scalar>(x: S, y: S) -> S {
        let c = S::constant;
        let smooth = (x * y - c(2.0)).abs().powf(y / x) + (-x / y).abs().sqrt();
        smooth.min(c(50.0)).atan().exp().max(x - c(9.0)) + (x - c(1.0)).clamp_to_unit().copysign(-y)
    }

    #[test]
    fn dual_numbers_agree_with_central_differences() {
        for (x, y) in [(1.3, 0.7), (1.4, 2.1), (0.4, 3.0)] {
            for (dx, dy) in [(1.0, 0.0), (0.0, 1.0), (-0.3, 2.0)] {
                let exact = formula(Dual::new(x, dx), Dual::new(y, dy));
                let h = 1e-5;
                let at = |s: f64| formula(x + s * dx, y + s * dy);
                let central = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                assert_eq!(exact.value, at(0.0));
                assert!(
                    (exact.tangent - central).abs() < 1e-9 * (1.0 + central.abs()),
                    "{exact:?} {central}"
                );
            }
        }
    }

    #[test]
    fn nothing_that_varies_stays_nothing_beside_infinity() {
        let infinite = Dual::constant(f64::INFINITY);
        let x = Dual::new(2.0, 1.0);
        assert_eq!((infinite * Dual::constant(3.0)).tangent, 0.0);
        assert_eq!((x / infinite).tangent, 0.0);
        assert_eq!((infinite - x).min(x), x);
        assert_eq!(Dual::constant(0.0).sqrt(), Dual::constant(0.0));
        assert_eq!((Dual::constant(1.0) / Dual::constant(0.0)).tangent, 0.0);
    }
}

//! m^eta for many values at once: exp2(eta log2 m) in operations that a compiler turns into vector code, and that
//! give the same bits at any vector width (nothing is fused, nothing is looked up). Knows numbers only.

use pulp::{Arch, NullaryFnOnce};

/// 2^52 + 2^51: added, it leaves the nearest integer in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// What a subnormal number is multiplied by to have all its bits.
const LIFT: f64 = 18_014_398_509_481_984.0;
/// The same as an exponent.
const LIFTED: f64 = 54.0;
/// Upper 32 bits of a double: with those alone a product with an exponent is exact.
const UPPER: u64 = 0xffff_ffff_0000_0000;

/// 2 / ((2 k + 1) ln 2), k = 0 to 10: log2 z = sum_k of this s^(2 k + 1), s = (z - 1) / (z + 1).
const LOG: [f64; 11] = {
    let mut terms = [0.0; 11];
    let mut k = 0;
    while k < 11 {
        terms[k] = 2.0 / ((2 * k + 1) as f64 * std::f64::consts::LN_2);
        k += 1;
    }
    terms
};

/// 1 / k!, k = 0 to 13: the exponential of at most 0.35.
const EXP: [f64; 14] = {
    let mut terms = [1.0; 14];
    let mut k = 1;
    while k < 14 {
        terms[k] = terms[k - 1] / k as f64;
        k += 1;
    }
    terms
};

/// m^eta, for `m >= 0` and `eta` in (0, 1], within 2 units in the last place of the correctly rounded one.
#[inline(always)]
pub fn power(m: f64, eta: f64) -> f64 {
    // m = 2^e z, z in [sqrt(1/2), sqrt(2)).
    let subnormal = m < f64::MIN_POSITIVE;
    let lifted = if subnormal { m * LIFT } else { m };
    let bits = lifted.to_bits();
    let shifted = bits.wrapping_sub(std::f64::consts::FRAC_1_SQRT_2.to_bits());
    // The exponent as a double, by the bits of 2^52 + 2^51 + e: there is no vector conversion of 64 bits below AVX-512.
    let e = ((shifted as i64) >> 52) as u64;
    let e_f = f64::from_bits(ROUND.to_bits().wrapping_add(e)) - ROUND;
    let z = f64::from_bits(bits.wrapping_sub(e << 52));
    let e_f = if subnormal { e_f - LIFTED } else { e_f };
    let s = (z - 1.0) / (z + 1.0);
    let q = s * s;
    // Both polynomials by Estrin's scheme: Horner's is one long chain, and a processor waits for each link.
    let q2 = q * q;
    let q4 = q2 * q2;
    let lo = (LOG[1] + q * LOG[2]) + q2 * (LOG[3] + q * LOG[4]);
    let hi = (LOG[5] + q * LOG[6]) + q2 * (LOG[7] + q * LOG[8]);
    let tail = lo + q4 * (hi + q4 * (LOG[9] + q * LOG[10]));
    let l = s * LOG[0] + s * q * tail;
    // eta (e + l) = n + r, n whole.
    let upper = f64::from_bits(eta.to_bits() & UPPER);
    let lower = eta - upper;
    let whole = upper * e_f;
    let shift = (whole + eta * l) + ROUND;
    let n = shift - ROUND;
    let r = (whole - n) + (lower * e_f + eta * l);
    let x = r * std::f64::consts::LN_2;
    let x2 = x * x;
    let x4 = x2 * x2;
    let x8 = x4 * x4;
    let p3 = (EXP[2] + x * EXP[3]) + x2 * (EXP[4] + x * EXP[5]);
    let p7 = (EXP[6] + x * EXP[7]) + x2 * (EXP[8] + x * EXP[9]);
    let p11 = (EXP[10] + x * EXP[11]) + x2 * (EXP[12] + x * EXP[13]);
    let p = 1.0 + (x + x2 * (p3 + (x4 * p7 + x8 * p11)));
    // 2^n in two halves, so that a subnormal result is rounded once.
    let n_bits = shift.to_bits().wrapping_sub(ROUND.to_bits());
    let half = ((n_bits as i64) >> 1) as u64;
    let rest = n_bits.wrapping_sub(half);
    let two_to = |k: u64| f64::from_bits(k.wrapping_add(1023) << 52);
    let result = p * two_to(half) * two_to(rest);
    let finite = if m < f64::INFINITY { result } else { m };
    if m == 0.0 { 0.0 } else { finite }
}

/// out = m^eta, value by value; the shorter of the two counts.
pub fn powers(eta: f64, m: &[f64], out: &mut [f64]) {
    Arch::new().dispatch(Powers { eta, m, out });
}

struct Powers<'a> {
    eta: f64,
    m: &'a [f64],
    out: &'a mut [f64],
}

impl NullaryFnOnce for Powers<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (out, &m) in self.out.iter_mut().zip(self.m) {
            *out = power(m, self.eta);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance in units in the last place.
    fn ulps(a: f64, b: f64) -> u64 {
        a.to_bits().abs_diff(b.to_bits())
    }

    #[test]
    fn within_two_units_of_the_c_library_over_the_whole_range() {
        let mut state = 1_u64;
        let mut next = || {
            state ^= state >> 12;
            state ^= state << 25;
            state ^= state >> 27;
            state.wrapping_mul(0x2545_f491_4f6c_dd1d)
        };
        let mut worst = 0;
        for k in 0..1_000_000 {
            // All bit patterns of positive finite numbers, subnormal ones too; exponents in (0, 1].
            let m = f64::from_bits(next() % f64::INFINITY.to_bits());
            let m = if k % 8 == 0 { f64::from_bits(next() >> 12) } else { m };
            let eta = 1.0 - (next() >> 11) as f64 / (1u64 << 53) as f64;
            worst = worst.max(ulps(power(m, eta), m.powf(eta)));
        }
        assert!(worst <= 2, "{worst} units in the last place");
    }

    #[test]
    fn ends_of_the_range() {
        for eta in [1e-300, 0.1, 0.5, 0.9, 1.0] {
            assert_eq!(power(0.0, eta), 0.0);
            assert_eq!(power(1.0, eta), 1.0);
            assert_eq!(power(f64::INFINITY, eta), f64::INFINITY);
            assert!(ulps(power(f64::MAX, eta), f64::MAX.powf(eta)) <= 2, "{eta}");
            assert!(ulps(power(5e-324, eta), 5e-324_f64.powf(eta)) <= 2, "{eta}");
        }
        assert!(power(f64::NAN, 0.5).is_nan());
    }

    #[test]
    fn vector_code_gives_the_bits_of_plain_code() {
        let m: Vec<f64> = (0..1003).map(|i| 1.37_f64.powi(i - 500)).collect();
        let mut out = vec![0.0; m.len()];
        powers(0.3, &m, &mut out);
        assert!(out.iter().zip(&m).all(|(&out, &m)| out == power(std::hint::black_box(m), 0.3)));
    }
}

//! Sine and cosine of many angles at once, in a loop that the compiler turns into vector instructions of any
//! processor: the sources' angles are most of what the dynamics of a small grid cost. Good to 2 ulp of 1;
//! the same to the last bit on every machine, which the system's own functions are not.

/// Beyond this the reduction loses digits and the standard library takes over, rad.
const FAR: f64 = 1e5;
/// Adding it rounds a number below 2^51 to a whole one, which then stands in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// pi/2 in three parts; products of the first two with whole numbers below 2^20 are exact.
const HALF_PI: [f64; 3] = [
    f64::from_bits(0x3ff9_21fb_5440_0000),
    f64::from_bits(0x3dd0_b461_1a40_0000),
    f64::from_bits(0x3be1_3198_a2e0_3707),
];

/// Writes the sines and cosines of `angle`, rad; all slices are equally long.
#[inline]
pub fn sin_cos(angle: &[f64], sin: &mut [f64], cos: &mut [f64]) {
    if angle.iter().all(|x| x.abs() < FAR) {
        for ((x, sin), cos) in angle.iter().zip(sin).zip(cos) {
            (*sin, *cos) = near(*x);
        }
    } else {
        for ((x, sin), cos) in angle.iter().zip(sin).zip(cos) {
            (*sin, *cos) = x.sin_cos();
        }
    }
}

/// Taylor's series on [-pi/4, pi/4], up to the term that no longer counts: r^15 / 15! and r^16 / 16!.
#[inline(always)]
fn near(x: f64) -> (f64, f64) {
    let rounded = x * std::f64::consts::FRAC_2_PI + ROUND;
    let quadrant = rounded.to_bits();
    let k = rounded - ROUND;
    let r = ((x - k * HALF_PI[0]) - k * HALF_PI[1]) - k * HALF_PI[2];
    let z = r * r;
    let odd = -1.0 / 6.0
        + z * (1.0 / 120.0
            + z * (-1.0 / 5040.0
                + z * (1.0 / 362_880.0
                    + z * (-1.0 / 39_916_800.0
                        + z * (1.0 / 6_227_020_800.0 + z * (-1.0 / 1_307_674_368_000.0))))));
    let even = 1.0 / 24.0
        + z * (-1.0 / 720.0
            + z * (1.0 / 40_320.0
                + z * (-1.0 / 3_628_800.0
                    + z * (1.0 / 479_001_600.0
                        + z * (-1.0 / 87_178_291_200.0 + z * (1.0 / 20_922_789_888_000.0))))));
    let sine = (r + r * (z * odd)).to_bits();
    let cosine = (1.0 - (0.5 * z - z * z * even)).to_bits();
    // Odd quadrants swap the two; the signs are those of the quadrant. Masks, not branches: vectors.
    let swap = (quadrant & 1).wrapping_neg();
    let exchanged = (sine ^ cosine) & swap;
    let negative_sine = (quadrant & 2) << 62;
    let negative_cosine = (quadrant.wrapping_add(1) & 2) << 62;
    (
        f64::from_bits((sine ^ exchanged) ^ negative_sine),
        f64::from_bits((cosine ^ exchanged) ^ negative_cosine),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_good_as_the_standard_library() {
        let angles: Vec<f64> = (-400_000..400_000)
            .map(|k| f64::from(k) * 1.234_567e-4)
            .chain([0.0, -0.0, 1e-300, 12_345.678, -99_999.9])
            .chain((-9..10).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_4))
            .collect();
        let (mut sin, mut cos) = (angles.clone(), angles.clone());
        sin_cos(&angles, &mut sin, &mut cos);
        let mut worst = 0.0;
        for ((x, s), c) in angles.iter().zip(&sin).zip(&cos) {
            let (exact_s, exact_c) = x.sin_cos();
            worst = f64::max(worst, (s - exact_s).abs().max((c - exact_c).abs()));
        }
        assert!(worst <= 4.5e-16, "{worst:e}");
    }

    #[test]
    fn far_and_impossible_angles_go_to_the_standard_library() {
        let angles = [1e9, f64::NAN, f64::INFINITY, 0.5];
        let (mut sin, mut cos) = ([0.0; 4], [0.0; 4]);
        sin_cos(&angles, &mut sin, &mut cos);
        assert_eq!((sin[0], cos[0]), 1e9_f64.sin_cos());
        assert!(sin[1].is_nan() && cos[2].is_nan());
        assert_eq!(sin[3], 0.5_f64.sin());
    }
}

//! Sine and cosine of many angles at once, and the angles of many complex numbers, in loops that the compiler turns into
//! vector instructions of any processor: the sources' angles are most of what the dynamics of a small grid cost, the
//! buses' most of what reading it costs. Good to 2 ulp of 1 (angles: 2 ulp); the same to the last bit on every
//! machine, which the system's own functions are not.

use faer::c64;

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
#[inline(always)]
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

/// Writes magnitudes and angles, rad in [-pi, pi], of complex numbers near 1; all slices are equally long. A magnitude
/// beyond 1e150 or below 1e-150 is lost, as the square of it is.
#[inline(always)]
pub fn polar(v: &[c64], magnitude: &mut [f64], angle: &mut [f64]) {
    for ((v, magnitude), angle) in v.iter().zip(magnitude).zip(angle) {
        *magnitude = (v.re * v.re + v.im * v.im).sqrt();
        *angle = arc(v.im, v.re);
    }
}

/// (arctan(sqrt z) / sqrt z - 1) / z on [0, tan^2(pi/8)], the lowest power first: Chebyshev's approximation, error
/// 4e-17.
const ARCTAN: [f64; 11] = [
    -0.333_333_333_333_333_3,
    0.199_999_999_999_955_16,
    -0.142_857_142_846_656_82,
    0.111_111_110_151_870_18,
    -0.090_909_045_753_064_9,
    0.076_921_831_253_768_92,
    -0.066_645_105_255_089_36,
    0.058_581_409_048_663_28,
    -0.050_854_078_345_894_844,
    0.039_230_447_784_793_09,
    -0.019_175_404_711_104_935,
];
/// tan(pi/8).
const TAN_EIGHTH: f64 = std::f64::consts::SQRT_2 - 1.0;

/// The angle of (x, y), as `y.atan2(x)`, by selections instead of branches; NaN where infinite.
#[inline(always)]
fn arc(y: f64, x: f64) -> f64 {
    let (across, up) = (x.abs(), y.abs());
    let is_steep = up > across;
    let (low, high) = if is_steep { (across, up) } else { (up, across) };
    // arctan(low / high) = pi/4 + arctan((low - high) / (low + high)) beyond pi/8.
    let is_far = low > TAN_EIGHTH * high;
    let (numerator, denominator) = if is_far { (low - high, low + high) } else { (low, high) };
    let t = numerator / if high == 0.0 { 1.0 } else { denominator };
    let z = t * t;
    let [c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10] = ARCTAN;
    let series = c0
        + z * (c1
            + z * (c2
                + z * (c3 + z * (c4 + z * (c5 + z * (c6 + z * (c7 + z * (c8 + z * (c9 + z * c10)))))))));
    let rest = t + t * (z * series);
    // The angle is a whole number of pi/4, in two parts that lose nothing, and the rest with a sign.
    let octants = if is_far { 1.0 } else { 0.0 };
    let (octants, rest) = if is_steep { (2.0 - octants, -rest) } else { (octants, rest) };
    let (octants, rest) = if x.is_sign_negative() { (4.0 - octants, -rest) } else { (octants, rest) };
    let angle = octants * (0.5 * HALF_PI[0]) + (octants * (0.5 * (HALF_PI[1] + HALF_PI[2])) + rest);
    angle.copysign(y)
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
    fn angles_are_as_good_as_the_standard_library() {
        let turn = |k: i32| f64::from(k) * 1.570_8e-5;
        let mut points: Vec<c64> = (-200_000..200_000)
            .map(|k| c64::new(turn(k).cos(), turn(k).sin()) * (1.0 + 0.2 * turn(3 * k).sin()))
            .collect();
        for re in [0.0, -0.0, 1.0, -1.0, 1e-300, 1e-9] {
            points.extend([0.0, -0.0, 1.0, -1.0, 1e-300, -1e-9].map(|im| c64::new(re, im)));
        }
        let (mut magnitudes, mut angles) = (vec![0.0; points.len()], vec![0.0; points.len()]);
        polar(&points, &mut magnitudes, &mut angles);
        for ((v, magnitude), angle) in points.iter().zip(magnitudes).zip(angles) {
            let exact = v.im.atan2(v.re);
            assert!((angle - exact).abs() <= 4.5e-16 * exact.abs(), "{v}: {angle:e} {exact:e}");
            assert_eq!(angle.is_sign_negative(), exact.is_sign_negative(), "{v}");
            assert!((magnitude - v.re.hypot(v.im)).abs() <= 4.5e-16 * magnitude.max(1e-150), "{v}");
        }
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

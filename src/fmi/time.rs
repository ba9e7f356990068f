//! Communication time, counted in integer nanoseconds. Whatever the master's rounding does, equal
//! steps stay equal, and the count never leaves the tolerance around the master's clock.

use super::model::Step;

/// Beyond this the count would overflow (292 years).
const LIMIT_NS: f64 = 9.2e18;

/// Rounded to whole nanoseconds; none if not finite or beyond 292 years.
pub fn to_ns(time_s: f64) -> Option<i64> {
    let ns = time_s * 1e9;
    // As `round`, which is a call where the processor's own is not to be relied on: what is cut off is exact.
    let whole = ns as i64;
    let rest = ns - whole as f64;
    let away = i64::from(rest >= 0.5) - i64::from(rest <= -0.5);
    (ns.abs() <= LIMIT_NS).then_some(whole.wrapping_add(away))
}

/// The nearest double in seconds.
pub fn to_s(time_ns: i64) -> f64 {
    time_ns as f64 / 1e9
}

/// Four units in the last place of a time, s: what a master's own arithmetic may have lost.
fn rounding_s(time_s: f64) -> f64 {
    4.0 * f64::EPSILON * time_s.abs()
}

/// How far a communication point may lie from the counted time and still be meant, s: a millionth of
/// the step, a nanosecond, the rounding of the number itself, and what a clock that adds up its steps
/// may have lost so far (half an ulp a step, at most a ten-thousandth of a step).
pub fn tolerance_s(now_ns: i64, step_s: f64) -> f64 {
    let now_s = to_s(now_ns);
    let summed_s = (f64::EPSILON / 2.0 * now_s * now_s / step_s).min(1e-4 * step_s);
    // Without a step (0 / 0 at time 0) nothing has been added up.
    let summed_s = if step_s > 0.0 { summed_s } else { 0.0 };
    1e-6 * step_s + 1e-9 + rounding_s(now_s) + summed_s
}

/// The step from the counted time to `point_s + step_s`; its duration is zero when that is less than a
/// nanosecond away. Both arguments finite, `step_s >= 0`, `point_s` within [`tolerance_s`]. None when
/// the end lies beyond what can be counted.
pub fn plan(now_ns: i64, point_s: f64, step_s: f64) -> Option<Step> {
    let end_s = point_s + step_s;
    let end_ns = to_ns(end_s)?;
    let step_ns = to_ns(step_s)?;
    let counted_ns = now_ns.checked_add(step_ns)?;
    // A step of whole nanoseconds is taken at its word as long as the clock stays within tolerance:
    // a master that adds up 0.1 s drifts, the count does not, and every step is equally long. Other
    // steps (1/3 s) follow the clock, because their count would drift.
    let is_whole = (step_s * 1e9 - step_ns as f64).abs() <= 1e-3;
    let slack_s = if is_whole { 0.9 * tolerance_s(now_ns, step_s) } else { 0.6e-9 + rounding_s(end_s) };
    let end_ns = if (counted_ns as f64 - end_s * 1e9).abs() <= slack_s * 1e9 { counted_ns } else { end_ns };
    Some(Step { start_ns: now_ns, duration_ns: end_ns.checked_sub(now_ns)?.max(0) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps a counter as an instance does and returns its durations, checking the tolerance.
    fn run(start_s: f64, points: impl Iterator<Item = (f64, f64)>) -> (i64, Vec<i64>) {
        let mut now = to_ns(start_s).unwrap();
        let mut durations = Vec::new();
        for (t, h) in points {
            let off = (t - to_s(now)).abs();
            assert!(off <= tolerance_s(now, h), "{t} against {}: off by {off:e}", to_s(now));
            let step = plan(now, t, h).unwrap();
            assert_eq!(step.start_ns, now);
            now += step.duration_ns;
            if step.duration_ns > 0 {
                durations.push(step.duration_ns);
            }
        }
        (now, durations)
    }

    fn summed(start: f64, h: f64, n: usize) -> impl Iterator<Item = (f64, f64)> {
        std::iter::successors(Some(start), move |t| Some(t + h)).take(n).map(move |t| (t, h))
    }

    #[test]
    fn a_summed_clock_gives_equal_steps() {
        let (end, durations) = run(0.0, summed(0.0, 0.1, 100_000));
        assert_eq!(end, 10_000_000_000_000);
        assert!(durations.iter().all(|d| *d == 100_000_000));
    }

    #[test]
    fn thirds_never_drift_from_the_master() {
        let h = 1.0 / 3.0;
        let (end, durations) = run(0.0, (0..3_000_000).map(|k| (f64::from(k) * h, h)));
        assert_eq!(end, 1_000_000_000_000_000);
        assert!(durations.iter().all(|d| (333_333_332..=333_333_335).contains(d)));
    }

    #[test]
    fn a_jittered_clock_heals() {
        let points = (0..10_000).map(|k| {
            let jitter = if k % 2 == 0 { 9e-9 } else { -9e-9 };
            (f64::from(k) * 0.01 + if k == 0 { 0.0 } else { jitter }, 0.01)
        });
        let (end, _) = run(0.0, points);
        assert_eq!(end, 100_000_000_000);
    }

    #[test]
    fn a_clock_that_runs_away_slowly_is_followed() {
        // Each step is 1e-8 longer than the step size says: far more than rounding.
        let points = (0..10_000).map(|k| (f64::from(k) * 0.100_000_001, 0.1));
        let (end, _) = run(0.0, points);
        assert!((end - 1_000_000_010_000).abs() <= 103, "{end}");
    }

    #[test]
    fn a_coarse_clock_keeps_equal_steps() {
        // At 1e9 s a double resolves 119 ns.
        let (end, durations) = run(1e9, (0..1000).map(|k| (1e9 + f64::from(k) * 0.01, 0.01)));
        assert!(durations.iter().all(|d| *d == 10_000_000));
        assert_eq!(end, 1_000_000_010_000_000_000);
    }

    #[test]
    fn negative_start_and_steps_below_a_nanosecond_lose_no_time() {
        let (end, _) = run(-1.0, summed(-1.0, 0.25, 8));
        assert_eq!(end, 1_000_000_000);
        let (end, durations) = run(0.0, summed(0.0, 1e-10, 1000));
        assert!((99..=101).contains(&end), "{end}");
        assert!(durations.iter().all(|d| *d == 1));
    }

    #[test]
    fn what_cannot_be_counted_is_refused() {
        for t in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e10, -1e300] {
            assert_eq!(to_ns(t), None, "{t}");
        }
        assert_eq!(plan(0, 0.0, 1e12), None);
        assert_eq!(plan(i64::MAX - 10, 9.2e9, 9.1e9), None);
    }
}

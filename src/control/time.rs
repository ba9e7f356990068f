//! Seconds and counted nanoseconds. Time is never summed as a floating-point number.

/// Nanoseconds of a finite time in s, to the nearest; saturates far beyond any simulation.
pub fn nanoseconds(t_s: f64) -> i64 {
    (t_s * 1e9).round() as i64
}

/// Seconds of counted nanoseconds.
pub fn seconds(t_ns: i64) -> f64 {
    t_ns as f64 * 1e-9
}

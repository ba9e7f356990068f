//! Times on the command line: `30`, `30s`, `500ms`, `2min`, `1h`; a bare number is in seconds.

use crate::scenario::nanoseconds;

/// Units with their length, s. The longest first, so that `ms` is not read as `s`.
const UNITS: [(&str, f64); 4] = [("min", 60.0), ("ms", 1e-3), ("h", 3600.0), ("s", 1.0)];
/// Longest time taken, s: a year.
const LONGEST_S: f64 = 366.0 * 86_400.0;

/// A positive time as a count of nanoseconds.
pub fn parse(text: &str) -> Result<i64, String> {
    let text = text.trim();
    let unit = UNITS.iter().find_map(|(name, length)| Some((text.strip_suffix(name)?, *length)));
    let (number, length_s) = unit.unwrap_or((text, 1.0));
    let expected = "expected a time like 30, 30s, 500ms, 2min or 1h";
    let seconds = number.trim().parse::<f64>().map_err(|_| expected.to_owned())? * length_s;
    if !(seconds > 0.0 && seconds <= LONGEST_S) {
        return Err(format!("{expected}, above 0 and at most a year"));
    }
    match nanoseconds(seconds) {
        0 => Err("expected at least a nanosecond".to_owned()),
        ns => Ok(ns),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_and_nonsense_is_not() {
        let table = [
            ("30", 30_000),
            ("30s", 30_000),
            (" 500 ms", 500),
            ("0.5", 500),
            ("2min", 120_000),
            ("1h", 3_600_000),
        ];
        for (text, ms) in table {
            assert_eq!(parse(text), Ok(ms * 1_000_000), "{text}");
        }
        for text in ["", "s", "0", "-1", "NaN", "inf", "1d", "1e9h", "1e-12"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}

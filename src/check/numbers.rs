//! The number types of XML Schema, which are not quite those of Rust.

/// xs:double: `INF`, `-INF`, `NaN`, or digits; never `inf` or `1e5f`.
pub fn double(text: &str) -> Option<f64> {
    match text.trim() {
        "INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        plain if plain.chars().all(|c| c.is_ascii_digit() || "+-.eE".contains(c)) => plain.parse().ok(),
        _ => None,
    }
}

/// xs:int.
pub fn int(text: &str) -> Option<i32> {
    text.trim().parse().ok()
}

/// xs:unsignedInt.
pub fn unsigned(text: &str) -> Option<u32> {
    text.trim().parse().ok()
}

/// xs:boolean.
pub fn boolean(text: &str) -> Option<bool> {
    match text.trim() {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// xs:dateTime: `2026-01-31T12:00:00`, with fraction and zone where wanted.
pub fn is_date_time(text: &str) -> bool {
    let shape = |part: &str, expected: &str| {
        part.len() == expected.len()
            && part
                .chars()
                .zip(expected.chars())
                .all(|(c, e)| if e == '0' { c.is_ascii_digit() } else { c == e })
    };
    let Some((date, rest)) = text.trim().split_once('T') else { return false };
    let (Some(time), Some(tail)) = (rest.get(..8), rest.get(8..)) else { return false };
    let zone = match tail.strip_prefix('.') {
        Some(fraction) => {
            let digits = fraction.len() - fraction.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            if digits == 0 {
                return false;
            }
            fraction.get(digits..).unwrap_or_default()
        }
        None => tail,
    };
    let is_zone = zone.is_empty() || zone == "Z" || shape(zone, "+00:00") || shape(zone, "-00:00");
    shape(date, "0000-00-00") && shape(time, "00:00:00") && is_zone
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubles_are_those_of_xml_schema() {
        for (text, expected) in
            [("1", Some(1.0)), (" -1.5E-3 ", Some(-1.5e-3)), ("INF", Some(f64::INFINITY)), (".5", Some(0.5))]
        {
            assert_eq!(double(text), expected, "{text}");
        }
        for text in ["", "inf", "nan", "1,5", "0x1", "1f", "Infinity", "infinity"] {
            assert_eq!(double(text), None, "{text}");
        }
    }

    #[test]
    fn dates_need_their_time() {
        for good in ["2026-01-31T12:00:00", "2026-01-31T12:00:00Z", "2026-01-31T12:00:00.25+01:00"] {
            assert!(is_date_time(good), "{good}");
        }
        for bad in
            ["2026-01-31", "2026-01-31 12:00:00", "2026-01-31T12:00", "2026-01-31T12:00:00.", "yesterday"]
        {
            assert!(!is_date_time(bad), "{bad}");
        }
    }
}

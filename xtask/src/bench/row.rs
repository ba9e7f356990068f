//! One measured row, as a line of the table and as JSON.

use serde_json::{Value, json};

/// What a figure should reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bar {
    /// This or more.
    AtLeast(f64),
    /// This or less.
    AtMost(f64),
}

impl Bar {
    fn met(self, value: f64) -> bool {
        match self {
            Bar::AtLeast(bar) => value >= bar,
            Bar::AtMost(bar) => value <= bar,
        }
    }

    fn words(self, unit: &str) -> String {
        match self {
            Bar::AtLeast(bar) => format!("at least {bar} {unit}"),
            Bar::AtMost(bar) => format!("at most {bar} {unit}"),
        }
    }
}

/// One row.
#[derive(Clone, Debug)]
pub struct Row {
    /// What was measured.
    pub name: String,
    /// The figure, or why there is none.
    pub value: Result<f64, String>,
    /// Its unit.
    pub unit: &'static str,
    /// What it should reach, if anything.
    pub bar: Option<Bar>,
    /// What it is made of: times, versions, how the results agree.
    pub note: String,
    /// The same for programs.
    pub detail: Value,
}

impl Row {
    /// A figure without a bar.
    pub fn figure(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self {
            name: name.into(),
            value: Ok(value),
            unit,
            bar: None,
            note: String::new(),
            detail: Value::Null,
        }
    }

    /// A row that could not be measured.
    pub fn missing(name: impl Into<String>, unit: &'static str, bar: Bar, why: impl Into<String>) -> Self {
        Self { value: Err(why.into()), bar: Some(bar), ..Self::figure(name, f64::NAN, unit) }
    }

    /// The same without a bar.
    pub fn unknown(name: impl Into<String>, unit: &'static str, why: impl Into<String>) -> Self {
        Self { value: Err(why.into()), ..Self::figure(name, f64::NAN, unit) }
    }

    /// With a bar.
    pub fn bar(self, bar: Bar) -> Self {
        Self { bar: Some(bar), ..self }
    }

    /// With a note.
    pub fn note(self, note: impl Into<String>, detail: Value) -> Self {
        Self { note: note.into(), detail, ..self }
    }

    fn met(&self) -> Option<bool> {
        // What was not measured is not met.
        self.bar.map(|bar| self.value.as_ref().is_ok_and(|&value| bar.met(value)))
    }

    fn verdict(&self) -> String {
        match (&self.value, self.bar) {
            (Err(why), _) => format!("not measured: {why}"),
            (Ok(_), None) => String::new(),
            (Ok(value), Some(bar)) => {
                format!("{}: {}", bar.words(self.unit), if bar.met(*value) { "met" } else { "MISSED" })
            }
        }
    }

    /// For summary.json.
    pub fn json(&self) -> Value {
        let (at_least, at_most) = match self.bar {
            Some(Bar::AtLeast(bar)) => (Some(bar), None),
            Some(Bar::AtMost(bar)) => (None, Some(bar)),
            None => (None, None),
        };
        json!({
            "name": self.name, "value": self.value.as_ref().ok(), "unit": self.unit,
            "at_least": at_least, "at_most": at_most, "met": self.met(),
            "not_measured": self.value.as_ref().err(), "note": self.note, "detail": self.detail,
        })
    }
}

/// The rows below each other.
pub fn table(rows: &[Row]) -> String {
    let width = rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for row in rows {
        let value = row.value.as_ref().map_or("-".into(), |value| number(*value));
        let line = format!("{:width$}  {value:>10} {:12}  {}", row.name, row.unit, row.verdict());
        text.push_str(line.trim_end());
        text.push('\n');
        if !row.note.is_empty() {
            text.push_str(&format!("{:width$}  {}\n", "", row.note));
        }
    }
    text
}

/// Three digits that count, no exponent in the usual range.
fn number(value: f64) -> String {
    match value.abs() {
        x if x >= 100.0 => format!("{value:.0}"),
        x if x >= 10.0 => format!("{value:.1}"),
        x if x >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// The median; not a number of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match (values.get(middle), values.len() % 2) {
        (Some(&upper), 1) => upper,
        (Some(&upper), _) => (values.get(middle - 1).copied().unwrap_or(upper) + upper) / 2.0,
        (None, _) => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_odd_and_even_counts() {
        assert_eq!(median(vec![3.0, 1.0, 100.0]), 3.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 100.0]), 3.0);
        assert!(median(vec![]).is_nan());
    }

    #[test]
    fn a_missed_bar_is_shown_and_written() {
        let row = Row::figure("speed", 499.9, "x").bar(Bar::AtLeast(500.0));
        assert_eq!(row.met(), Some(false));
        assert!(table(std::slice::from_ref(&row)).trim_end().ends_with("at least 500 x: MISSED"));
        let row = Row { value: Ok(500.0), ..row };
        assert!(table(std::slice::from_ref(&row)).trim_end().ends_with("at least 500 x: met"));
        assert_eq!(row.json()["met"], true);
        assert_eq!(Row::figure("time", 1.1, "x").bar(Bar::AtMost(1.0)).met(), Some(false));
        assert!(Row::figure("speed", 1.0, "x").json()["met"].is_null());
    }

    #[test]
    fn what_was_not_measured_is_not_met() {
        let row = Row::missing("speed", "x", Bar::AtMost(1.0), "no octave");
        assert_eq!(row.met(), Some(false));
        assert!(table(std::slice::from_ref(&row)).contains("not measured: no octave"));
        assert!(row.json()["value"].is_null());
    }
}

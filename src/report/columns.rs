//! Recorded columns by name: `grid.omega[1]` and the like over one time axis. Borrows, copies nothing
//! but the time.

use super::error::ReportError;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Columns over one time axis.
#[derive(Clone, Debug)]
pub struct Columns<'a> {
    time_s: Arc<[f64]>,
    by_name: BTreeMap<&'a str, &'a [f64]>,
}

impl<'a> Columns<'a> {
    /// Gathers columns recorded at the instants `time_s`, s, ascending.
    pub fn new(
        time_s: &[f64],
        columns: impl IntoIterator<Item = (&'a str, &'a [f64])>,
    ) -> Result<Self, ReportError> {
        let mut by_name = BTreeMap::new();
        for (name, values) in columns {
            if values.len() != time_s.len() {
                return Err(ReportError::Length {
                    place: format!("column `{name}`"),
                    found: values.len(),
                    expected: time_s.len(),
                    reason: "one per recorded instant",
                });
            }
            if by_name.insert(name, values).is_some() {
                return Err(ReportError::DuplicateColumn { name: name.to_owned() });
            }
        }
        Ok(Self { time_s: time_s.into(), by_name })
    }

    /// The recorded instants, s.
    pub fn time_s(&self) -> &Arc<[f64]> {
        &self.time_s
    }

    /// The column of this name, if it was recorded.
    pub fn get(&self, name: &str) -> Option<&'a [f64]> {
        self.by_name.get(name).copied()
    }

    /// The column of this name.
    pub fn require(&self, name: &str) -> Result<&'a [f64], ReportError> {
        self.get(name).ok_or_else(|| {
            let model = name.split_once('.').map_or(name, |(model, _)| model);
            let mut near: Vec<&str> =
                self.by_name.keys().copied().filter(|key| key.starts_with(model)).take(9).collect();
            let recorded = match near.len() {
                0 => format!("none of {} columns", self.by_name.len()),
                _ => {
                    if near.len() == 9 {
                        near[8] = "...";
                    }
                    near.join(", ")
                }
            };
            ReportError::MissingColumn { name: name.to_owned(), recorded }
        })
    }

    /// The columns `name[1]` to `name[count]`.
    pub fn require_group(&self, name: &str, count: usize) -> Result<Vec<&'a [f64]>, ReportError> {
        (1..=count).map(|i| self.require(&format!("{name}[{i}]"))).collect()
    }

    /// The columns `name[1]` to `name[count]`, if all were recorded.
    pub fn get_group(&self, name: &str, count: usize) -> Option<Vec<&'a [f64]>> {
        (1..=count).map(|i| self.get(&format!("{name}[{i}]"))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_column_is_named_beside_what_there_is() {
        let y = [1.0, 2.0];
        let columns =
            Columns::new(&[0.0, 1.0], [("grid.omega[1]", &y[..]), ("controller.T_P", &y[..])]).unwrap();
        let message = columns.require_group("grid.omega", 2).unwrap_err().to_string();
        assert_eq!(
            message,
            "column `grid.omega[2]` is missing; recorded with the same prefix: grid.omega[1]. \
             Record it, or leave this figure out"
        );
        let message = columns.require("plant.P[1]").unwrap_err().to_string();
        assert!(message.contains("none of 2 columns"), "{message}");
    }

    #[test]
    fn uneven_and_double_columns_are_refused() {
        let y = [1.0, 2.0];
        let message = Columns::new(&[0.0], [("grid.P[1]", &y[..])]).unwrap_err().to_string();
        assert_eq!(message, "column `grid.P[1]`: found 2 values, expected 1 (one per recorded instant)");
        assert!(Columns::new(&[0.0, 1.0], [("a", &y[..]), ("a", &y[..])]).is_err());
    }
}

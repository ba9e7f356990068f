//! target/bench/summary.json: the last figure of every row with the time of its run, whatever was run together. A family
//! of rows that was never run stands there as not measured.

use super::Family;
use super::row::Row;
use crate::{
    error::Failure,
    process::{command, output},
    workspace::Workspace,
};
use clap::ValueEnum;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Puts the rows of these families in the place of those that the file has, and gives back where it is.
pub fn merge(workspace: &Workspace, fresh: &[(Family, Vec<Row>)]) -> Result<PathBuf, Failure> {
    let path = workspace.target.join("bench/summary.json");
    // What is no list of rows (none yet, or of an older program) is forgotten.
    let last = std::fs::read_to_string(&path).ok().and_then(|text| serde_json::from_str(&text).ok());
    let now = output(command(workspace, "date").args(["-u", "+%Y-%m-%dT%H:%M:%SZ"]))?;
    let merged = merged(last.unwrap_or_default(), fresh, now.trim());
    // Under another name first: half a file is none.
    let half = path.with_extension("part");
    std::fs::write(&half, format!("{merged:#}\n")).map_err(Failure::file("write", &half))?;
    std::fs::rename(&half, &path).map_err(Failure::file("rename", &half))?;
    Ok(path)
}

fn merged(last: Value, fresh: &[(Family, Vec<Row>)], now: &str) -> Value {
    let mut all = Vec::new();
    for family in Family::value_variants() {
        let name = family.name();
        let before = all.len();
        match fresh.iter().find(|(of, _)| of == family) {
            Some((_, rows)) => all.extend(rows.iter().map(|row| stamped(row, &name, Some(now)))),
            None => {
                let of_family = |row: &&Value| row["family"] == name.as_str();
                all.extend(last.as_array().into_iter().flatten().filter(of_family).cloned());
            }
        }
        if all.len() == before {
            let why = format!("never run here: cargo xtask bench --only {name}");
            all.push(stamped(&Row::unknown(format!("all of {name}"), "", why), &name, None));
        }
    }
    Value::Array(all)
}

fn stamped(row: &Row, family: &str, at: Option<&str>) -> Value {
    let mut value = row.json();
    if let Some(fields) = value.as_object_mut() {
        fields.insert("family".into(), json!(family));
        fields.insert("measured_at".into(), json!(at));
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(summary: &Value, family: &str) -> Vec<(String, Option<f64>, Option<String>)> {
        let rows = summary.as_array().expect("a list");
        let of = rows.iter().filter(|row| row["family"] == family);
        of.map(|row| {
            let text = |key: &str| row[key].as_str().map(str::to_owned);
            (text("name").expect("a name"), row["value"].as_f64(), text("measured_at"))
        })
        .collect()
    }

    #[test]
    fn rows_of_another_run_keep_their_figures_and_dates() {
        let first = [(Family::Export, vec![Row::figure("a", 1.0, "s"), Row::figure("b", 2.0, "s")])];
        let summary = merged(Value::Null, &first, "then");
        let second = [(Family::Dynamics, vec![Row::figure("c", 3.0, "s")])];
        let summary = merged(summary, &second, "now");
        let at = |name: &str, value, date: &str| (name.to_owned(), Some(value), Some(date.to_owned()));
        assert_eq!(values(&summary, "export"), [at("a", 1.0, "then"), at("b", 2.0, "then")]);
        assert_eq!(values(&summary, "dynamics"), [at("c", 3.0, "now")]);
        // Run again, a family's rows are those of the new run alone.
        let third = [(Family::Export, vec![Row::figure("b", 4.0, "s")])];
        assert_eq!(values(&merged(summary, &third, "later"), "export"), [at("b", 4.0, "later")]);
    }

    #[test]
    fn what_was_never_run_is_said_to_be_missing() {
        let summary = merged(json!({ "not": "a list" }), &[], "now");
        for family in Family::value_variants() {
            let rows = values(&summary, &family.name());
            assert_eq!(rows.len(), 1);
            assert_eq!((rows[0].1, &rows[0].2), (None, &None));
        }
        assert!(summary[0]["not_measured"].as_str().is_some_and(|why| why.contains("--only")));
    }
}

//! A run beside its variants: how fast each settles after the controller is enabled, what is certified, how
//! aggressive it is, and in which range a smaller eta is the faster one.

use super::super::Failure;
use super::record::Record;
use crate::control::config::Law;
use crate::report::{Phase, Table, format_value};
use crate::scenario::Resolved;
use miette::IntoDiagnostic;
use serde::Serialize;
use std::fmt::Write as _;

/// A variant that was run.
pub struct Compared {
    /// What is different.
    pub label: String,
    /// Its configurations.
    pub resolved: Resolved,
    /// What was recorded.
    pub record: Record,
}

/// One run in a line.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What is different; "as given" for the scenario itself.
    pub label: String,
    /// Exponent of its law.
    pub eta: f64,
    /// Time after enabling from which omega stays settled, s; none if it does not settle before the next event.
    pub omega_settled_s: Option<f64>,
    /// The same for active power sharing.
    pub p_settled_s: Option<f64>,
    /// Certified times at that instant, s: estimates on a grid; none where there is no bound.
    pub T_omega: Option<f64>,
    /// (27).
    pub T_P: Option<f64>,
    /// Largest abs(u_omega_i) from enabling to the next event, pu/s.
    pub largest_u_omega: f64,
    /// Largest total variation of an omega_set_i over that time, pu.
    pub variation_of_omega_set: f64,
    /// Which run: 0 the scenario itself, then its variants. One that ends before the phase has no row.
    #[serde(skip)]
    pub run: usize,
    /// Whether nothing but eta differs from the scenario, under the finite-time law.
    #[serde(skip)]
    only_eta: bool,
}

impl Row {
    /// When both have settled, s; infinite if they do not.
    fn settled_s(&self) -> f64 {
        match (self.omega_settled_s, self.p_settled_s) {
            (Some(omega), Some(p)) => omega.max(p),
            _ => f64::INFINITY,
        }
    }
}

/// Sums up one run; `phase` is the one that begins when the controller is enabled.
pub fn row(
    label: &str,
    main: &Resolved,
    resolved: &Resolved,
    record: &Record,
    phase: &Phase,
) -> Result<Row, Failure> {
    let columns = record.columns().into_diagnostic()?;
    let n = resolved.control.agents();
    let time = columns.time_s();
    let within = time.partition_point(|t| *t < phase.from_s)..time.partition_point(|t| *t < phase.to_s);
    let of = |name: &str| {
        let group = columns.get_group(&format!("controller.{name}"), n).unwrap_or_default();
        group.into_iter().filter_map(|s| s.get(within.clone())).collect::<Vec<&[f64]>>()
    };
    let largest = |values: &[f64]| values.iter().fold(0.0, |w: f64, v| w.max(v.abs()));
    let variation = |values: &[f64]| values.windows(2).map(|w| (w[1] - w[0]).abs()).sum::<f64>();
    let mut same = resolved.control.clone();
    same.eta = main.control.eta;
    Ok(Row {
        label: label.to_owned(),
        eta: resolved.control.eta,
        omega_settled_s: phase.omega_settled_s,
        p_settled_s: phase.p_settled_s,
        T_omega: phase.T_omega,
        T_P: phase.T_P,
        largest_u_omega: of("u_omega").into_iter().map(largest).fold(0.0, f64::max),
        variation_of_omega_set: of("omega_set").into_iter().map(variation).fold(0.0, f64::max),
        run: 0,
        only_eta: same == main.control && main.control.law == Law::FiniteTime && same_frame(main, resolved),
    })
}

fn same_frame(a: &Resolved, b: &Resolved) -> bool {
    a.scenario.step_s == b.scenario.step_s && a.grid == b.grid
}

/// In which ranges of eta the smaller one settled sooner, read off the runs; none unless eta was varied.
pub fn eta_verdict(rows: &[Row]) -> Option<String> {
    let mut varied: Vec<&Row> = rows.iter().filter(|r| r.only_eta).collect();
    varied.sort_by(|a, b| a.eta.total_cmp(&b.eta));
    varied.dedup_by(|a, b| a.eta == b.eta);
    if varied.len() < 2 {
        return None;
    }
    let mut ranges: Vec<(bool, f64, f64)> = Vec::new();
    for pair in varied.windows(2) {
        let faster = pair[0].settled_s() < pair[1].settled_s();
        match ranges.last_mut() {
            Some((same, _, to)) if *same == faster => *to = pair[1].eta,
            _ => ranges.push((faster, pair[0].eta, pair[1].eta)),
        }
    }
    let told: Vec<String> = ranges
        .iter()
        .map(|(faster, from, to)| {
            let word = if *faster { "is faster" } else { "is not faster" };
            format!("from {from} to {to} smaller eta {word}")
        })
        .collect();
    Some(format!("Measured at eta = {}: {}.", list(&varied), told.join("; ")))
}

fn list(rows: &[&Row]) -> String {
    rows.iter().map(|r| r.eta.to_string()).collect::<Vec<_>>().join(", ")
}

const HEADER: [&str; 8] = [
    "run",
    "eta",
    "\u{3c9} settled (s)",
    "T_\u{3c9} (s)",
    "P settled (s)",
    "T_P (s)",
    "largest |u_\u{3c9}| (pu/s)",
    "variation of \u{3c9}_set (pu)",
];

fn cells(row: &Row) -> Vec<String> {
    let time = |t: Option<f64>, none: &str| t.map_or_else(|| none.to_owned(), |t| format!("{t:.2}"));
    vec![
        row.label.clone(),
        row.eta.to_string(),
        time(row.omega_settled_s, "no"),
        time(row.T_omega, "\u{2013}"),
        time(row.p_settled_s, "no"),
        time(row.T_P, "\u{2013}"),
        format_value(row.largest_u_omega, 3),
        format_value(row.variation_of_omega_set, 3),
    ]
}

/// The rows as a table of the report.
pub fn table(rows: &[Row]) -> Table {
    Table {
        caption: "From enabling the controller to the next event. Settled: \u{3c9} within 1e-5 of its reference, K_P P \
                  within 1e-5 of its mean. T_\u{3c9}, T_P: certified times, estimates on a grid. The last two columns \
                  tell how aggressive a run is: the largest over all BESS."
            .into(),
        header: HEADER.map(str::to_owned).to_vec(),
        rows: rows.iter().map(cells).collect(),
    }
}

/// The rows for the terminal.
pub fn text(rows: &[Row]) -> String {
    let lines: Vec<Vec<String>> =
        std::iter::once(HEADER.map(str::to_owned).to_vec()).chain(rows.iter().map(cells)).collect();
    let width =
        |c: usize| lines.iter().filter_map(|l| l.get(c)).map(|s| s.chars().count()).max().unwrap_or(0);
    let mut text = String::from("\nSide by side, from enabling to the next event\n");
    for line in &lines {
        for (c, cell) in line.iter().enumerate() {
            let pad = " ".repeat(width(c) - cell.chars().count());
            let _ = if c == 0 { write!(text, "{cell}{pad}") } else { write!(text, "  {pad}{cell}") };
        }
        text.push('\n');
    }
    if let Some(verdict) = eta_verdict(rows) {
        let _ = writeln!(text, "{verdict}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(eta: f64, settled: Option<f64>) -> Row {
        Row {
            label: String::new(),
            eta,
            omega_settled_s: settled,
            p_settled_s: settled,
            T_omega: None,
            T_P: None,
            largest_u_omega: 0.0,
            variation_of_omega_set: 0.0,
            run: 0,
            only_eta: true,
        }
    }

    #[test]
    fn the_verdict_follows_the_figures() {
        let rows = [row(0.5, Some(1.0)), row(0.1, Some(3.0)), row(0.9, Some(2.0)), row(1.0, None)];
        let verdict = eta_verdict(&rows).unwrap();
        assert!(verdict.contains("from 0.1 to 0.5 smaller eta is not faster"), "{verdict}");
        assert!(verdict.contains("from 0.5 to 1 smaller eta is faster"), "{verdict}");
        assert!(eta_verdict(&rows[..1]).is_none());
    }
}

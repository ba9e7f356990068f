//! The scenario `faults`: each thing that can go wrong, by the row that `bess run faults` gives it. Rows hold what is true on
//! the grid, not what was measured.
#![cfg(feature = "host")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod case_support;

use case_support::*;
use serde::Deserialize;
use std::process::Command;
use std::sync::LazyLock;

#[derive(Clone, Debug, Deserialize)]
struct Row {
    label: String,
    from_s: f64,
    until_s: Option<f64>,
    omega_worst: f64,
    p_spread_during: f64,
    p_spread_after: f64,
    broken: Vec<String>,
    omega_set_jump: f64,
    V_set_jump: f64,
    P_set_jump: f64,
    P_set_sum: f64,
    converged_s: Option<f64>,
    cannot: Option<String>,
}

/// All rows, what the terminal shows, and the report, from one run of the command.
static RUN: LazyLock<(Vec<Row>, String, String)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let mut bess = Command::new(env!("CARGO_BIN_EXE_bess"));
    let output = bess.args(["run", "faults", "-o", "out"]).current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(folder.path().join("out/summary.json")).unwrap();
    let mut summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    let report = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    let shown = String::from_utf8(output.stdout).unwrap();
    (serde_json::from_value(summary["faults"].take()).unwrap(), shown, report)
});

/// The rows whose labels begin so, at least one; "the same" goes with the row before it.
fn rows(label: &str) -> Vec<Row> {
    let mut found = Vec::new();
    let mut belongs = false;
    for row in &RUN.0 {
        belongs = row.label.starts_with(label) || (belongs && row.label.starts_with("the same"));
        if belongs {
            found.push(row.clone());
        }
    }
    assert!(!found.is_empty(), "no trial {label}");
    for row in &found {
        println!("{row:?}");
    }
    found
}

/// Converges again, within so many seconds.
fn converges(row: &Row, within_s: f64) {
    let took = row.converged_s.unwrap_or_else(|| panic!("{}: does not converge", row.label));
    assert!(took <= within_s, "{}: {took} s", row.label);
}

#[test]
fn nothing_leaves_its_limits_and_no_setpoint_jumps() {
    for row in &RUN.0 {
        assert!(row.broken.is_empty(), "{}: {:?}", row.label, row.broken);
        // The rates of the scenario times its step: 0.05, 0.1 and 0.5 pu/s, 10 ms.
        assert!(row.omega_set_jump <= 5e-4 + 1e-12, "{}: {}", row.label, row.omega_set_jump);
        assert!(row.V_set_jump <= 1e-3 + 1e-12, "{}: {}", row.label, row.V_set_jump);
        assert!(row.P_set_jump <= 5e-3 + 1e-12, "{}: {}", row.label, row.P_set_jump);
        assert!(row.P_set_sum < 1e-9, "{}: sum of P_set {:e}", row.label, row.P_set_sum);
        assert!(row.omega_worst.is_finite() && row.p_spread_after.is_finite(), "{row:?}");
    }
}

#[test]
fn what_can_converge_does_and_what_cannot_says_why() {
    for row in &RUN.0 {
        assert!(row.converged_s.is_some() != row.cannot.is_some(), "{row:?}");
    }
}

#[test]
fn the_table_is_in_the_report_and_on_the_terminal() {
    let (rows, shown, report) = &*RUN;
    for row in rows {
        assert!(shown.contains(&row.label) && report.contains(&row.label), "{}", row.label);
    }
    assert!(shown.contains("converged again (s)") && report.contains("converged again (s)"));
}

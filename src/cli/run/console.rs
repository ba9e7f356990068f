//! What `bess run` prints: one row per phase, and where the rest is.

use super::results::Results;
use super::{comparison, faults};
use crate::report::{Phase, format_value};
use std::fmt::Write as _;
use std::path::Path;

/// The table and the folder.
pub fn table(results: &Results, folder: &Path, report: bool) -> String {
    let mut text =
        format!("\n{}: {} s in steps of {} s\n\n", results.scenario, results.simulated_s, results.step_s);
    let width = results.phases.iter().map(|p| p.name.chars().count()).max().unwrap_or(0).max(6);
    let _ = writeln!(
        text,
        "{:width$}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}",
        "from", "t", "|omega-1|", "K_P P", "K_Q Q", "SoC", "|V-1|", "settled", "T_omega"
    );
    let _ = writeln!(
        text,
        "{:width$}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}",
        "", "s", "worst", "spread", "spread", "spread", "worst", "s", "s"
    );
    for phase in &results.phases {
        row(&mut text, phase, width);
    }
    for variant in &results.variants {
        let _ = writeln!(text, "{}", variant.label);
        for phase in &variant.phases {
            row(&mut text, phase, width);
        }
    }
    if results.side_by_side.len() > 1 {
        text.push_str(&comparison::text(&results.side_by_side));
    }
    if !results.faults.is_empty() {
        text.push_str(&faults::text(&results.faults));
    }
    let options = &results.terms().options;
    let _ = writeln!(
        text,
        "\nWorst of the last {} s of each phase, pu. Settled: frequency and K_P P within {} until the next event.",
        options.window_s, options.omega_tolerance
    );
    let _ =
        writeln!(text, "Largest |sum of P_set| at any instant: {} pu.", figure(results.worst_sum_of_P_set));
    let _ = writeln!(
        text,
        "{:.0} times faster than real time ({:.3} s).",
        results.real_time_factor, results.wall_s
    );
    let files =
        if report { "trajectory.csv, summary.json, report.html" } else { "trajectory.csv, summary.json" };
    let _ = writeln!(text, "Results in {}: {files}", folder.display());
    text
}

fn row(text: &mut String, phase: &Phase, width: usize) {
    let settled = match (phase.omega_settled_s, phase.p_settled_s) {
        (Some(omega), Some(p)) => format!("{:.2}", omega.max(p)),
        _ => "no".into(),
    };
    let certified = phase.T_omega.map_or_else(|| "-".into(), |t| format!("{t:.2}"));
    let _ = writeln!(
        text,
        "{:width$}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {settled:>9}  {certified:>8}",
        phase.name,
        format!("{}-{}", format_value(phase.from_s, 6), format_value(phase.to_s, 6)),
        figure(phase.omega_error),
        figure(phase.p_spread),
        figure(phase.q_spread),
        figure(phase.e_spread),
        figure(phase.V_error),
    );
}

fn figure(value: f64) -> String {
    format!("{value:.1e}")
}

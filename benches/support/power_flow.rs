//! The power flow, cold and warm.

use super::{Options, case, option};
use bess_consensus::grid::{PowerFlowSolver, Start};
use serde_json::json;
use std::fmt::Write;
use std::time::Instant;

/// Solves and prints times.
pub fn power_flow(name: &str, options: &Options) -> Result<String, String> {
    let text = |e: bess_consensus::grid::GridError| e.to_string();
    let case = case(name)?;
    let solves: usize = option(options, "solves", 101)?;
    let factor: f64 = option(options, "factor", 1.1)?;
    let default = case.bus.iter().find(|bus| bus.kind == 1 && bus.pd > 0.0).map_or(0, |bus| bus.id);
    let id: u64 = option(options, "bus", default)?;
    let at = case.position(id).ok_or_else(|| format!("--bus {id}: not in {name}"))?;

    let begin = Instant::now();
    let mut solver = PowerFlowSolver::new(&case, Start::Case).map_err(text)?;
    let analysis_s = begin.elapsed().as_secs_f64();
    solver.set_tolerance(option(options, "tolerance", 1e-8)?).map_err(text)?;
    let begin = Instant::now();
    let cold = solver.solve().map_err(text)?;
    let cold_s = begin.elapsed().as_secs_f64();
    if let Some(file) = options.get("voltages") {
        let mut lines = String::new();
        for (b, bus) in case.bus.iter().enumerate() {
            writeln!(lines, "{} {} {}", bus.id, solver.vm(b), solver.va(b)).map_err(|e| e.to_string())?;
        }
        std::fs::write(file, lines).map_err(|e| format!("{file}: {e}"))?;
    }

    let (p, q) = solver.load(at);
    let (mut warm_s, mut iterations, mut pivoted) = (Vec::with_capacity(solves), 0, cold.pivoted);
    for k in 0..solves {
        let times = if k % 2 == 0 { factor } else { 1.0 };
        let begin = Instant::now();
        solver.set_load(at, p * times, q * times).map_err(text)?;
        let warm = solver.solve().map_err(text)?;
        warm_s.push(begin.elapsed().as_secs_f64());
        (iterations, pivoted) = (warm.iterations, pivoted + warm.pivoted);
    }
    let result = json!({
        "buses": case.bus.len(), "bus": id, "analysis_s": analysis_s, "cold_s": cold_s,
        "cold_iterations": cold.iterations, "mismatch_pu": cold.mismatch, "warm_s": warm_s,
        "warm_iterations": iterations, "pivoted": pivoted,
    });
    Ok(result.to_string())
}

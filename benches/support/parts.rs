//! What the parts of a communication step cost, each by itself.

use super::dynamics::{Started, started};
use super::{Options, option};
use bess_consensus::grid::GridError;
use serde_json::json;
use std::hint::black_box;
use std::time::Instant;

/// Length of a communication step, ns.
const STEP_NS: i64 = 10_000_000;

/// Median time of a call, us; the call is told its number.
fn median_us(repeats: usize, mut what: impl FnMut(usize) -> Result<(), GridError>) -> Result<f64, String> {
    let mut times = Vec::with_capacity(repeats);
    for k in 0..repeats {
        let begin = Instant::now();
        what(k).map_err(|e| e.to_string())?;
        times.push(begin.elapsed().as_secs_f64() * 1e6);
    }
    times.sort_unstable_by(f64::total_cmp);
    times.get(repeats / 2).copied().ok_or_else(|| "--repeats: found `0`; expected 1 or more".to_owned())
}

/// Repeats each part and prints its time.
pub fn parts(name: &str, options: &Options) -> Result<String, String> {
    let Started { mut model, new_s, initialise_s } = started(name, options)?;
    let repeats: usize = option(options, "repeats", 1000)?;
    let (n, loaded) = (model.n(), model.n_bus() / 2);
    let still_us = median_us(repeats, |_| model.step(0, STEP_NS))?;
    let moved_us = median_us(repeats, |k| {
        model.inputs_mut().omega_set[k % n] += if k % (2 * n) < n { 1e-5 } else { -1e-5 };
        model.step(0, STEP_NS)
    })?;
    let internal_steps = model.effort().accepted + model.effort().rejected;
    let read_us = median_us(repeats, |_| {
        model.refresh()?;
        black_box((model.bus_V(loaded), model.tie_P()));
        Ok(())
    })?;
    let rebuild_us = median_us(repeats, |k| {
        model.inputs_mut().dP_load[loaded] = 1e-6 * (k + 1) as f64;
        model.refresh()
    })?;
    let result = json!({
        "buses": model.n_bus(), "bess": n, "dense": model.is_dense(), "new_s": new_s,
        "initialise_s": initialise_s, "still_step_us": still_us, "moved_step_us": moved_us,
        "internal_steps": internal_steps, "read_buses_us": read_us, "rebuild_network_us": rebuild_us,
    });
    Ok(result.to_string())
}

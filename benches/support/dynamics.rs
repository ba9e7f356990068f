//! A grid with many batteries, simulated in communication steps.

use super::{Options, case, option};
use bess_consensus::grid::{
    Bess, Case, CaseSource, Config, GridModel, LoadModel, NetworkMethod, PowerFlow, Start, power_flow,
};
use faer::c64;
use serde_json::json;
use std::time::Instant;

/// A BESS at every bus that holds its voltage by a generator in service. Droop and reactance on the
/// system base follow from the rating: 2 % frequency droop, 5 % voltage droop, 0.1 pu reactance on it.
fn config(case: Case, most: usize) -> Result<Config, String> {
    let mut rating: std::collections::BTreeMap<u64, f64> = Default::default();
    for generator in case.generator.iter().filter(|g| g.status == 1) {
        *rating.entry(generator.bus).or_default() += generator.pg.abs().max(generator.pmax.abs().min(1e4));
    }
    let bess: Vec<Bess> = case
        .bus
        .iter()
        .filter(|bus| bus.kind == 2 || bus.kind == 3)
        .filter_map(|bus| Some((bus, *rating.get(&bus.id)?)))
        .take(most)
        .enumerate()
        .map(|(i, (bus, mva))| {
            let size = (1.2 * mva / case.base_mva).max(0.1);
            Bess {
                bus: bus.id,
                K_P: 0.02 / size,
                K_Q: 0.05 / size,
                X_c: 0.1 / size,
                E_start: 0.7 * size,
                omega_set_start: 1.0 + 1e-3 * ((i % 7) as f64 / 3.0 - 1.0),
                V_set_start: 1.02,
            }
        })
        .collect();
    if bess.is_empty() {
        return Err("no bus with a generator in service".into());
    }
    Ok(Config { bess, tie: None, case: CaseSource::Inline(Box::new(case)), ..Config::case57() })
}

/// Setpoints with which the power flow is the steady state, but for a spread of the frequency setpoints.
fn dispatch(model: &mut GridModel, config: &Config, flow: &PowerFlow, case: &Case) {
    for (i, bess) in config.bess.iter().enumerate() {
        let Some(k) = case.position(bess.bus) else { continue };
        let load = c64::new(case.bus[k].pd, case.bus[k].qd) / case.base_mva;
        let v = c64::from_polar(flow.vm[k], flow.va[k]);
        let current = ((flow.injection[k] + load) / v).conj();
        let source = v + c64::new(0.0, bess.X_c) * current;
        let power = source * current.conj();
        let inputs = model.inputs_mut();
        (inputs.P_set[i], inputs.Q_set[i], inputs.V_set[i]) = (power.re, power.im, source.norm());
    }
}

/// A grid in its steady state, and what it took to get there.
pub struct Started {
    /// The model.
    pub model: GridModel,
    /// Time to make it, s.
    pub new_s: f64,
    /// Time to find the steady state, s.
    pub initialise_s: f64,
}

/// The grid of a case under the options `--bess`, `--network` and `--load-model`.
pub fn started(name: &str, options: &Options) -> Result<Started, String> {
    let text = |e: bess_consensus::grid::GridError| e.to_string();
    let case = case(name)?;
    let flow = power_flow(&case, Start::Case).map_err(text)?;
    let mut config = config(case.clone(), option(options, "bess", usize::MAX)?)?;
    config.network = match options.get("network").map_or("auto", String::as_str) {
        "auto" => NetworkMethod::Auto,
        "kron" => NetworkMethod::Kron,
        "sparse" => NetworkMethod::Sparse,
        other => return Err(format!("--network: found `{other}`; expected auto, kron or sparse")),
    };
    config.load_model = match options.get("load-model").map_or("impedance", String::as_str) {
        "impedance" => LoadModel::Impedance,
        "constant-power" => LoadModel::ConstantPower,
        other => return Err(format!("--load-model: found `{other}`; expected impedance or constant-power")),
    };
    let begin = Instant::now();
    let mut model = GridModel::new(&config).map_err(text)?;
    let new_s = begin.elapsed().as_secs_f64();
    dispatch(&mut model, &config, &flow, &case);
    let begin = Instant::now();
    model.initialise().map_err(text)?;
    Ok(Started { model, new_s, initialise_s: begin.elapsed().as_secs_f64() })
}

/// Simulates and prints times.
pub fn dynamics(name: &str, options: &Options) -> Result<String, String> {
    let text = |e: bess_consensus::grid::GridError| e.to_string();
    let Started { mut model, new_s, initialise_s } = started(name, options)?;
    let step_ns = (option(options, "step-ms", 10.0)? * 1e6) as i64;
    let seconds: f64 = option(options, "seconds", 2.0)?;
    let steps = (seconds * 1e9 / step_ns as f64).round() as i64;
    let (mut step_s, mut internal, mut checksum) = (Vec::with_capacity(steps as usize), 0, 0.0);
    let loaded = model.n_bus() / 2;
    let begin = Instant::now();
    for k in 0..steps {
        let step_begin = Instant::now();
        if k == steps / 4 {
            (model.inputs_mut().dP_load[loaded], model.inputs_mut().dQ_load[loaded]) = (0.5, 0.2);
        }
        // A controller moves every setpoint in every step.
        let nudge = if k % 2 == 0 { 1e-6 } else { -1e-6 };
        model.inputs_mut().omega_set.iter_mut().for_each(|omega| *omega += nudge);
        model.refresh().map_err(text)?;
        model.step(k * step_ns, step_ns).map_err(text)?;
        internal += model.effort().accepted + model.effort().rejected;
        for b in 0..model.n_bus() {
            checksum += model.bus_V(b) + model.bus_angle(b);
        }
        step_s.push(step_begin.elapsed().as_secs_f64());
    }
    let total_s = begin.elapsed().as_secs_f64();
    let omega: Vec<f64> = (0..model.n()).map(|i| model.omega(i)).collect();
    let spread =
        omega.iter().copied().fold(f64::MIN, f64::max) - omega.iter().copied().fold(f64::MAX, f64::min);
    let result = json!({
        "buses": model.n_bus(), "bess": model.n(), "dense": model.is_dense(), "new_s": new_s,
        "initialise_s": initialise_s, "real_time": seconds / total_s, "internal_steps": internal,
        "communication_steps": steps, "omega_spread": spread, "checksum": checksum,
        "longest_step_s": step_s.iter().copied().fold(0.0, f64::max),
    });
    Ok(result.to_string())
}

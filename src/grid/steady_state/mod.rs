//! The synchronous steady state of given inputs, where a simulation starts: every measured power equals
//! the instantaneous one and every source turns at one frequency. Newton's method with the analytic
//! Jacobian of the droop equations (3) over the sparse network. Never integrates.

mod equations;

use super::bess::{omega, voltage};
use super::error::GridError;
use super::network::Network;
use super::state::{Inputs, Parameters};
use equations::Equations;
use faer::c64;

/// A synchronous steady state.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyState {
    /// Source angles, rad; the first one is 0 when the tie is open.
    pub delta: Vec<f64>,
    /// Source voltages, pu.
    pub V: Vec<f64>,
    /// Active powers, pu.
    pub P: Vec<f64>,
    /// Reactive powers, pu.
    pub Q: Vec<f64>,
    /// The common frequency, pu; 1 when the tie is closed.
    pub omega: f64,
}

const MAX_ITERATIONS: usize = 50;
const TOLERANCE: f64 = 1e-12;
/// Longest correction of an angle, rad, or of a voltage, pu, in one iteration.
const LONGEST: f64 = 0.5;

/// Solves `Omega = omega_set_i - K_P_i (p_i - P_set_i)`, `V_i = V_set_i - K_Q_i (q_i - Q_set_i)` for the
/// angles, the voltages and, with the tie open, Omega, over the linear part of the network.
pub fn steady_state(
    network: &Network,
    inputs: &Inputs,
    parameters: &Parameters,
) -> Result<SteadyState, GridError> {
    let n = inputs.omega_set.len();
    let islanded = !inputs.tie_closed;
    let mean = inputs.omega_set.iter().sum::<f64>() / n as f64;
    // From the angles of the power flow: in a large network they are far apart. Islanded, the first
    // source stands at 0; tied, the main grid does, near the tie's bus.
    let plant = network.plant();
    let reference = plant.tie.filter(|_| !islanded).map_or(plant.bess_bus[0], |(bus, _)| bus);
    let mut now = SteadyState {
        delta: plant.bess_bus.iter().map(|&bus| plant.angle[bus] - plant.angle[reference]).collect(),
        V: inputs.V_set.clone(),
        P: vec![0.0; n],
        Q: vec![0.0; n],
        omega: if islanded { mean } else { 1.0 },
    };
    let mut equations = Equations::new(network, islanded);
    let mut workspace = network.workspace();
    let mut residual = vec![[0.0; 2]; n];
    let mut correction = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        workspace.set_sources(now.V.iter().copied(), &now.delta);
        network.linear_voltages(&mut workspace);
        let E: Vec<c64> = (0..n).map(|i| c64::new(workspace.e_re[i], workspace.e_im[i])).collect();
        let S = network.source_powers(&E, &workspace.v);
        for i in 0..n {
            (now.P[i], now.Q[i]) = (S[i].re, S[i].im);
            let turning = omega(inputs.omega_set[i], parameters.K_P[i], now.P[i], inputs.P_set[i]);
            let held = voltage(inputs.V_set[i], parameters.K_Q[i], now.Q[i], inputs.Q_set[i]);
            residual[i] = [now.omega - turning, now.V[i] - held];
        }
        if correction < TOLERANCE {
            return Ok(now);
        }
        let Some((step, omega_step)) = equations.solve(network, &E, &S, &now.V, parameters, &residual) else {
            correction = f64::NAN;
            break;
        };
        correction = step
            .iter()
            .flatten()
            .chain([&omega_step])
            .fold(0.0, |worst: f64, x| if x.is_nan() { f64::INFINITY } else { worst.max(x.abs()) });
        if !correction.is_finite() {
            break;
        }
        let damping = (LONGEST / correction).min(1.0);
        now.omega -= damping * omega_step;
        for i in 0..n {
            now.delta[i] -= damping * step[i][0];
            now.V[i] -= damping * step[i][1];
        }
    }
    let hint = if parameters.K_P.contains(&0.0) {
        "a K_P of 0 leaves the power of that BESS undetermined, or unlimited; use a small positive droop"
    } else {
        "check omega_set, V_set, P_set and Q_set, and whether the network can carry these powers"
    };
    Err(GridError::SteadyState { iterations: MAX_ITERATIONS, correction, hint })
}

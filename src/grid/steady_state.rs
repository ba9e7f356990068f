//! The synchronous steady state of given inputs, where a simulation starts: every measured power equals
//! the instantaneous one and every source turns at one frequency. Newton's method with the analytic
//! Jacobian of the droop equations (3) over the reduced network. Never integrates.

use super::bess::{omega, voltage};
use super::error::GridError;
use super::state::{Inputs, Parameters};
use faer::linalg::solvers::Solve;
use faer::{Col, Mat, c64};

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
/// angles, the voltages and, with the tie open, Omega. `Y` is n x (n + 1), row after row, the main grid
/// (1 pu at angle 0) last.
pub fn steady_state(Y: &[c64], inputs: &Inputs, parameters: &Parameters) -> Result<SteadyState, GridError> {
    let n = inputs.omega_set.len();
    let islanded = !inputs.tie_closed;
    let mean = inputs.omega_set.iter().sum::<f64>() / n as f64;
    let mut now = SteadyState {
        delta: vec![0.0; n],
        V: inputs.V_set.clone(),
        P: vec![0.0; n],
        Q: vec![0.0; n],
        omega: if islanded { mean } else { 1.0 },
    };
    let mut correction = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let E: Vec<c64> = (0..n).map(|i| c64::from_polar(now.V[i], now.delta[i])).collect();
        let I: Vec<c64> = (0..n)
            .map(|i| {
                let row = &Y[i * (n + 1)..(i + 1) * (n + 1)];
                row[..n].iter().zip(&E).map(|(y, e)| y * e).sum::<c64>() + row[n]
            })
            .collect();
        let mut residual = Col::<f64>::zeros(2 * n);
        for i in 0..n {
            let S = E[i] * I[i].conj();
            (now.P[i], now.Q[i]) = (S.re, S.im);
            residual[i] =
                now.omega - omega(inputs.omega_set[i], parameters.K_P[i], now.P[i], inputs.P_set[i]);
            residual[n + i] =
                now.V[i] - voltage(inputs.V_set[i], parameters.K_Q[i], now.Q[i], inputs.Q_set[i]);
        }
        if correction < TOLERANCE {
            return Ok(now);
        }
        let step = jacobian(Y, &E, &I, &now.V, parameters, islanded).partial_piv_lu().solve(&residual);
        correction = step
            .iter()
            .fold(0.0, |worst: f64, x| if x.is_nan() { f64::INFINITY } else { worst.max(x.abs()) });
        if !correction.is_finite() {
            break;
        }
        let damping = (LONGEST / correction).min(1.0);
        for i in 0..n {
            if islanded && i == 0 {
                now.omega -= damping * step[0];
            } else {
                now.delta[i] -= damping * step[i];
            }
            now.V[i] -= damping * step[n + i];
        }
    }
    let hint = if parameters.K_P.contains(&0.0) {
        "a K_P of 0 leaves the power of that BESS undetermined, or unlimited; use a small positive droop"
    } else {
        "check omega_set, V_set, P_set and Q_set, and whether the network can carry these powers"
    };
    Err(GridError::SteadyState { iterations: MAX_ITERATIONS, correction, hint })
}

/// d residual / d (angles, voltages); islanded, the first angle's column is that of Omega.
fn jacobian(Y: &[c64], E: &[c64], I: &[c64], V: &[f64], parameters: &Parameters, islanded: bool) -> Mat<f64> {
    let n = E.len();
    Mat::from_fn(2 * n, 2 * n, |row, column| {
        let (i, j) = (row % n, column % n);
        if islanded && column == 0 {
            return if row < n { 1.0 } else { 0.0 };
        }
        // S_i = E_i conj(sum_j Y_ij E_j), E_j = V_j exp(j delta_j).
        let t = E[i] * (Y[i * (n + 1) + j] * E[j]).conj();
        let own = if i == j { E[i] * I[i].conj() } else { c64::ZERO };
        let dS = if column < n { c64::new(0.0, 1.0) * (own - t) } else { (own + t) / V[j] };
        if row < n {
            parameters.K_P[i] * dS.re
        } else {
            let of_V = if column == row { 1.0 } else { 0.0 };
            of_V + parameters.K_Q[i] * dS.im
        }
    })
}

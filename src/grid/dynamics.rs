//! The right-hand side of the grid model: sources, filters, angles and batteries over the network.
//! The state vector is [delta | P | Q | E], n each. Never chooses a step size.

use super::bess::{angle_rate, energy_rate, omega, power_filter, voltage};
use super::integrator::Dynamics;
use super::network::Network;
use super::state::{Inputs, Parameters};
use super::workspace::Workspace;

/// Powers beyond which a simulation has run away, pu.
pub(super) const RUN_AWAY_PU: f64 = 1e6;

/// The grid with its inputs held.
pub struct Grid<'a> {
    /// The network under the present loads and tie.
    pub network: &'a Network,
    /// Memory for it.
    pub workspace: &'a mut Workspace,
    /// Inputs.
    pub inputs: &'a Inputs,
    /// Parameters.
    pub parameters: &'a Parameters,
    /// 2 pi times the nominal frequency, rad/s.
    pub omega_b: f64,
}

impl Dynamics for Grid<'_> {
    #[inline(always)]
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) -> bool {
        let n = y.len() / 4;
        let (u, k, ws) = (self.inputs, self.parameters, &mut *self.workspace);
        // Slices of one known length: no check of an index is left in the loops.
        let (delta, P, Q) = (&y[..n], &y[n..2 * n], &y[2 * n..3 * n]);
        let (V_set, Q_set, K_Q) = (&u.V_set[..n], &u.Q_set[..n], &k.K_Q[..n]);
        let (omega_set, P_set, K_P) = (&u.omega_set[..n], &u.P_set[..n], &k.K_P[..n]);
        ws.set_sources((0..n).map(|i| voltage(V_set[i], K_Q[i], Q[i], Q_set[i])), delta);
        if self.network.currents(ws).is_err() {
            return false;
        }
        let (d_delta, rest) = dy.split_at_mut(n);
        let (d_P, rest) = rest.split_at_mut(n);
        let (d_Q, d_E) = rest.split_at_mut(n);
        let (d_delta, d_E) = (&mut d_delta[..n], &mut d_E[..n]);
        for i in 0..n {
            d_delta[i] = angle_rate(omega(omega_set[i], K_P[i], P[i], P_set[i]), self.omega_b);
        }
        ws.find_powers();
        let (p, q) = (&ws.p[..n], &ws.q[..n]);
        for i in 0..n {
            d_P[i] = power_filter(p[i], P[i], k.omega_c);
            d_Q[i] = power_filter(q[i], Q[i], k.omega_c);
            d_E[i] = energy_rate(p[i]);
        }
        true
    }

    #[inline(always)]
    fn scale(&self, k: usize, value: f64) -> f64 {
        // Angles turn without bound, their errors matter against one radian.
        if k < self.inputs.omega_set.len() { 1.0 } else { value }
    }

    #[inline(always)]
    fn plausible(&self, y: &[f64]) -> bool {
        let n = y.len() / 4;
        y[n..3 * n].iter().all(|x| x.abs() < RUN_AWAY_PU)
    }
}

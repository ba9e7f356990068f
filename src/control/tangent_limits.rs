//! What the limits make of rates: `saturation` in dual numbers. What an agent owes and has learnt is held.

use super::controller::Controller;
use super::delay::Signals;
use super::limits::{hold_back, restrict, room};
use super::relay::split;
use super::saturation::time_constant_s;
use super::scalar::{Dual, Scalar};
use super::tangent::{Direction, Tangents};

impl Controller {
    /// As `Controller::relay`, of u_P and u_Q.
    pub(super) fn relay_rates(&self, signals: &Signals<Dual>, inputs: [&mut Vec<Dual>; 2], h_s: f64) {
        if !self.fixed.limits.power {
            return;
        }
        let lags = [&self.state.lags.frequency, &self.state.lags.voltage];
        for (k, (u, lag)) in inputs.into_iter().zip(lags).enumerate() {
            let theta_s = time_constant_s(lag, h_s);
            for (i, u) in u.iter_mut().enumerate() {
                let (x, range) = self.powers(signals, i)[k];
                let owed = Dual::constant(self.state.owed[k][i]);
                *u = split(*u, owed, room(x, range), h_s, theta_s).done;
            }
        }
    }

    /// As `Controller::limit`.
    pub(super) fn limit_rates(&self, direction: Direction, h_s: f64, tangents: &mut Tangents) {
        let (parameters, outputs, limits) = (&self.state.parameters, &self.state.outputs, &self.fixed.limits);
        let lags = &self.state.lags;
        for i in (0..self.agents()).filter(|&i| self.topology.live[i]) {
            let (omega_rate, V_rate) = self.setpoint_rates(direction, i);
            let Tangents { u: [u_omega, _, _, u_V, _], signals, .. } = &mut *tangents;
            if limits.power {
                let [(P, P_range), (Q, Q_range)] = self.powers(signals, i);
                let per_s = Dual::constant(parameters.K_P[i] / time_constant_s(&lags.frequency, h_s));
                u_omega[i] = hold_back(u_omega[i], P, P_range, per_s);
                let share = self.state.authority[i].learn(Q, Q_range);
                let T_s = Dual::constant(time_constant_s(&lags.voltage, h_s));
                let per_s = Dual::constant(parameters.K_Q[i]) / (share * T_s);
                u_V[i] = hold_back(u_V[i], Q, Q_range, per_s);
            }
            let setpoint = Dual::new(outputs.omega_set[i], omega_rate);
            u_omega[i] =
                restrict(u_omega[i], limits.omega_set_rate[i], setpoint, limits.omega_set_range, h_s);
            let setpoint = Dual::new(outputs.V_set[i], V_rate);
            u_V[i] = restrict(u_V[i], limits.V_set_rate[i], setpoint, limits.V_set_range, h_s);
        }
    }
}

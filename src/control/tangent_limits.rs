//! What the limits make of rates: `saturation` in dual numbers. What an agent owes and has learnt is held.

use super::controller::Controller;
use super::delay::{Quantity, Signals};
use super::limits::{hold_back, restrict, room};
use super::relay::split;
use super::saturation::time_constant_s;
use super::scalar::{Dual, Scalar};
use super::tangent::{Direction, Tangents};

impl Controller {
    /// What an agent tells of a power, less what it owes.
    pub(super) fn own(&self, signals: &Signals<Dual>, quantity: Quantity, i: usize) -> Dual {
        let owed = |k: usize| Dual::constant(self.state.owed[k].get(i).copied().unwrap_or(0.0));
        match quantity {
            Quantity::P => signals.of(quantity)[i] - owed(0),
            Quantity::Q => signals.of(quantity)[i] - owed(1),
            _ => signals.of(quantity)[i],
        }
    }

    /// As `Controller::powers`.
    fn power_rates(&self, i: usize, signals: &Signals<Dual>) -> [(Dual, (Dual, Dual)); 2] {
        let (parameters, outputs, limits) = (&self.state.parameters, &self.state.outputs, &self.fixed.limits);
        let c = Dual::constant;
        let P = self.own(signals, Quantity::P, i) / c(parameters.K_P[i]) + c(outputs.P_set[i]);
        let Q = self.own(signals, Quantity::Q, i) / c(parameters.K_Q[i]) + c(outputs.Q_set[i]);
        let Q_limit = limits.Q_limit(i, P);
        [(P, limits.P_range(i, signals.of(Quantity::Soc)[i])), (Q, (-Q_limit, Q_limit))]
    }

    /// As `Controller::relay`, of u_P and u_Q.
    pub(super) fn relay_rates(&self, signals: &Signals<Dual>, inputs: [&mut Vec<Dual>; 2], h_s: f64) {
        if !self.fixed.limits.power {
            return;
        }
        let lags = [&self.state.lags.frequency, &self.state.lags.voltage];
        for (k, (u, lag)) in inputs.into_iter().zip(lags).enumerate() {
            let theta_s = time_constant_s(lag, h_s);
            for (i, u) in u.iter_mut().enumerate() {
                let (x, range) = self.power_rates(i, signals)[k];
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
                let [(P, P_range), (Q, Q_range)] = self.power_rates(i, signals);
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

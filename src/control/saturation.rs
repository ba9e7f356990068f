//! What the limits do to an evaluation: how much room each agent has, what of its inputs it passes on instead
//! of doing it, and what is left of the rates of its setpoints. Turns inputs; never sets a setpoint.

use super::authority::Authority;
use super::controller::Controller;
use super::delay::{Quantity, Signals};
use super::lag::Lag;
use super::limits::{hold_back, recovery, restrict, room};
use super::relay::{Split, split};
use super::scalar::Scalar;

/// A power, and the least and largest that it may be, pu.
type Bounded<S> = (S, (S, S));

impl Controller {
    /// What agent `i` tells of a quantity, less what it owes.
    pub(super) fn own<S: Scalar>(&self, signals: &Signals<S>, quantity: Quantity, i: usize) -> S {
        let told = signals.of(quantity)[i];
        let owed = match quantity {
            Quantity::P => self.state.owed[0].get(i),
            Quantity::Q => self.state.owed[1].get(i),
            _ => None,
        };
        owed.map_or(told, |&owed| told - S::constant(owed))
    }

    /// P and Q of agent `i`, each with its bounds: the powers that the limits are about.
    pub(super) fn powers<S: Scalar>(&self, signals: &Signals<S>, i: usize) -> [Bounded<S>; 2] {
        let c = S::constant;
        let (parameters, outputs, limits) = (&self.state.parameters, &self.state.outputs, &self.fixed.limits);
        let P = self.own(signals, Quantity::P, i) / c(parameters.K_P[i]) + c(outputs.P_set[i]);
        let Q = self.own(signals, Quantity::Q, i) / c(parameters.K_Q[i]) + c(outputs.Q_set[i]);
        let Q_limit = limits.Q_limit(i, P);
        [(P, limits.P_range(i, signals.of(Quantity::Soc)[i])), (Q, (-Q_limit, Q_limit))]
    }

    /// How far each agent is from its limits.
    pub(super) fn find_room(&mut self) {
        if !self.fixed.limits.power {
            return;
        }
        for i in 0..self.agents() {
            let [(P, P_range), (Q, Q_range)] = self.powers(&self.scratch.signals, i);
            let ((up_P, down_P), (up_Q, down_Q)) = (room(P, P_range), room(Q, Q_range));
            for (k, value) in [up_P, down_P, up_Q, down_Q].into_iter().enumerate() {
                self.scratch.room[k][i] = value;
            }
        }
    }

    /// Leaves of u_P and u_Q what each agent has room for; the rest it owes.
    pub(super) fn relay(&mut self, h_s: f64) {
        if !self.fixed.limits.power {
            return;
        }
        let (state, scratch) = (&mut self.state, &mut self.scratch);
        let inputs = [&mut state.outputs.u_P, &mut state.outputs.u_Q];
        for (k, (u, lag)) in inputs.into_iter().zip([&state.lags.frequency, &state.lags.voltage]).enumerate()
        {
            let theta_s = time_constant_s(lag, h_s);
            for i in 0..u.len() {
                let room = (scratch.room[2 * k][i], scratch.room[2 * k + 1][i]);
                let Split { done, owed } = split(u[i], state.owed[k][i], room, h_s, theta_s);
                u[i] = done;
                scratch.owed[k][i] = owed;
            }
        }
    }

    /// Anti-windup, rates and ranges of the live agents' setpoints.
    pub(super) fn limit(&mut self, h_s: f64) {
        for i in 0..self.agents() {
            if !self.topology.live[i] {
                self.rest(i);
                continue;
            }
            let (mut u_omega, mut u_V) = (self.state.outputs.u_omega[i], self.state.outputs.u_V[i]);
            let mut at_limit = false;
            if self.fixed.limits.power {
                (u_omega, u_V, at_limit) = self.hold_back(i, h_s);
            }
            let (outputs, limits) = (&self.state.outputs, &self.fixed.limits);
            let (rate, range) = (limits.omega_set_rate[i], limits.omega_set_range);
            u_omega = restrict(u_omega, rate, outputs.omega_set[i], range, h_s);
            let (rate, range) = (limits.V_set_rate[i], limits.V_set_range);
            let slowed = restrict(u_V, rate, outputs.V_set[i], range, h_s);
            if let (true, Some(learnt)) = (slowed != u_V, self.scratch.authority.get_mut(i)) {
                // How fast the power goes then is the ramp's doing.
                *learnt = learnt.at_rest();
            }
            let outputs = &mut self.state.outputs;
            outputs.saturated[i] = at_limit || u_omega != outputs.u_omega[i] || slowed != outputs.u_V[i];
            (outputs.u_omega[i], outputs.u_V[i]) = (u_omega, slowed);
        }
    }

    /// An agent that does not act owes nothing, and learns nothing until it does.
    pub(super) fn rest(&mut self, i: usize) {
        for owed in &mut self.scratch.owed {
            owed.get_mut(i).into_iter().for_each(|owed| *owed = 0.0);
        }
        if let (Some(next), Some(known)) = (self.scratch.authority.get_mut(i), self.state.authority.get(i)) {
            *next = known.at_rest();
        }
    }

    /// u_omega and u_V of agent `i` that keep its powers within their bounds, and whether one is at its bound.
    fn hold_back(&mut self, i: usize, h_s: f64) -> (f64, f64, bool) {
        let (parameters, outputs, lags) = (&self.state.parameters, &self.state.outputs, &self.state.lags);
        let [(P, P_range), (Q, Q_range)] = self.powers(&self.scratch.signals, i);
        let per_s = parameters.K_P[i] / time_constant_s(&lags.frequency, h_s);
        let u_omega = hold_back(outputs.u_omega[i], P, P_range, per_s);
        let T_s = time_constant_s(&lags.voltage, h_s);
        let share = self.state.authority[i].learn(Q, Q_range);
        let u_V = hold_back(outputs.u_V[i], Q, Q_range, parameters.K_Q[i] / (share * T_s));
        self.scratch.authority[i] = Authority::of_step(share, (Q, Q_range), u_V - outputs.u_V[i], h_s / T_s);
        // What was to be done and is not, is owed on.
        for (k, held, whole, u) in
            [(0, u_omega, outputs.u_omega[i], outputs.u_P[i]), (1, u_V, outputs.u_V[i], outputs.u_Q[i])]
        {
            let cut = (whole - held).clamp(u.min(0.0), u.max(0.0));
            self.scratch.owed[k][i] += h_s * cut;
        }
        let rooms = &self.scratch.room;
        let shut = rooms.iter().any(|room| room[i] == 0.0);
        let owes = |k: usize| {
            let owed = self.scratch.owed[k][i];
            owed > 0.0 && rooms[2 * k][i] < 1.0 || owed < 0.0 && rooms[2 * k + 1][i] < 1.0
        };
        (u_omega, u_V, shut || owes(0) || owes(1))
    }
}

/// Time constant of what brings a power back inside its limits, s.
pub(super) fn time_constant_s(lag: &Lag, h_s: f64) -> f64 {
    recovery(lag.loop_steps() * h_s)
}

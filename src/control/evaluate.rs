//! What follows the inputs at once: the signals, the five inputs of the paper after limits, the energy
//! exchange that a step would set, the diagnostics. Writes outputs and scratch, never setpoints or memory.

use super::config::{Discretisation, VoltagePolicy};
use super::controller::Controller;
use super::delay::Quantity;
use super::discretisation::{Flow, SignPower, boundary_layer};
use super::estimator::estimates;
use super::exchange::setpoints;
use super::lag::{Lag, no_load};
use super::limits::{hold_back, restrict, room};
use super::network::Room;
use super::protocol::{View, active_power, average_voltage, energy, frequency, reactive_power, voltage};
use super::time::seconds;

/// Least boundary layer with `voltage_policy = "average"`, as a share of the longest delay. An agent that goes to
/// where its neighbours were tau ago at once (theta = h, h far below tau) makes two halves of an even graph take
/// turns, damped by nothing but theta; that goes on for the longer, the finer the steps, and what it stirs in
/// P and Q the average voltage has to follow. Where the layer grows with the delay, the run does not depend on the
/// step. From 1/30 the turns linger, beyond 1/10 the sharing itself is slow; in between it hardly matters.
const DELAY_LAYER: f64 = 1.0 / 20.0;

/// A power, and the least and largest that it may be.
type Bounded = (f64, (f64, f64));

impl Controller {
    /// Evaluates everything at `now_ns` for a step of `h_ns`.
    pub(super) fn evaluate(&mut self, now_ns: i64, h_ns: i64) {
        let h_s = seconds(h_ns);
        self.measure(now_ns);
        let clock = self.state.clock;
        self.network.listen(
            &self.state.history,
            (now_ns, clock.samples),
            &self.fixed.channel,
            &self.state.received_ns,
            &mut self.scratch.received_ns,
        );
        self.state.outputs.saturated.fill(false);
        if self.state.adopted.enable {
            self.laws(h_s);
            self.limit(h_s);
            self.exchange(h_s);
        } else {
            let outputs = &mut self.state.outputs;
            for u in
                [&mut outputs.u_omega, &mut outputs.u_P, &mut outputs.u_E, &mut outputs.u_V, &mut outputs.u_Q]
            {
                u.fill(0.0);
            }
        }
        self.diagnose();
    }

    /// The signals that the agents work with and tell each other, filtered where asked.
    fn measure(&mut self, now_ns: i64) {
        let (state, scratch) = (&self.state, &mut self.scratch);
        let (inputs, parameters, outputs) = (&state.inputs, &state.parameters, &state.outputs);
        let n = inputs.P.len();
        let signals = &mut scratch.signals;
        signals.of_mut(Quantity::Omega).copy_from_slice(&inputs.omega);
        signals.of_mut(Quantity::V).copy_from_slice(&inputs.V);
        // The bare law is there to compare with.
        let up_to_date = parameters.discretisation == Discretisation::Capped;
        for i in 0..n {
            if up_to_date {
                let sigma = no_load(outputs.omega_set[i], parameters.K_P[i], outputs.P_set[i]);
                signals.of_mut(Quantity::Omega)[i] += state.lags.frequency.unseen(i, sigma);
                let sigma = no_load(outputs.V_set[i], parameters.K_Q[i], outputs.Q_set[i]);
                signals.of_mut(Quantity::V)[i] += state.lags.voltage.unseen(i, sigma);
            }
            signals.of_mut(Quantity::P)[i] = parameters.K_P[i] * (inputs.P[i] - outputs.P_set[i]);
            signals.of_mut(Quantity::Q)[i] = parameters.K_Q[i] * (inputs.Q[i] - outputs.Q_set[i]);
            signals.of_mut(Quantity::Soc)[i] = inputs.E[i] / parameters.capacity[i];
        }
        if !scratch.filtered.is_empty() {
            let filter = self.fixed.filter;
            let elapsed_s = seconds((now_ns - state.clock.sampled_ns).max(0));
            for (k, (quantity, constant_s)) in [
                (Quantity::Omega, filter.omega_s),
                (Quantity::P, filter.P_s),
                (Quantity::V, filter.V_s),
                (Quantity::Q, filter.Q_s),
                (Quantity::Soc, filter.E_s),
            ]
            .into_iter()
            .enumerate()
            {
                // The exact response of a first-order lag to a held measurement.
                let share = if constant_s > 0.0 { -(-elapsed_s / constant_s).exp_m1() } else { 1.0 };
                let values = signals.of_mut(quantity);
                for i in 0..n {
                    if state.clock.samples > 0 {
                        let last = state.filtered[k * n + i];
                        values[i] = last + share * (values[i] - last);
                    }
                }
                scratch.filtered[k * n..(k + 1) * n].copy_from_slice(values);
            }
        }
        let [_, _, V, _, _, vbar] = &mut signals.0;
        match parameters.voltage_policy {
            VoltagePolicy::Average => estimates(&self.network, &state.transfers, V, vbar),
            VoltagePolicy::Paper => vbar.copy_from_slice(V),
        }
    }

    /// A flow law of one quantity for a step of `h_s`, its measurements late by `lag`.
    pub(super) fn flow(&self, gain: f64, lag: &Lag, h_s: f64) -> Flow {
        let parameters = &self.state.parameters;
        let least_s = match parameters.voltage_policy {
            VoltagePolicy::Average => {
                parameters.theta_min.max(DELAY_LAYER * seconds(self.network.longest_delay_ns()))
            }
            VoltagePolicy::Paper => parameters.theta_min,
        };
        let theta_s = boundary_layer(parameters.discretisation, lag.widening() * h_s, least_s);
        Flow::new(self.power(), gain, theta_s)
    }

    fn power(&self) -> SignPower {
        SignPower::new(self.fixed.law, self.state.parameters.eta)
    }

    /// (9), (10), (12), (13).
    fn laws(&mut self, h_s: f64) {
        self.find_room();
        let parameters = &self.state.parameters;
        let lags = &self.state.lags;
        let [flow_omega, flow_P] =
            [parameters.gain_omega, parameters.gain_P].map(|gain| self.flow(gain, &lags.frequency, h_s));
        let [flow_V, flow_Q] =
            [parameters.gain_V, parameters.gain_Q].map(|gain| self.flow(gain, &lags.voltage, h_s));
        let (inputs, outputs) = (&self.state.inputs, &mut self.state.outputs);
        let view =
            View { network: &self.network, history: &self.state.history, signals: &self.scratch.signals };
        let [up_P, down_P, up_Q, down_Q] = &self.scratch.room;
        let limited = self.fixed.limits.power;
        let room_P = limited.then_some(Room { up: up_P, down: down_P });
        let room_Q = limited.then_some(Room { up: up_Q, down: down_Q });
        let dispatch = inputs.dispatch.then_some(inputs.P_ref);
        active_power(view, &flow_P, dispatch, room_P, &mut outputs.u_P);
        reactive_power(view, &flow_Q, room_Q, &mut outputs.u_Q);
        frequency(view, &flow_omega, &outputs.u_P, inputs.omega_ref, &mut outputs.u_omega);
        match parameters.voltage_policy {
            VoltagePolicy::Paper => voltage(view, &flow_V, &outputs.u_Q, inputs.V_ref, &mut outputs.u_V),
            VoltagePolicy::Average => {
                average_voltage(view, &flow_V, &outputs.u_Q, inputs.V_ref, &mut outputs.u_V);
            }
        }
    }

    /// P and Q of agent `i`, each with its bounds: the powers that the limits are about.
    fn powers(&self, i: usize) -> [Bounded; 2] {
        let (signals, parameters, limits) =
            (&self.scratch.signals, &self.state.parameters, &self.fixed.limits);
        let P = signals.of(Quantity::P)[i] / parameters.K_P[i] + self.state.outputs.P_set[i];
        let Q = signals.of(Quantity::Q)[i] / parameters.K_Q[i] + self.state.outputs.Q_set[i];
        let Q_limit = limits.Q_limit(i, P);
        [(P, limits.P_range(i, signals.of(Quantity::Soc)[i])), (Q, (-Q_limit, Q_limit))]
    }

    fn find_room(&mut self) {
        if !self.fixed.limits.power {
            return;
        }
        for i in 0..self.agents() {
            let [(P, P_range), (Q, Q_range)] = self.powers(i);
            let ((up_P, down_P), (up_Q, down_Q)) = (room(P, P_range), room(Q, Q_range));
            for (k, value) in [up_P, down_P, up_Q, down_Q].into_iter().enumerate() {
                self.scratch.room[k][i] = value;
            }
        }
    }

    /// Anti-windup, rates and ranges of the live agents' setpoints.
    fn limit(&mut self, h_s: f64) {
        for i in 0..self.agents() {
            if !self.topology.live[i] {
                continue;
            }
            let (parameters, outputs, limits) =
                (&self.state.parameters, &self.state.outputs, &self.fixed.limits);
            let (mut u_omega, mut u_V) = (outputs.u_omega[i], outputs.u_V[i]);
            if limits.power {
                let [(P, P_range), (Q, Q_range)] = self.powers(i);
                u_omega = hold_back(u_omega, P, P_range, parameters.K_P[i], h_s);
                u_V = hold_back(u_V, Q, Q_range, parameters.K_Q[i], h_s);
            }
            let (rate, range) = (limits.omega_set_rate[i], limits.omega_set_range);
            u_omega = restrict(u_omega, rate, outputs.omega_set[i], range, h_s);
            let (rate, range) = (limits.V_set_rate[i], limits.V_set_range);
            u_V = restrict(u_V, rate, outputs.V_set[i], range, h_s);
            let closed = self.scratch.room.iter().any(|room| room[i] == 0.0);
            let outputs = &mut self.state.outputs;
            outputs.saturated[i] = u_omega != outputs.u_omega[i] || u_V != outputs.u_V[i] || closed;
            (outputs.u_omega[i], outputs.u_V[i]) = (u_omega, u_V);
        }
    }

    /// (11): the flows and P_set that a step of `h_s` would set, and u_E.
    fn exchange(&mut self, h_s: f64) {
        let parameters = &self.state.parameters;
        // theta_E is part of the exchange, not of its sampling: the bare law keeps it.
        let theta_s = match parameters.discretisation {
            Discretisation::Capped => (self.state.lags.frequency.loop_steps() * h_s).max(parameters.theta_E),
            Discretisation::Explicit => parameters.theta_E,
        };
        let mut flows = std::mem::take(&mut self.scratch.flows);
        let mut saturated = std::mem::take(&mut self.state.outputs.saturated);
        let mut P_set = std::mem::take(&mut self.scratch.P_set);
        self.exchange_of(self.power(), theta_s, h_s).flows(
            &self.network,
            &self.state.history,
            &self.scratch.signals,
            &self.state.flows,
            &mut flows,
            &mut saturated,
        );
        let live = &self.topology.live;
        setpoints(&self.network, &flows, &self.state.held, |i| live[i], &mut P_set);
        energy(&P_set, &self.state.parameters.capacity, &mut self.state.outputs.u_E);
        for (u, _) in self.state.outputs.u_E.iter_mut().zip(live).filter(|(_, live)| !**live) {
            *u = 0.0;
        }
        (self.scratch.flows, self.state.outputs.saturated, self.scratch.P_set) = (flows, saturated, P_set);
    }

    /// Spreads, errors and certified times, from the present signals.
    fn diagnose(&mut self) {
        let available = &self.state.adopted.available;
        let (signals, inputs) = (&self.scratch.signals, &self.state.inputs);
        let of_available =
            |q: Quantity| signals.of(q).iter().zip(available).filter(|(_, a)| **a).map(|(&x, _)| x);
        let spread = |q: Quantity| {
            let (low, high) = of_available(q)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (x.min(low), x.max(high)));
            if low <= high { high - low } else { 0.0 }
        };
        let error =
            |q: Quantity, reference: f64| of_available(q).fold(0.0, |e: f64, x| e.max((x - reference).abs()));
        let live = &self.topology.live;
        let of_live = |q: Quantity| signals.of(q).iter().zip(live).filter(|(_, l)| **l).map(|(&x, _)| x);
        let norm = |q: Quantity, about: f64| of_live(q).map(|x| (x - about).powi(2)).sum::<f64>().sqrt();
        let goal_P = if inputs.dispatch {
            inputs.P_ref
        } else {
            of_live(Quantity::P).sum::<f64>() / of_live(Quantity::P).count().max(1) as f64
        };
        let eta = self.state.parameters.eta;
        let T_P = self.spectrum.P.settling_time(norm(Quantity::P, goal_P), eta);
        let T_omega = self.spectrum.omega.settling_time(norm(Quantity::Omega, inputs.omega_ref), eta);
        let (spread_P, spread_Q, spread_E) =
            (spread(Quantity::P), spread(Quantity::Q), spread(Quantity::Soc));
        let (error_omega, error_V) =
            (error(Quantity::Omega, inputs.omega_ref), error(Quantity::V, inputs.V_ref));
        let outputs = &mut self.state.outputs;
        (outputs.spread_P, outputs.spread_Q, outputs.spread_E) = (spread_P, spread_Q, spread_E);
        (outputs.error_omega, outputs.error_V) = (error_omega, error_V);
        (outputs.lambda_2, outputs.T_P, outputs.T_omega) = (self.spectrum.lambda_2, T_P, T_omega);
    }
}

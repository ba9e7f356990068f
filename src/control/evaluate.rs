//! What follows the inputs at once: the signals, the five inputs of the paper after limits, the energy
//! exchange that a step would set, the diagnostics. Writes outputs and scratch, never setpoints or memory.

use super::config::{Discretisation, MeasurementFilter, VoltagePolicy};
use super::controller::Controller;
use super::delay::Quantity;
use super::diagnosis::{CHUNK, Diagnosis, Seen};
use super::discretisation::{Flow, SignPower, boundary_layer};
use super::estimator::estimates;
use super::exchange::{HeldLink, ramp, setpoints};
use super::fade::share;
use super::lag::{Lag, no_load};
use super::network::{Hearing, Lateness};
use super::protocol::{View, active_power, average_voltage, energy, frequency, reactive_power, voltage};
use super::scalar::Scalar;
use super::time::seconds;

/// Time in which a battery's power follows a new P_set, s: its power filter and its angle, rather more than
/// they take.
const FOLLOWING_S: f64 = 0.25;
/// Time constant of the share of the load, in steps until an action shows.
const SHARE_LOOPS: f64 = 2.0;
/// Least boundary layer with `voltage_policy = "average"`, as a share of the longest delay. An agent that goes to
/// where its neighbours were tau ago at once (theta = h, h far below tau) makes two halves of an even graph take
/// turns, damped by nothing but theta; that goes on for the longer, the finer the steps, and what it stirs in
/// P and Q the average voltage has to follow. Where the layer grows with the delay, the run does not depend on the
/// step. From 1/30 the turns linger, beyond 1/10 the sharing itself is slow; in between it hardly matters.
const DELAY_LAYER: f64 = 1.0 / 20.0;

/// The filtered signals in the order of the state's `filtered`, each with its time constant, s.
pub(super) fn filters(filter: &MeasurementFilter) -> [(Quantity, f64); 5] {
    [
        (Quantity::Omega, filter.omega_s),
        (Quantity::P, filter.P_s),
        (Quantity::V, filter.V_s),
        (Quantity::Q, filter.Q_s),
        (Quantity::Soc, filter.E_s),
    ]
}

impl Controller {
    /// Evaluates everything at `now_ns` for a step of `h_ns`.
    pub(super) fn evaluate(&mut self, now_ns: i64, h_ns: i64) {
        let h_s = seconds(h_ns);
        self.measure(now_ns);
        self.hear();
        self.find_faulty(now_ns);
        let mut told = std::mem::take(&mut self.scratch.told);
        self.tell_instead((now_ns, 0.0), &self.scratch.signals, &mut told);
        self.scratch.told = told;
        let clock = self.state.clock;
        self.network.listen(
            &self.state.history,
            (now_ns, clock.samples),
            Hearing {
                channel: &self.fixed.channel,
                silence_ns: self.fixed.silence_ns,
                mute: &self.scratch.mute,
            },
            &self.state.received_ns,
            &mut self.scratch.received_ns,
        );
        self.state.outputs.saturated.fill(false);
        if self.state.adopted.enable {
            self.laws(h_s);
            self.limit(h_s);
            self.exchange(h_ns);
            self.hold_frozen();
        } else {
            for i in 0..self.agents() {
                self.rest(i);
            }
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
        let up_to_date = self.is_up_to_date();
        let (state, scratch) = (&self.state, &mut self.scratch);
        let (inputs, parameters, outputs) = (&state.inputs, &state.parameters, &state.outputs);
        let n = inputs.P.len();
        let signals = &mut scratch.signals;
        signals.of_mut(Quantity::Omega).copy_from_slice(&inputs.omega);
        signals.of_mut(Quantity::V).copy_from_slice(&inputs.V);
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
            let elapsed_s = seconds(now_ns.saturating_sub(state.clock.sampled_ns).max(0));
            for (k, (quantity, constant_s)) in filters(&self.fixed.filter).into_iter().enumerate() {
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
        self.share(now_ns);
        let (state, scratch) = (&self.state, &mut self.scratch);
        let (parameters, signals) = (&state.parameters, &mut scratch.signals);
        for (quantity, owed) in [Quantity::P, Quantity::Q].into_iter().zip(&state.owed) {
            for (told, owed) in signals.of_mut(quantity).iter_mut().zip(owed) {
                *told += owed;
            }
        }
        let [_, _, V, _, _, vbar, _] = &mut signals.0;
        match parameters.voltage_policy {
            VoltagePolicy::Average => estimates(&self.network, &state.transfers, V, vbar),
            VoltagePolicy::Paper => vbar.copy_from_slice(V),
        }
    }

    /// The share of the load, P_i - P_set_i, without the exchange's own moves. P follows P_set late, so that a
    /// bound on P - P_set would answer every move of P_set with another. So P_set is followed as late as P may
    /// be: with F how P follows and M how it is followed here, both of first order, (F - M) P_set is what is left
    /// of the move, which has a gain below 1 whatever their times, and so dies out.
    fn share(&mut self, now_ns: i64) {
        let [followed_s, shared_s] = self.share_times_s();
        let (state, scratch) = (&self.state, &mut self.scratch);
        if scratch.shares.is_empty() {
            return;
        }
        let elapsed_s = seconds(now_ns.saturating_sub(state.clock.sampled_ns).max(0));
        let first = state.clock.samples == 0;
        let new = |T_s: f64| if first || T_s == 0.0 { 1.0 } else { -(-elapsed_s / T_s).exp_m1() };
        let followed = new(followed_s);
        let shared = new(shared_s);
        for (i, (&P, &P_set)) in state.inputs.P.iter().zip(&state.outputs.P_set).enumerate() {
            scratch.followed[i] = state.followed[i] + followed * (P_set - state.followed[i]);
            let share = P - scratch.followed[i];
            scratch.shares[i] = state.shares[i] + shared * (share - state.shares[i]);
        }
        scratch.signals.of_mut(Quantity::Share).copy_from_slice(&scratch.shares);
    }

    /// Time constants of P_set as the power follows it, and of the share of the load, s.
    pub(super) fn share_times_s(&self) -> [f64; 2] {
        let step_s = seconds(self.state.clock.step_ns);
        let loop_s = self.state.lags.frequency.loop_steps() * step_s;
        [FOLLOWING_S.max(loop_s - step_s), self.fixed.filter.P_s.max(SHARE_LOOPS * loop_s)]
    }

    /// A flow law of one quantity for a step of `h_s`, its measurements late by `lag`.
    pub(super) fn flow(&self, gain: f64, lag: &Lag, h_s: f64) -> Flow {
        let parameters = &self.state.parameters;
        let least_s = self.least_layer(parameters.theta_min, seconds(self.network.longest_delay_ns()));
        let theta_s = boundary_layer(parameters.discretisation, lag.widening() * h_s, least_s);
        Flow::new(self.power(), gain, theta_s)
    }

    /// The least boundary layer, s.
    pub(super) fn least_layer<S: Scalar>(&self, theta_min_s: S, longest_delay_s: S) -> S {
        match self.state.parameters.voltage_policy {
            VoltagePolicy::Average => theta_min_s.max(S::constant(DELAY_LAYER) * longest_delay_s),
            VoltagePolicy::Paper => theta_min_s,
        }
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
        let view = View {
            network: &self.network,
            history: &self.state.history,
            signals: &self.scratch.signals,
            told: self.scratch.told(),
            late: Lateness::default(),
        };
        let dispatch = inputs.dispatch.then_some(inputs.P_ref);
        active_power(view, &flow_P, dispatch, &mut outputs.u_P);
        reactive_power(view, &flow_Q, &mut outputs.u_Q);
        self.relay(h_s);
        let (inputs, outputs) = (&self.state.inputs, &mut self.state.outputs);
        let view = View {
            network: &self.network,
            history: &self.state.history,
            signals: &self.scratch.signals,
            told: self.scratch.told(),
            late: Lateness::default(),
        };
        frequency(view, &flow_omega, &outputs.u_P, inputs.omega_ref, &mut outputs.u_omega);
        match self.state.parameters.voltage_policy {
            VoltagePolicy::Paper => voltage(view, &flow_V, &outputs.u_Q, inputs.V_ref, &mut outputs.u_V),
            VoltagePolicy::Average => {
                average_voltage(view, &flow_V, &outputs.u_Q, inputs.V_ref, &mut outputs.u_V);
            }
        }
    }

    /// Whether measurements are brought up to date; the bare law is there to compare with.
    pub(super) fn is_up_to_date(&self) -> bool {
        self.state.parameters.discretisation == Discretisation::Capped
    }

    /// Whether an ended link fades because both ends are there but no longer linked.
    pub(super) fn fades_now(&self, link: &HeldLink) -> bool {
        let ends = [link.a as usize, link.b as usize];
        match self.network.outer() {
            Some(outer) if outer.crosses(ends[0], ends[1]) => {
                outer.are_available(ends[0], ends[1]) && !outer.is_closed(ends[0], ends[1])
            }
            _ => link.is_between_live(&self.topology.live),
        }
    }

    /// Whether both ends of an ended link do the same with it now: one that ends a link to another part waits until
    /// that has heard of it.
    fn is_known_to_both(&self, link: &HeldLink) -> bool {
        let ends = [link.a as usize, link.b as usize];
        let lost = |i: usize| !self.topology.live[i] && !self.is_outside(i);
        let is_crossing = self.network.crosses(link.a, link.b);
        let is_leaving = is_crossing && self.fades_now(link) && ends.into_iter().any(lost);
        !is_leaving && !self.network.is_closed(ends[0], ends[1])
    }

    /// Boundary layers of the exchange for a step of `h_s`, s: inside a part of a fleet, and between two.
    pub(super) fn exchange_layers<S: Scalar>(&self, h_s: f64, theta_E_s: S) -> [S; 2] {
        let across = match self.state.parameters.discretisation {
            Discretisation::Capped => S::constant(h_s).max(theta_E_s),
            Discretisation::Explicit => theta_E_s,
        };
        [self.exchange_layer_of(h_s, theta_E_s), across]
    }

    /// Boundary layer of the exchange for a step of `h_s`, s.
    pub(super) fn exchange_layer(&self, h_s: f64) -> f64 {
        self.exchange_layer_of(h_s, self.state.parameters.theta_E)
    }

    /// The same with this theta_E, s.
    pub(super) fn exchange_layer_of<S: Scalar>(&self, h_s: f64, theta_E_s: S) -> S {
        // theta_E is part of the exchange, not of its sampling: the bare law keeps it.
        match self.state.parameters.discretisation {
            Discretisation::Capped => {
                S::constant(self.state.lags.frequency.loop_steps() * h_s).max(theta_E_s)
            }
            Discretisation::Explicit => theta_E_s,
        }
    }

    /// (11): the flows and P_set that a step of `h_s` would set, and u_E.
    fn exchange(&mut self, h_ns: i64) {
        self.count_ended();
        let theta_s = self.exchange_layers(seconds(h_ns), self.state.parameters.theta_E);
        let mut flows = std::mem::take(&mut self.scratch.flows);
        let mut saturated = std::mem::take(&mut self.state.outputs.saturated);
        let mut P_set = std::mem::take(&mut self.scratch.P_set);
        self.exchange_of(self.power(), theta_s, h_ns).flows(
            &self.network,
            &self.state.history,
            self.scratch.told(),
            &self.state.flows,
            &mut flows,
            &mut saturated,
        );
        // Who is not live holds its P_set, unless what it holds fades.
        let live = &self.topology.live;
        let written = |i: usize| live[i] || self.fixed.lost_link_fade_s.is_some();
        let carries = |link: &HeldLink| self.carries(link, h_ns);
        setpoints(&self.network, &flows, &self.state.held, carries, written, &mut P_set);
        energy(&P_set, &self.state.parameters.capacity, &mut self.state.outputs.u_E);
        for (u, _) in self.state.outputs.u_E.iter_mut().zip(live).filter(|(_, live)| !**live) {
            *u = 0.0;
        }
        (self.scratch.flows, self.state.outputs.saturated, self.scratch.P_set) = (flows, saturated, P_set);
    }

    /// How many ended links each agent has.
    fn count_ended(&mut self) {
        let ended = &mut self.scratch.ended;
        ended.fill(0);
        for link in &self.state.held {
            for end in [link.a, link.b] {
                ended[end as usize] += 1;
            }
        }
    }

    /// What an ended link carries after a step of `h_ns`, pu.
    pub(super) fn carries(&self, link: &HeldLink, h_ns: i64) -> f64 {
        if !self.is_known_to_both(link) {
            return link.flow;
        }
        let faded = if self.fades_now(link) {
            link.flow * (1.0 - share(h_ns, link.left_ns))
        } else {
            let fade = |fade_s: f64| link.flow * (-seconds(h_ns) / fade_s).exp();
            self.fixed.lost_link_fade_s.map_or(link.flow, fade)
        };
        let ends = [link.a as usize, link.b as usize];
        let most = seconds(h_ns) * ramp(&self.network, &self.fixed.limits, &self.scratch.ended, ends);
        let step = faded - link.flow;
        if step.abs() > most { link.flow + most.copysign(step) } else { faded }
    }

    /// Spreads, errors and certified times, from the present signals.
    fn diagnose(&mut self) {
        let (signals, inputs) = (&self.scratch.signals, &self.state.inputs);
        let (available, live) = (&self.state.adopted.available, &self.topology.live);
        let goal = inputs.dispatch.then_some(inputs.P_ref);
        let mut diagnosis = Diagnosis::new(inputs.omega_ref, inputs.V_ref, goal);
        let n = live.len();
        let mut own = [[0.0; CHUNK]; 2];
        for from in (0..n).step_by(CHUNK) {
            let r = from..n.min(from + CHUNK);
            let of = |quantity: Quantity| &signals.of(quantity)[r.clone()];
            for (own, quantity) in own.iter_mut().zip([Quantity::P, Quantity::Q]) {
                for (own, i) in own.iter_mut().zip(r.clone()) {
                    *own = self.own(signals, quantity, i);
                }
            }
            diagnosis.take(Seen {
                available: &available[r.clone()],
                live: &live[r.clone()],
                told_p: of(Quantity::P),
                own: [
                    of(Quantity::Omega),
                    &own[0][..r.len()],
                    of(Quantity::V),
                    &own[1][..r.len()],
                    of(Quantity::Soc),
                ],
            });
        }
        self.tell(Some(&diagnosis));
    }

    /// Sets the diagnostic outputs; to 0 where nobody has looked, whatever was there before.
    pub(super) fn tell(&mut self, diagnosis: Option<&Diagnosis>) {
        let outputs = &mut self.state.outputs;
        let Some(diagnosis) = diagnosis else {
            [outputs.spread_P, outputs.spread_Q, outputs.spread_E] = [0.0; 3];
            [outputs.error_omega, outputs.error_V] = [0.0; 2];
            [outputs.lambda_2, outputs.T_P, outputs.T_omega] = [0.0; 3];
            return;
        };
        let eta = self.state.parameters.eta;
        let [norm_p, norm_omega] = diagnosis.norms();
        let T_P = self.spectrum.P.settling_time(norm_p, eta);
        let T_omega = self.spectrum.omega.settling_time(norm_omega, eta);
        [outputs.spread_P, outputs.spread_Q, outputs.spread_E] = diagnosis.spreads();
        [outputs.error_omega, outputs.error_V] = diagnosis.errors();
        (outputs.lambda_2, outputs.T_P, outputs.T_omega) = (self.spectrum.lambda_2, T_P, T_omega);
    }
}

//! The evaluation once more, in dual numbers: what the outputs do along a direction of inputs and parameters,
//! or in time. The laws are those of `protocol`, `exchange` and `limits`; here they are put together as in
//! `evaluate`. Values come from the evaluation before, so that only rates are made here. Changes no value.

use super::config::{Discretisation, VoltagePolicy};
use super::controller::Controller;
use super::delay::{Quantity, Signals};
use super::discretisation::{Flow, SignPower, boundary_layer};
use super::evaluate::filters;
use super::exchange::{Exchange, HeldLink, setpoints};
use super::io::{Inputs, Outputs, Parameters};
use super::lag::Lag;
use super::network::Lateness;
use super::protocol::{View, active_power, average_voltage, energy, frequency, reactive_power, voltage};
use super::scalar::{Dual, Scalar};
use super::time::seconds;

/// In which direction the controller is differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// That of the tangents of inputs and parameters; setpoints and memory are held.
    Knowns,
    /// Time, s, after the last step: inputs move as their tangents say, the setpoints at the rates u_omega and
    /// u_V, messages get older; P_set and Q_set rest until the next step.
    Time,
}

/// Tangents of inputs, parameters and outputs, in the places of their values; and memory to make them.
#[derive(Clone, Debug)]
pub struct Tangents {
    /// Of the inputs, to be set; what is no Real has none.
    pub inputs: Inputs,
    /// Of the tunable parameters, to be set; those of the others do not count.
    pub parameters: Parameters,
    /// Of the outputs.
    pub outputs: Outputs,
    pub(super) signals: Signals<Dual>,
    /// Empty without faults of messages.
    told: Signals<Dual>,
    /// u_omega, u_P, u_E, u_V, u_Q.
    pub(super) u: [Vec<Dual>; 5],
    flows: Vec<Dual>,
    P_set: Vec<Dual>,
    limited: Vec<bool>,
}

/// The tunable parameters, as far as flows read them.
struct Tuned {
    power: SignPower<Dual>,
    discretisation: Discretisation,
    theta_min: Dual,
}

impl Tuned {
    /// As `Controller::flow`.
    fn flow(&self, gain: Dual, lag: &Lag, h_s: f64) -> Flow<Dual> {
        let theta_s = boundary_layer(self.discretisation, lag.widening() * h_s, self.theta_min);
        Flow::new(self.power, gain, theta_s)
    }
}

impl Controller {
    /// Room for tangents, all 0.
    pub fn tangents(&self) -> Tangents {
        let n = self.agents();
        let mut tangents = Tangents {
            inputs: self.state.inputs.clone(),
            parameters: self.state.parameters.clone(),
            outputs: self.state.outputs.clone(),
            signals: Signals::new(n),
            told: Signals::new(self.scratch.mute.len()),
            u: std::array::from_fn(|_| vec![Dual::default(); n]),
            flows: Vec::new(),
            P_set: vec![Dual::default(); n],
            limited: vec![false; n],
        };
        tangents.clear();
        tangents
    }

    /// Makes the tangents of the outputs from those of inputs and parameters. To be called in line with the
    /// inputs, after a refresh.
    pub fn differentiate(&mut self, direction: Direction, tangents: &mut Tangents) {
        let clock = self.state.clock;
        // A state put back brings its outputs along, but not what they were made of.
        self.evaluate(clock.now_ns, clock.step_ns);
        let h_s = seconds(clock.step_ns);
        self.signal_rates(direction, tangents);
        let passing = Dual::new(0.0, if direction == Direction::Time { 1.0 } else { 0.0 });
        self.tell_instead((clock.now_ns, passing), &tangents.signals, &mut tangents.told);
        for u in &mut tangents.u {
            u.fill(Dual::default());
        }
        if self.state.adopted.enable {
            let d = &tangents.parameters;
            let power = SignPower::new(self.fixed.law, Dual::new(self.state.parameters.eta, d.eta));
            let discretisation = self.state.parameters.discretisation;
            let theta_min = Dual::new(self.state.parameters.theta_min, d.theta_min);
            let of_delay = if self.network.longest_follows_common() { d.delay } else { 0.0 };
            let longest_delay = Dual::new(seconds(self.network.longest_delay_ns()), of_delay);
            let theta_min = self.least_layer(theta_min, longest_delay);
            let tuned = Tuned { power, discretisation, theta_min };
            let past = Dual::new(0.0, if direction == Direction::Time { -1.0 } else { 0.0 });
            let late = Lateness { past, delay: Dual::new(0.0, d.delay) };
            self.law_rates(&tuned, late, h_s, tangents);
            self.limit_rates(direction, h_s, tangents);
            self.exchange_rates(&tuned, late, clock.step_ns, tangents);
            for (i, _) in self.scratch.frozen.iter().enumerate().filter(|(_, frozen)| **frozen) {
                tangents.u.iter_mut().for_each(|u| u[i] = Dual::default());
            }
        }
        let Tangents { outputs, u: [u_omega, u_P, u_E, u_V, u_Q], .. } = tangents;
        for (rates, duals) in [
            (&mut outputs.u_omega, u_omega),
            (&mut outputs.u_P, u_P),
            (&mut outputs.u_E, u_E),
            (&mut outputs.u_V, u_V),
            (&mut outputs.u_Q, u_Q),
        ] {
            rates.iter_mut().zip(duals).for_each(|(rate, dual)| *rate = dual.tangent);
        }
        for i in 0..self.agents() {
            (outputs.omega_set[i], outputs.V_set[i]) = self.setpoint_rates(direction, i);
        }
        self.diagnostic_rates(tangents);
    }

    /// d omega_set_i / dt and d V_set_i / dt, pu/s: the inputs u after limits. In another direction they are held.
    pub(super) fn setpoint_rates(&self, direction: Direction, i: usize) -> (f64, f64) {
        let moves = direction == Direction::Time && self.state.adopted.enable && self.topology.live[i];
        if moves { (self.state.outputs.u_omega[i], self.state.outputs.u_V[i]) } else { (0.0, 0.0) }
    }

    /// As `Controller::measure`.
    fn signal_rates(&self, direction: Direction, tangents: &mut Tangents) {
        let (state, parameters) = (&self.state, &self.state.parameters);
        let (inputs, outputs, lags) = (&state.inputs, &state.outputs, &state.lags);
        let d = &tangents.inputs;
        let up_to_date = parameters.discretisation == Discretisation::Capped;
        // The moves of one's own setpoint count where they are not measured yet.
        let unseen = |lag: &Lag, rate: f64| if up_to_date && lag.adds_unseen() { rate } else { 0.0 };
        let signals = &mut tangents.signals;
        for i in 0..self.agents() {
            let (omega_set, V_set) = self.setpoint_rates(direction, i);
            for (quantity, measured, rate) in [
                (Quantity::Omega, inputs.omega[i], d.omega[i] + unseen(&lags.frequency, omega_set)),
                (Quantity::V, inputs.V[i], d.V[i] + unseen(&lags.voltage, V_set)),
                (
                    Quantity::P,
                    parameters.K_P[i] * (inputs.P[i] - outputs.P_set[i]),
                    parameters.K_P[i] * d.P[i],
                ),
                (
                    Quantity::Q,
                    parameters.K_Q[i] * (inputs.Q[i] - outputs.Q_set[i]),
                    parameters.K_Q[i] * d.Q[i],
                ),
                (Quantity::Soc, inputs.E[i] / parameters.capacity[i], d.E[i] / parameters.capacity[i]),
            ] {
                signals.of_mut(quantity)[i] = Dual::new(measured, rate);
            }
        }
        self.filter_rates(direction, signals);
        self.share_rates(direction, tangents);
        let signals = &mut tangents.signals;
        for quantity in
            [Quantity::Omega, Quantity::P, Quantity::V, Quantity::Q, Quantity::Soc, Quantity::Share]
        {
            let values = self.scratch.signals.of(quantity);
            signals.of_mut(quantity).iter_mut().zip(values).for_each(|(dual, &value)| dual.value = value);
        }
        self.remote_rates(tangents);
        let signals = &mut tangents.signals;
        // The estimates of the mean voltage are V plus what is held.
        let [_, _, V, _, _, vbar, _] = &mut signals.0;
        for (i, vbar) in vbar.iter_mut().enumerate().filter(|&(i, _)| !self.is_outside(i)) {
            *vbar = Dual::new(self.scratch.signals.of(Quantity::MeanV)[i], V[i].tangent);
        }
    }

    /// What the measurement filters make of the rates; in time the filters themselves go on.
    fn filter_rates(&self, direction: Direction, signals: &mut Signals<Dual>) {
        let (clock, n) = (self.state.clock, self.agents());
        if self.state.filtered.is_empty() || clock.samples == 0 {
            return;
        }
        let elapsed_s = seconds(clock.now_ns.saturating_sub(clock.sampled_ns).max(0));
        for (k, (quantity, constant_s)) in filters(&self.fixed.filter).into_iter().enumerate() {
            if constant_s <= 0.0 {
                continue;
            }
            for i in 0..n {
                let signal = &mut signals.of_mut(quantity)[i];
                *signal = filtered(direction, *signal, self.state.filtered[k * n + i], elapsed_s, constant_s);
            }
        }
    }

    /// As `Controller::share`.
    fn share_rates(&self, direction: Direction, tangents: &mut Tangents) {
        let (state, clock) = (&self.state, self.state.clock);
        let elapsed_s = seconds(clock.now_ns.saturating_sub(clock.sampled_ns).max(0));
        let follows = |x: Dual, last: f64, T_s: f64| {
            if clock.samples > 0 && T_s > 0.0 { filtered(direction, x, last, elapsed_s, T_s) } else { x }
        };
        let [followed_s, shared_s] = self.share_times_s();
        for (i, (&last, &was)) in state.shares.iter().zip(&state.followed).enumerate() {
            let P = Dual::new(state.inputs.P[i], tangents.inputs.P[i]);
            let P_set = follows(Dual::constant(state.outputs.P_set[i]), was, followed_s);
            tangents.signals.of_mut(Quantity::Share)[i] = follows(P - P_set, last, shared_s);
        }
    }

    /// As `Controller::laws`.
    fn law_rates(&self, tuned: &Tuned, late: Lateness<Dual>, h_s: f64, tangents: &mut Tangents) {
        let (inputs, parameters, lags) = (&self.state.inputs, &self.state.parameters, &self.state.lags);
        let Tangents { inputs: d, parameters: d_gain, signals, told, u, .. } = tangents;
        let told = if self.scratch.mute.is_empty() { &*signals } else { &*told };
        let [u_omega, u_P, _, u_V, u_Q] = u;
        let flow = |gain: f64, rate: f64, lag: &Lag| tuned.flow(Dual::new(gain, rate), lag, h_s);
        let flow_omega = flow(parameters.gain_omega, d_gain.gain_omega, &lags.frequency);
        let flow_P = flow(parameters.gain_P, d_gain.gain_P, &lags.frequency);
        let flow_V = flow(parameters.gain_V, d_gain.gain_V, &lags.voltage);
        let flow_Q = flow(parameters.gain_Q, d_gain.gain_Q, &lags.voltage);
        let dispatch = inputs.dispatch.then_some(Dual::new(inputs.P_ref, d.P_ref));
        let omega_ref = Dual::new(inputs.omega_ref, d.omega_ref);
        let V_ref = Dual::new(inputs.V_ref, d.V_ref);
        let view = View { network: &self.network, history: &self.state.history, signals, told, late };
        active_power(view, &flow_P, dispatch, u_P);
        reactive_power(view, &flow_Q, u_Q);
        self.relay_rates(signals, [u_P, u_Q], h_s);
        frequency(view, &flow_omega, u_P, omega_ref, u_omega);
        match parameters.voltage_policy {
            VoltagePolicy::Paper => voltage(view, &flow_V, u_Q, V_ref, u_V),
            VoltagePolicy::Average => average_voltage(view, &flow_V, u_Q, V_ref, u_V),
        }
    }

    /// As `Controller::exchange`.
    fn exchange_rates(&self, tuned: &Tuned, late: Lateness<Dual>, h_ns: i64, tangents: &mut Tangents) {
        let h_s = seconds(h_ns);
        let parameters = &self.state.parameters;
        let theta_E = Dual::new(parameters.theta_E, tangents.parameters.theta_E);
        let exchange = Exchange {
            power: tuned.power,
            gain: Dual::new(parameters.gain_E, tangents.parameters.gain_E),
            theta_s: self.exchange_layers(h_s, theta_E),
            h_s,
            capacity: &parameters.capacity,
            P_max: &parameters.P_exchange_max,
            fades: self.fades(h_ns),
            ended: &self.scratch.ended,
            limits: &self.fixed.limits,
            no_circulation: self.fixed.no_circulation,
            late,
            mute: &self.scratch.mute,
        };
        let Tangents { signals, told, u: [_, _, u_E, _, _], flows, P_set, limited, .. } = tangents;
        let signals = if self.scratch.mute.is_empty() { &*signals } else { &*told };
        flows.resize(self.network.graph.edges().len(), Dual::default());
        exchange.flows(&self.network, &self.state.history, signals, &self.state.flows, flows, limited);
        let live = &self.topology.live;
        let carries = |link: &HeldLink| self.carries(link, h_ns);
        // Who is not live has no u_E.
        setpoints(&self.network, flows, &self.state.held, carries, |_| true, P_set);
        energy(P_set, &parameters.capacity, u_E);
        for (u, _) in u_E.iter_mut().zip(live).filter(|(_, live)| !**live) {
            *u = Dual::default();
        }
    }
}

/// What a first-order lag that stood at `last` makes of a measurement `x` after `elapsed_s`. It follows a change of
/// the measurement by its share; in time it moves by its own equation, (x - y) / T.
fn filtered(direction: Direction, x: Dual, last: f64, elapsed_s: f64, constant_s: f64) -> Dual {
    let left = (-elapsed_s / constant_s).exp();
    let y = last + (1.0 - left) * (x.value - last);
    match direction {
        Direction::Knowns => Dual::new(y, (1.0 - left) * x.tangent),
        Direction::Time => Dual::new(y, (x.value - y) / constant_s),
    }
}

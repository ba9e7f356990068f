//! A step or an evaluation of up to eight agents: the laws of `protocol` and `exchange` under the conditions of `sweep`, without what
//! a sweep spends on getting ready. One quantity a lane; agents and edges one after the other. Gives the bits of
//! `evaluate` and `step`.

use super::controller::Controller;
use super::diagnosis::{Diagnosis, Seen};
use super::discretisation::SignPower;
use super::exchange::SECONDS_PER_HOUR;
use super::lag::{LANES, load_few, no_load, no_loads};
use super::network::Network;
use super::power::power;
use super::state::State;
use super::time::seconds;
use pulp::{Arch, NullaryFnOnce};

/// The most agents of such a step: those whose lags are found side by side.
pub const FEW: usize = LANES;

/// omega, p, V, q.
type Four = [f64; 4];

/// What an edge has to know of one of its ends.
#[derive(Clone, Copy, Default)]
struct Place {
    signals: Four,
    soc: f64,
    capacity: f64,
    /// P_exchange_max_i / peers_i, pu.
    limit: f64,
    /// 1 + peers_i.
    crowd: f64,
}

/// The laws of the four signals.
struct Laws {
    power: SignPower,
    gains: Four,
    inverse_thetas: Four,
}

impl Laws {
    /// As `Flow::along`, four at once.
    #[inline(always)]
    fn along(&self, weight: f64, d: Four, share: f64) -> Four {
        let mut flow = d;
        for k in 0..4 {
            flow[k] = d[k].abs();
        }
        let s = self.magnitudes(flow);
        for k in 0..4 {
            let (law, cap) = (self.gains[k] * weight * s[k], flow[k] * share * self.inverse_thetas[k]);
            // As `min`: the law where the cap is not a number.
            flow[k] = if cap < law { cap } else { law };
            flow[k] = flow[k].copysign(d[k]);
        }
        flow
    }

    #[inline(always)]
    fn magnitudes<const K: usize>(&self, mut m: [f64; K]) -> [f64; K] {
        // Loops, because `map` is no part of the code for this processor.
        match self.power {
            SignPower::Root => {
                for m in &mut m {
                    *m = m.sqrt();
                }
            }
            SignPower::Power(eta) => {
                for m in &mut m {
                    *m = power(*m, eta);
                }
            }
            // The fixed-time law is never plain.
            SignPower::Linear | SignPower::FixedTime { .. } => {}
        }
        m
    }
}

impl Controller {
    /// As `sweep`, for at most [`FEW`] agents.
    pub(super) fn visit_few(&mut self, h_ns: i64, moves: bool) {
        let h_s = seconds(h_ns);
        let (parameters, lags) = (&self.state.parameters, &self.state.lags);
        let flows = [
            self.flow(parameters.gain_omega, &lags.frequency, h_s),
            self.flow(parameters.gain_P, &lags.frequency, h_s),
            self.flow(parameters.gain_V, &lags.voltage, h_s),
            self.flow(parameters.gain_Q, &lags.voltage, h_s),
        ];
        let up_to_date = self.is_up_to_date();
        let inputs = &self.state.inputs;
        let mut diagnosis =
            Diagnosis::new(inputs.omega_ref, inputs.V_ref, inputs.dispatch.then_some(inputs.P_ref));
        Arch::new().dispatch(Visit {
            laws: Laws {
                power: flows[0].power,
                gains: flows.map(|flow| flow.gain),
                inverse_thetas: flows.map(|flow| flow.inverse_theta),
            },
            gain_E: SECONDS_PER_HOUR * parameters.gain_E,
            theta_E_s: self.exchange_layer(h_s).max(0.0),
            fade: self.fade(h_ns),
            h_s,
            moves,
            adds_unseen: [lags.frequency.adds_unseen(), lags.voltage.adds_unseen()]
                .map(|adds| adds && up_to_date),
            network: &self.network,
            live: &self.topology.live,
            state: &mut self.state,
            diagnosis: &mut diagnosis,
        });
        self.tell(&diagnosis);
    }
}

/// An evaluation, or a step that also `moves`; compiled for each kind of processor.
struct Visit<'a> {
    laws: Laws,
    gain_E: f64,
    theta_E_s: f64,
    fade: f64,
    h_s: f64,
    moves: bool,
    adds_unseen: [bool; 2],
    network: &'a Network,
    live: &'a [bool],
    state: &'a mut State,
    diagnosis: &'a mut Diagnosis,
}

impl NullaryFnOnce for Visit<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let places = self.measure();
        let (mut sums, mut P_set) = ([Four::default(); FEW], [0.0; FEW]);
        self.edges(&places, &mut sums, &mut P_set);
        self.pins(&places, &mut sums);
        if self.moves {
            self.learn();
        }
        self.advance(&sums, &P_set);
        self.diagnose(&places);
    }
}

impl Visit<'_> {
    #[inline(always)]
    fn measure(&mut self) -> [Place; FEW] {
        let State { inputs, parameters, outputs, lags, .. } = &mut *self.state;
        let n = self.live.len().min(FEW);
        let mut places = [Place::default(); FEW];
        let (omega, P, V) = (&inputs.omega[..n], &inputs.P[..n], &inputs.V[..n]);
        let (Q, E, peers) = (&inputs.Q[..n], &inputs.E[..n], &self.network.graph.all_peers()[..n]);
        let (K_P, K_Q, capacity) = (&parameters.K_P[..n], &parameters.K_Q[..n], &parameters.capacity[..n]);
        let (P_max, P_set, Q_set) =
            (&parameters.P_exchange_max[..n], &outputs.P_set[..n], &outputs.Q_set[..n]);
        for i in 0..n {
            let peers = f64::from(peers[i]);
            places[i] = Place {
                signals: [omega[i], K_P[i] * (P[i] - P_set[i]), V[i], K_Q[i] * (Q[i] - Q_set[i])],
                soc: E[i] / capacity[i],
                capacity: capacity[i],
                limit: P_max[i] / peers,
                crowd: 1.0 + peers,
            };
        }
        if self.adds_unseen[0] {
            for i in 0..n {
                let sigma = no_load(outputs.omega_set[i], K_P[i], P_set[i]);
                places[i].signals[0] += lags.frequency.unseen(i, sigma);
            }
        }
        if self.adds_unseen[1] {
            for i in 0..n {
                let sigma = no_load(outputs.V_set[i], K_Q[i], Q_set[i]);
                places[i].signals[2] += lags.voltage.unseen(i, sigma);
            }
        }
        places
    }

    #[inline(always)]
    fn edges(&mut self, places: &[Place; FEW], sums: &mut [Four; FEW], P_set: &mut [f64; FEW]) {
        let saturated = &mut self.state.outputs.saturated[..];
        saturated.fill(false);
        let links = self.network.graph.edges().iter().zip(&self.network.shares);
        for ((edge, &share), last) in links.zip(&mut self.state.flows) {
            // Ends are below eight: what looks like a mask is no check.
            let (a, b) = (edge.a as usize % FEW, edge.b as usize % FEW);
            let (at_a, at_b) = (&places[a], &places[b]);
            let mut d = at_a.signals;
            for k in 0..4 {
                d[k] -= at_b.signals[k];
            }
            let flow = self.laws.along(edge.weight, d, share);
            for k in 0..4 {
                sums[a][k] -= flow[k];
                sums[b][k] += flow[k];
            }
            let d = at_a.soc - at_b.soc;
            let [s] = self.laws.magnitudes([d.abs()]);
            let law = self.gain_E * edge.weight * s;
            let least = at_a.capacity.min(at_b.capacity);
            let cap = SECONDS_PER_HOUR * least * d.abs() / (self.theta_E_s * at_a.crowd.max(at_b.crowd));
            let wanted = if cap < law { cap } else { law };
            let most = at_a.limit.min(at_b.limit);
            let mut exchange = wanted;
            if wanted > most {
                exchange = most;
                for (end, place) in [(a, at_a), (b, at_b)] {
                    if let Some(saturated) = saturated.get_mut(end) {
                        *saturated |= wanted > place.limit;
                    }
                }
            }
            exchange = exchange.copysign(d);
            if self.fade < 1.0 {
                exchange = *last + self.fade * (exchange - *last);
            }
            if self.moves {
                *last = exchange;
            }
            P_set[a] += exchange;
            P_set[b] -= exchange;
        }
    }

    #[inline(always)]
    fn pins(&self, places: &[Place; FEW], sums: &mut [Four; FEW]) {
        let inputs = &self.state.inputs;
        let references = [inputs.omega_ref, inputs.P_ref, inputs.V_ref, 0.0];
        let pulled = [true, inputs.dispatch, true, false];
        for pin in &self.network.pins {
            let i = pin.agent % FEW;
            let mut d = places[i].signals;
            for k in 0..4 {
                d[k] -= references[k];
            }
            let flow = self.laws.along(pin.weight, d, pin.share);
            for k in 0..4 {
                sums[i][k] -= if pulled[k] { flow[k] } else { 0.0 };
            }
        }
    }

    /// How late the measurements are, from the setpoints before they move.
    #[inline(always)]
    fn learn(&mut self) {
        let State { inputs, parameters, outputs, lags, clock, .. } = &mut *self.state;
        let mut counted = [false; FEW];
        for (counted, live) in counted.iter_mut().zip(self.live) {
            *counted = *live & (clock.samples > 0);
        }
        let (K_P, K_Q) = (load_few(&parameters.K_P), load_few(&parameters.K_Q));
        let y = no_loads(load_few(&inputs.omega), K_P, load_few(&inputs.P));
        let sigma = no_loads(load_few(&outputs.omega_set), K_P, load_few(&outputs.P_set));
        lags.frequency.observe_few(&counted, &y, &sigma);
        let y = no_loads(load_few(&inputs.V), K_Q, load_few(&inputs.Q));
        let sigma = no_loads(load_few(&outputs.V_set), K_Q, load_few(&outputs.Q_set));
        lags.voltage.observe_few(&counted, &y, &sigma);
    }

    #[inline(always)]
    fn advance(&mut self, sums: &[Four; FEW], P_set: &[f64; FEW]) {
        let (h_s, live) = (self.h_s, self.live);
        let n = live.len().min(FEW);
        let State { parameters, outputs, .. } = &mut *self.state;
        let (u_omega, u_P) = (&mut outputs.u_omega[..n], &mut outputs.u_P[..n]);
        let (u_V, u_Q, u_E) = (&mut outputs.u_V[..n], &mut outputs.u_Q[..n], &mut outputs.u_E[..n]);
        let (omega_set, V_set) = (&mut outputs.omega_set[..n], &mut outputs.V_set[..n]);
        let (exchange, capacity) = (&mut outputs.P_set[..n], &parameters.capacity[..n]);
        for i in 0..n {
            let [omega, p, v, q] = sums[i];
            (u_omega[i], u_P[i], u_V[i], u_Q[i]) = (omega + p, p, v + q, q);
            u_E[i] = if live[i] { -P_set[i] / (SECONDS_PER_HOUR * capacity[i]) } else { 0.0 };
            if live[i] && self.moves {
                omega_set[i] += h_s * u_omega[i];
                V_set[i] += h_s * u_V[i];
                exchange[i] = P_set[i];
            }
        }
    }

    #[inline(always)]
    fn diagnose(&mut self, places: &[Place; FEW]) {
        let n = self.live.len().min(FEW);
        let [mut omega, mut p, mut V, mut q, mut soc] = [[0.0; FEW]; 5];
        for (i, place) in places.iter().enumerate() {
            ([omega[i], p[i], V[i], q[i]], soc[i]) = (place.signals, place.soc);
        }
        self.diagnosis.take(Seen {
            available: &self.state.adopted.available[..n],
            live: &self.live[..n],
            told_p: &p[..n],
            own: [&omega[..n], &p[..n], &V[..n], &q[..n], &soc[..n]],
        });
    }
}

//! A step or an evaluation of up to eight agents: the laws of `protocol` and `exchange` under the conditions of `sweep`, without what
//! a sweep spends on getting ready. One quantity a lane; agents and edges one after the other. Gives the bits of
//! `evaluate` and `step`.

use super::controller::Controller;
use super::diagnosis::{Diagnosis, Seen};
use super::discretisation::SignPower;
use super::exchange::SECONDS_PER_HOUR;
use super::lag::no_loads;
use super::lanes::{LANES, Lanes, load_few, store_few};
use super::network::Pin;
use super::plain::Pass;
use super::power::power;
use super::roster::Roster;
use super::state::State;
use super::time::seconds;
use pulp::{Arch, NullaryFnOnce};

/// The most agents of such a step: those that go side by side.
pub const FEW: usize = LANES;

/// omega, p, V, q.
type Four = [f64; 4];

/// What agents know of themselves.
struct Measured {
    /// omega, p, V, q, the moves in it that are not seen yet.
    signals: [Lanes; 4],
    soc: Lanes,
    /// At no load, measured and set: frequency and voltage.
    seen: [Lanes; 2],
    set: [Lanes; 2],
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
    pub(super) fn visit_few(&mut self, h_ns: i64, pass: Pass) {
        let h_s = seconds(h_ns);
        let State { parameters, lags, inputs, .. } = &self.state;
        self.scratch.roster.renew(&self.network, &self.topology.live, parameters);
        let omega = self.flow(parameters.gain_omega, &lags.frequency, h_s);
        let V = self.flow(parameters.gain_V, &lags.voltage, h_s);
        let up_to_date = self.is_up_to_date();
        let mut diagnosis = pass
            .looks()
            .then(|| Diagnosis::new(inputs.omega_ref, inputs.V_ref, inputs.dispatch.then_some(inputs.P_ref)));
        Arch::new().dispatch(Visit {
            laws: Laws {
                power: omega.power,
                gains: [omega.gain, parameters.gain_P, V.gain, parameters.gain_Q],
                inverse_thetas: [omega.inverse_theta, omega.inverse_theta, V.inverse_theta, V.inverse_theta],
            },
            gain_E: SECONDS_PER_HOUR * parameters.gain_E,
            theta_E_s: self.exchange_layer(h_s).max(0.0),
            fade: self.fade(h_ns),
            h_s,
            moves: pass.moves(),
            adds_unseen: [
                lags.frequency.adds_unseen() && up_to_date,
                lags.voltage.adds_unseen() && up_to_date,
            ],
            pins: &self.network.pins,
            roster: &self.scratch.roster,
            n: self.topology.live.len(),
            state: &mut self.state,
            diagnosis: diagnosis.as_mut(),
        });
        self.tell(diagnosis.as_ref());
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
    pins: &'a [Pin],
    roster: &'a Roster,
    /// Number of agents.
    n: usize,
    state: &'a mut State,
    diagnosis: Option<&'a mut Diagnosis>,
}

impl NullaryFnOnce for Visit<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let measured = self.measure();
        let [omega, p, V, q] = &measured.signals;
        let mut signals = [Four::default(); FEW];
        for (i, signals) in signals.iter_mut().enumerate() {
            *signals = [omega[i], p[i], V[i], q[i]];
        }
        let (mut sums, mut P_set) = ([Four::default(); FEW], [0.0; FEW]);
        self.edges(&signals, &measured.soc, &mut sums, &mut P_set);
        self.pull(&signals, &mut sums);
        if self.moves {
            self.learn(&measured);
        }
        self.advance(&sums, &P_set);
        self.diagnose(&measured);
    }
}

impl Visit<'_> {
    #[inline(always)]
    fn measure(&self) -> Measured {
        let State { inputs, outputs, lags, .. } = &*self.state;
        let Roster { K_P, K_Q, capacity, .. } = self.roster;
        let (mut omega, mut V) = (load_few(&inputs.omega), load_few(&inputs.V));
        let (P, Q, E) = (load_few(&inputs.P), load_few(&inputs.Q), load_few(&inputs.E));
        let (P_set, Q_set) = (load_few(&outputs.P_set), load_few(&outputs.Q_set));
        let set = [
            no_loads(&load_few(&outputs.omega_set), K_P, &P_set),
            no_loads(&load_few(&outputs.V_set), K_Q, &Q_set),
        ];
        let seen = [no_loads(&omega, K_P, &P), no_loads(&V, K_Q, &Q)];
        let [mut p, mut q, mut soc] = [[0.0; FEW]; 3];
        for i in 0..FEW {
            p[i] = K_P[i] * (P[i] - P_set[i]);
            q[i] = K_Q[i] * (Q[i] - Q_set[i]);
            soc[i] = E[i] / capacity[i];
        }
        for ((adds, level), (lag, set)) in self
            .adds_unseen
            .into_iter()
            .zip([&mut omega, &mut V])
            .zip([&lags.frequency, &lags.voltage].into_iter().zip(&set))
        {
            if adds {
                let unseen = lag.unseen_few(set);
                for i in 0..FEW {
                    level[i] += unseen[i];
                }
            }
        }
        Measured { signals: [omega, p, V, q], soc, seen, set }
    }

    #[inline(always)]
    fn edges(&mut self, signals: &[Four; FEW], soc: &Lanes, sums: &mut [Four; FEW], P_set: &mut Lanes) {
        let saturated = &mut self.state.outputs.saturated[..];
        saturated.fill(false);
        for (link, last) in self.roster.links.iter().zip(&mut self.state.flows) {
            // Ends are below eight: what looks like a mask is no check.
            let (a, b) = (link.a % FEW, link.b % FEW);
            let mut d = signals[a];
            for k in 0..4 {
                d[k] -= signals[b][k];
            }
            let flow = self.laws.along(link.weight, d, link.share);
            for k in 0..4 {
                sums[a][k] -= flow[k];
                sums[b][k] += flow[k];
            }
            let d = soc[a] - soc[b];
            let [s] = self.laws.magnitudes([d.abs()]);
            let law = self.gain_E * link.weight * s;
            let cap = link.least_s * d.abs() / (self.theta_E_s * link.crowd);
            let wanted = if cap < law { cap } else { law };
            let mut exchange = wanted;
            if wanted > link.limit {
                exchange = link.limit;
                for (end, limit) in [a, b].into_iter().zip(link.limits) {
                    if let Some(saturated) = saturated.get_mut(end) {
                        *saturated |= wanted > limit;
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

    /// Of the virtual leader.
    #[inline(always)]
    fn pull(&self, signals: &[Four; FEW], sums: &mut [Four; FEW]) {
        let inputs = &self.state.inputs;
        let references = [inputs.omega_ref, inputs.P_ref, inputs.V_ref, 0.0];
        let pulled = [true, inputs.dispatch, true, false];
        for pin in self.pins {
            let i = pin.agent % FEW;
            let mut d = signals[i];
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
    fn learn(&mut self, measured: &Measured) {
        let State { lags, clock, .. } = &mut *self.state;
        let counted = if clock.samples > 0 { self.roster.live } else { [false; FEW] };
        let Measured { seen, set, .. } = measured;
        lags.frequency.observe_few(&counted, &seen[0], &set[0]);
        lags.voltage.observe_few(&counted, &seen[1], &set[1]);
    }

    #[inline(always)]
    fn advance(&mut self, sums: &[Four; FEW], P_set: &Lanes) {
        let Roster { capacity_s, live, .. } = self.roster;
        let outputs = &mut self.state.outputs;
        let [mut u_omega, mut u_P, mut u_V, mut u_Q, mut u_E] = [[0.0; FEW]; 5];
        for (i, &[omega, p, v, q]) in sums.iter().enumerate() {
            (u_omega[i], u_P[i], u_V[i], u_Q[i]) = (omega + p, p, v + q, q);
        }
        for i in 0..FEW {
            u_E[i] = if live[i] { -P_set[i] / capacity_s[i] } else { 0.0 };
        }
        store_few(&u_omega, &mut outputs.u_omega);
        store_few(&u_P, &mut outputs.u_P);
        store_few(&u_V, &mut outputs.u_V);
        store_few(&u_Q, &mut outputs.u_Q);
        store_few(&u_E, &mut outputs.u_E);
        if !self.moves {
            return;
        }
        let (mut omega_set, mut V_set) = (load_few(&outputs.omega_set), load_few(&outputs.V_set));
        let mut exchange = load_few(&outputs.P_set);
        for i in 0..FEW {
            omega_set[i] = if live[i] { omega_set[i] + self.h_s * u_omega[i] } else { omega_set[i] };
            V_set[i] = if live[i] { V_set[i] + self.h_s * u_V[i] } else { V_set[i] };
            exchange[i] = if live[i] { P_set[i] } else { exchange[i] };
        }
        store_few(&omega_set, &mut outputs.omega_set);
        store_few(&V_set, &mut outputs.V_set);
        store_few(&exchange, &mut outputs.P_set);
    }

    #[inline(always)]
    fn diagnose(&mut self, measured: &Measured) {
        let Some(diagnosis) = &mut self.diagnosis else { return };
        let n = self.n.min(FEW);
        let [omega, p, V, q] = measured.signals.each_ref().map(|signal| &signal[..n]);
        diagnosis.take(Seen {
            available: &self.state.adopted.available[..n],
            live: &self.roster.live[..n],
            told_p: p,
            own: [omega, p, V, q, &measured.soc[..n]],
        });
    }
}

//! A step or an evaluation of up to eight agents: the laws of `protocol` and `exchange` under the conditions of `sweep`, without what
//! a sweep spends on getting ready (`roster` keeps that). Agents side by side, edges one after the other, their four
//! signals at once. Gives the bits of `evaluate` and `step`.

use super::controller::Controller;
use super::diagnosis::{Diagnosis, Seen};
use super::discretisation::SignPower;
use super::exchange::SECONDS_PER_HOUR;
use super::lag::no_loads;
use super::lanes::{LANES, Lanes, load_few, store_few};
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

/// The same of each lane. Aligned, so that none lies across two lines of the cache.
#[derive(Default)]
#[repr(align(64))]
struct Rows([Four; FEW]);

/// What agents know of themselves.
struct Measured {
    /// omega, p, V, q, the moves in it that are not seen yet.
    signals: [Lanes; 4],
    soc: Lanes,
    /// At no load, measured and set: frequency and voltage.
    seen: [Lanes; 2],
    set: [Lanes; 2],
    /// omega_set, V_set and P_set until the step moves them.
    held: [Lanes; 3],
}

/// The sums.
#[inline(always)]
fn added(a: &Lanes, b: &Lanes) -> Lanes {
    let mut sums = *a;
    for i in 0..FEW {
        sums[i] += b[i];
    }
    sums
}

/// `new` of who takes part, `old` of the others.
#[inline(always)]
fn of_live(kept: &[u64; FEW], new: &Lanes, old: &Lanes) -> Lanes {
    let mut chosen = *old;
    for i in 0..FEW {
        chosen[i] = f64::from_bits(new[i].to_bits() & kept[i] | old[i].to_bits() & !kept[i]);
    }
    chosen
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
        // Here, because a call in between would put all vectors aside.
        self.state.outputs.saturated.fill(false);
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
            roster: &self.scratch.roster,
            live: &self.topology.live,
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
    roster: &'a Roster,
    live: &'a [bool],
    state: &'a mut State,
    diagnosis: Option<&'a mut Diagnosis>,
}

impl NullaryFnOnce for Visit<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let measured = self.measure();
        if self.moves {
            self.learn(&measured);
        }
        let (mut sums, mut P_set) = (Rows::default(), [0.0; FEW]);
        self.edges(&measured, &mut sums, &mut P_set);
        self.pull(&measured, &mut sums);
        self.advance(&sums, &P_set, measured.held);
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
        let (omega_set, V_set) = (load_few(&outputs.omega_set), load_few(&outputs.V_set));
        let set = [no_loads(&omega_set, K_P, &P_set), no_loads(&V_set, K_Q, &Q_set)];
        let seen = [no_loads(&omega, K_P, &P), no_loads(&V, K_Q, &Q)];
        let [mut p, mut q, mut soc] = [[0.0; FEW]; 3];
        for i in 0..FEW {
            p[i] = K_P[i] * (P[i] - P_set[i]);
            q[i] = K_Q[i] * (Q[i] - Q_set[i]);
            soc[i] = E[i] / capacity[i];
        }
        if self.adds_unseen[0] {
            omega = added(&omega, &lags.frequency.unseen_few(&set[0]));
        }
        if self.adds_unseen[1] {
            V = added(&V, &lags.voltage.unseen_few(&set[1]));
        }
        Measured { signals: [omega, p, V, q], soc, seen, set, held: [omega_set, V_set, P_set] }
    }

    #[inline(always)]
    fn edges(&mut self, measured: &Measured, Rows(sums): &mut Rows, P_set: &mut Lanes) {
        let Measured { signals, soc, .. } = measured;
        let saturated = &mut self.state.outputs.saturated[..];
        for (link, last) in self.roster.links.iter().zip(&mut self.state.flows) {
            // Lanes are below eight: what looks like a mask is no check.
            let [a, b] = [link.lanes[0] % FEW, link.lanes[1] % FEW];
            let mut d = Four::default();
            for k in 0..4 {
                d[k] = signals[k][a] - signals[k][b];
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
                for (end, limit) in link.ends.into_iter().zip(link.limits) {
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
    fn pull(&self, Measured { signals, .. }: &Measured, Rows(sums): &mut Rows) {
        let inputs = &self.state.inputs;
        let references = [inputs.omega_ref, inputs.P_ref, inputs.V_ref, 0.0];
        let pulled = [true, inputs.dispatch, true, false];
        for pull in &self.roster.pulls {
            let i = pull.lane % FEW;
            let mut d = Four::default();
            for k in 0..4 {
                d[k] = signals[k][i] - references[k];
            }
            let flow = self.laws.along(pull.weight, d, pull.share);
            for k in 0..4 {
                sums[i][k] -= if pulled[k] { flow[k] } else { 0.0 };
            }
        }
    }

    /// How late the measurements are, from the setpoints before they move.
    #[inline(always)]
    fn learn(&mut self, measured: &Measured) {
        let State { lags, clock, .. } = &mut *self.state;
        let counted = if clock.samples > 0 { self.roster.live } else { [0.0; FEW] };
        let Measured { seen, set, .. } = measured;
        lags.frequency.observe_few(&counted, &seen[0], &set[0]);
        lags.voltage.observe_few(&counted, &seen[1], &set[1]);
    }

    #[inline(always)]
    fn advance(&mut self, Rows(sums): &Rows, P_set: &Lanes, held: [Lanes; 3]) {
        let Roster { capacity_s, kept, .. } = self.roster;
        let outputs = &mut self.state.outputs;
        let [mut u_omega, mut u_P, mut u_V, mut u_Q, mut u_E] = [[0.0; FEW]; 5];
        for (i, &[omega, p, v, q]) in sums.iter().enumerate() {
            (u_omega[i], u_P[i], u_V[i], u_Q[i]) = (omega + p, p, v + q, q);
        }
        for i in 0..FEW {
            u_E[i] = -P_set[i] / capacity_s[i];
        }
        store_few(&u_omega, &mut outputs.u_omega);
        store_few(&u_P, &mut outputs.u_P);
        store_few(&u_V, &mut outputs.u_V);
        store_few(&u_Q, &mut outputs.u_Q);
        store_few(&of_live(kept, &u_E, &[0.0; FEW]), &mut outputs.u_E);
        if !self.moves {
            return;
        }
        let [omega_set, V_set, exchange] = held;
        let (mut next_omega, mut next_V) = (omega_set, V_set);
        for i in 0..FEW {
            next_omega[i] += self.h_s * u_omega[i];
            next_V[i] += self.h_s * u_V[i];
        }
        store_few(&of_live(kept, &next_omega, &omega_set), &mut outputs.omega_set);
        store_few(&of_live(kept, &next_V, &V_set), &mut outputs.V_set);
        store_few(&of_live(kept, P_set, &exchange), &mut outputs.P_set);
    }

    #[inline(always)]
    fn diagnose(&mut self, measured: &Measured) {
        let Some(diagnosis) = &mut self.diagnosis else { return };
        let n = self.live.len().min(FEW);
        let [omega, p, V, q] = &measured.signals;
        let mut agents = [[0.0; FEW]; 5];
        for (agents, lanes) in agents.iter_mut().zip([omega, p, V, q, &measured.soc]) {
            store_few(lanes, &mut agents[..n]);
        }
        let own = agents.each_ref().map(|signal| &signal[..n]);
        diagnosis.take(Seen {
            available: &self.state.adopted.available[..n],
            live: &self.live[..n],
            told_p: own[1],
            own,
        });
    }
}

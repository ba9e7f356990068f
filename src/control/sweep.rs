//! The step of many agents in one sweep over memory: the laws of `protocol` and `exchange` where nothing is
//! delayed, limited, filtered or averaged, in vector code picked for the processor at run time. Gives the bits
//! of `evaluate` and `step`, which do everything else; a test compares them.

use super::config::VoltagePolicy;
use super::controller::Controller;
use super::diagnosis::{Diagnosis, Seen};
use super::discretisation::{Flow, SignPower};
use super::exchange::SECONDS_PER_HOUR;
use super::lag::{Tally, no_load};
use super::network::Pin;
use super::power::power;
use super::state::State;
use super::time::seconds;
use super::wave::{Batch, FLOWS, Line, Link, Stages, Wave};
use pulp::{Arch, NullaryFnOnce};

/// The laws along an edge: omega, p, V, q.
const LAWS: usize = 4;

/// Everything that the stages read and write.
struct Sweep<'a> {
    state: &'a mut State,
    live: &'a [bool],
    peers: &'a [u32],
    pins: &'a [Pin],
    next_pin: usize,
    /// Of omega, p, V, q.
    laws: [Flow; LAWS],
    /// Of the laws and the exchange.
    gains: Line,
    inverse_thetas: Line,
    power: SignPower,
    theta_E_s: f64,
    fade: f64,
    h_s: f64,
    /// Whether setpoints move, or only what follows the inputs at once.
    moves: bool,
    adds_unseen: [bool; 2],
    tallies: [Tally; 2],
    diagnosis: Diagnosis,
}

impl Controller {
    /// Whether a sweep can do what a step has to.
    pub(super) fn is_plain(&self) -> bool {
        let (state, fixed) = (&self.state, &self.fixed);
        state.adopted.enable
            && fixed.is_plain
            && state.parameters.voltage_policy == VoltagePolicy::Paper
            && self.network.is_present()
            && !state.history.is_kept()
            && state.held.is_empty()
    }

    /// As `evaluate`; with `moves` also as `advance`, but for what time and exchange leave behind, and without as
    /// `diagnose`.
    pub(super) fn sweep(&mut self, h_ns: i64, moves: bool) {
        let h_s = seconds(h_ns);
        let lags = &self.state.lags;
        let parameters = &self.state.parameters;
        let laws = [
            self.flow(parameters.gain_omega, &lags.frequency, h_s),
            self.flow(parameters.gain_P, &lags.frequency, h_s),
            self.flow(parameters.gain_V, &lags.voltage, h_s),
            self.flow(parameters.gain_Q, &lags.voltage, h_s),
        ];
        let up_to_date = self.is_up_to_date();
        let inputs = &self.state.inputs;
        let diagnosis =
            Diagnosis::new(inputs.omega_ref, inputs.V_ref, inputs.dispatch.then_some(inputs.P_ref));
        let (mut gains, mut inverse_thetas) = ([0.0; 8], [0.0; 8]);
        for (k, law) in laws.iter().enumerate() {
            (gains[k], inverse_thetas[k]) = (law.gain, law.inverse_theta);
        }
        gains[LAWS] = SECONDS_PER_HOUR * parameters.gain_E;
        let mut sweep = Sweep {
            laws,
            gains,
            inverse_thetas,
            power: laws[0].power,
            theta_E_s: self.exchange_layer(h_s).max(0.0),
            fade: self.fade(h_ns),
            h_s,
            moves,
            adds_unseen: [
                lags.frequency.adds_unseen() && up_to_date,
                lags.voltage.adds_unseen() && up_to_date,
            ],
            tallies: Default::default(),
            diagnosis,
            live: &self.topology.live,
            peers: self.network.graph.all_peers(),
            pins: &self.network.pins,
            next_pin: 0,
            state: &mut self.state,
        };
        let (wave, n) = (&mut self.scratch.wave, self.topology.live.len());
        Arch::new().dispatch(Run { wave, n, sweep: &mut sweep });
        let (diagnosis, tallies) = (sweep.diagnosis, sweep.tallies);
        if moves {
            let [frequency, voltage] = tallies;
            self.state.lags.frequency.conclude(frequency);
            self.state.lags.voltage.conclude(voltage);
        } else {
            self.tell(&diagnosis);
        }
    }
}

/// A function that is compiled for each kind of processor.
struct Run<'a, 'b> {
    wave: &'a mut Wave,
    n: usize,
    sweep: &'a mut Sweep<'b>,
}

impl NullaryFnOnce for Run<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.wave.run(self.n, self.sweep);
    }
}

impl Stages for Sweep<'_> {
    #[inline(always)]
    fn measure(&mut self, from: usize, to: usize, lines: &mut [Line]) {
        let mask = lines.len() - 1;
        let State { inputs, parameters, outputs, lags, .. } = &mut *self.state;
        let r = from..to;
        let (omega, P, V, Q, E) = (
            &inputs.omega[r.clone()],
            &inputs.P[r.clone()],
            &inputs.V[r.clone()],
            &inputs.Q[r.clone()],
            &inputs.E[r.clone()],
        );
        let (K_P, K_Q, capacity, P_max) = (
            &parameters.K_P[r.clone()],
            &parameters.K_Q[r.clone()],
            &parameters.capacity[r.clone()],
            &parameters.P_exchange_max[r.clone()],
        );
        let (P_set, Q_set, peers) =
            (&outputs.P_set[r.clone()], &outputs.Q_set[r.clone()], &self.peers[r.clone()]);
        for k in 0..to - from {
            let peers = f64::from(peers[k]);
            lines[(from + k) & mask] = [
                omega[k],
                K_P[k] * (P[k] - P_set[k]),
                V[k],
                K_Q[k] * (Q[k] - Q_set[k]),
                E[k] / capacity[k],
                capacity[k],
                P_max[k] / peers,
                1.0 + peers,
            ];
        }
        if self.adds_unseen[0] {
            for i in r.clone() {
                let sigma = no_load(outputs.omega_set[i], parameters.K_P[i], outputs.P_set[i]);
                lines[i & mask][0] += lags.frequency.unseen(i, sigma);
            }
        }
        if self.adds_unseen[1] {
            for i in r.clone() {
                let sigma = no_load(outputs.V_set[i], parameters.K_Q[i], outputs.Q_set[i]);
                lines[i & mask][2] += lags.voltage.unseen(i, sigma);
            }
        }
        outputs.saturated[r].fill(false);
    }

    #[inline(always)]
    fn raise(&self, differences: &[f64], powers: &mut [f64]) {
        let pairs = powers.iter_mut().zip(differences);
        match self.power {
            SignPower::Root => {
                for (s, d) in pairs {
                    *s = d.abs().sqrt();
                }
            }
            SignPower::Power(eta) => {
                for (s, d) in pairs {
                    *s = power(d.abs(), eta);
                }
            }
            // The fixed-time law is never plain.
            SignPower::Linear | SignPower::FixedTime { .. } => {
                for (s, d) in pairs {
                    *s = d.abs();
                }
            }
        }
    }

    #[inline(always)]
    fn flow(
        &mut self,
        first: usize,
        batch: &[Link],
        lines: &[Line],
        (differences, powers): (&Batch, &Batch),
        sums: &mut [Line],
    ) {
        let mask = lines.len() - 1;
        let (gains, inverse_thetas, theta_E_s, fade) =
            (self.gains, self.inverse_thetas, self.theta_E_s, self.fade);
        let moves = self.moves;
        let flows = &mut self.state.flows[first..first + batch.len()];
        let saturated = &mut self.state.outputs.saturated[..];
        for (k, (link, last)) in batch.iter().zip(flows).enumerate() {
            let [a, b] = link.ends.map(|end| end as usize & mask);
            let (at_a, at_b) = (&lines[a], &lines[b]);
            let (Some(d), Some(s)) =
                (differences[FLOWS * k..].first_chunk::<8>(), powers[FLOWS * k..].first_chunk::<8>())
            else {
                continue;
            };
            let (mut law, mut cap) = ([0.0; 8], [0.0; 8]);
            for k in 0..8 {
                law[k] = gains[k] * link.weight * s[k];
                cap[k] = d[k].abs() * link.share * inverse_thetas[k];
            }
            let least = if at_b[5] < at_a[5] { at_b[5] } else { at_a[5] };
            let crowd = if at_b[7] > at_a[7] { at_b[7] } else { at_a[7] };
            cap[LAWS] = SECONDS_PER_HOUR * least * d[LAWS].abs() / (theta_E_s * crowd);
            let mut flow = [0.0; 8];
            for k in 0..8 {
                // As `min`, in the one comparison that processors have: the law where the cap is not a number.
                flow[k] = if cap[k] < law[k] { cap[k] } else { law[k] };
                flow[k] = flow[k].copysign(d[k]);
            }
            // P_set of the lower end rises by what flows from it.
            let mut exchange = -flow[LAWS];
            let most = if at_b[6] < at_a[6] { at_b[6] } else { at_a[6] };
            let wanted = exchange.abs();
            if wanted > most {
                exchange = most.copysign(exchange);
                for (end, line) in link.ends.into_iter().zip([at_a, at_b]) {
                    if let Some(saturated) = saturated.get_mut(end as usize) {
                        *saturated |= wanted > line[6];
                    }
                }
            }
            if fade < 1.0 {
                exchange = -(*last + fade * (-exchange - *last));
            }
            if moves {
                *last = -exchange;
            }
            flow[LAWS] = exchange;
            // The last three are nobody's.
            for (sum, flow) in sums[a].iter_mut().zip(&flow) {
                *sum -= flow;
            }
            for (sum, flow) in sums[b].iter_mut().zip(&flow) {
                *sum += flow;
            }
        }
    }

    #[inline(always)]
    fn finish(&mut self, from: usize, to: usize, lines: &[Line], sums: &mut [Line]) {
        let mask = lines.len() - 1;
        let State { inputs, parameters, outputs, lags, adopted, clock, .. } = &mut *self.state;
        while let Some(pin) = self.pins.get(self.next_pin).filter(|pin| pin.agent < to) {
            let (line, sum) = (&lines[pin.agent & mask], &mut sums[pin.agent & mask]);
            let [omega, P, V, _] = &self.laws;
            sum[0] -= omega.along(pin.weight, line[0] - inputs.omega_ref, pin.share);
            if inputs.dispatch {
                sum[1] -= P.along(pin.weight, line[1] - inputs.P_ref, pin.share);
            }
            sum[2] -= V.along(pin.weight, line[2] - inputs.V_ref, pin.share);
            self.next_pin += 1;
        }
        if self.moves {
            let compare = clock.samples > 0;
            let [frequency, voltage] = &mut self.tallies;
            lags.frequency.note(
                frequency,
                (from, to),
                (self.live, compare),
                (&inputs.omega, &outputs.omega_set),
                (&parameters.K_P, &inputs.P, &outputs.P_set),
            );
            lags.voltage.note(
                voltage,
                (from, to),
                (self.live, compare),
                (&inputs.V, &outputs.V_set),
                (&parameters.K_Q, &inputs.Q, &outputs.Q_set),
            );
        }
        let (h_s, live) = (self.h_s, &self.live[from..to]);
        let of = |i: usize| (from + i) & mask;
        let (u_omega, u_P) = (&mut outputs.u_omega[from..to], &mut outputs.u_P[from..to]);
        let (u_V, u_Q) = (&mut outputs.u_V[from..to], &mut outputs.u_Q[from..to]);
        let u_E = &mut outputs.u_E[from..to];
        for i in 0..to - from {
            let (line, sum) = (&lines[of(i)], &sums[of(i)]);
            u_omega[i] = sum[0] + sum[1];
            u_P[i] = sum[1];
            u_V[i] = sum[2] + sum[3];
            u_Q[i] = sum[3];
            u_E[i] = if live[i] { -sum[4] / (SECONDS_PER_HOUR * line[5]) } else { 0.0 };
        }
        if self.moves {
            let (omega_set, V_set) = (&mut outputs.omega_set[from..to], &mut outputs.V_set[from..to]);
            let P_set = &mut outputs.P_set[from..to];
            for i in 0..to - from {
                let moved = (omega_set[i] + h_s * u_omega[i], V_set[i] + h_s * u_V[i], sums[of(i)][4]);
                if live[i] {
                    (omega_set[i], V_set[i], P_set[i]) = moved;
                }
            }
        }
        if !self.moves {
            let (available, live) = (&adopted.available, self.live);
            self.diagnosis.take(from, to, |i| {
                let own = lines[i & mask];
                Seen { available: available[i], live: live[i], told_p: own[1], own }
            });
        }
    }
}

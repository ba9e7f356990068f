//! (11) as a physical action: power over the edges from the fuller battery to the emptier one, edge by
//! edge equal and opposite, so that sum P_set = 0 whatever limits. Also the links that ended.

use super::delay::{History, Quantity, Signals};
use super::discretisation::SignPower;
use super::fade::Fades;
use super::graph::Edge;
use super::limits::LimitTable;
use super::network::{Lateness, Network};
use super::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Seconds per hour: energy is counted in pu*h.
pub(super) const SECONDS_PER_HOUR: f64 = 3600.0;

/// What one evaluation of the exchange needs to know besides the state.
#[derive(Clone, Copy)]
pub struct Exchange<'a, S = f64> {
    /// s of the law.
    pub power: SignPower<S>,
    /// g_E.
    pub gain: S,
    /// max(h, theta_E), s; zero is the bare law. Then the same between two parts of a fleet, which do not know how
    /// late the other one's measurements are.
    pub theta_s: [S; 2],
    /// Step, s, for the ramps.
    pub h_s: f64,
    /// C_i, pu*h.
    pub capacity: &'a [f64],
    /// P_exchange_max_i, pu.
    pub P_max: &'a [f64],
    /// What is left of the fade of each flow.
    pub fades: Fades<'a>,
    /// Number of ended links that may still carry something, by agent.
    pub ended: &'a [u32],
    /// Limits of the BESS.
    pub limits: &'a LimitTable,
    /// Whether discharging must not become charging, nor charging discharging.
    pub no_circulation: bool,
    /// 0, but in a derivative.
    pub late: Lateness<S>,
    /// Who tells nothing that makes sense: what both ends agreed on last goes on over its edges. Empty where all do.
    pub mute: &'a [bool],
}

impl<S: Scalar> Exchange<'_, S> {
    /// f_ij = sgn(d) min(3600 g_E w_ij s(d), 3600 min(C_i, C_j) abs(d) / (theta (1 + max(deg_i, deg_j)))),
    /// d = SoC_i - SoC_j, pu, limited to min(P_exchange_max_i / deg_i, P_exchange_max_j / deg_j), both ends
    /// at t - tau, with theta = max(h, theta_E, 2 tau) and deg without the virtual leader. `flows` becomes those
    /// of this step, `last` being those of the step before; `limited` is set for the agents whose limits bind.
    pub fn flows(
        &self,
        network: &Network,
        history: &History,
        signals: &Signals<S>,
        last: &[f64],
        flows: &mut [S],
        limited: &mut [bool],
    ) {
        let c = S::constant;
        let past = (history, self.late);
        for (e, edge) in network.graph.edges().iter().enumerate() {
            let (a, b) = edge.ends();
            if [a, b].iter().any(|&i| self.mute.get(i) == Some(&true)) {
                flows[e] = c(last[e]);
                continue;
            }
            let (soc_a, soc_b) = network.agreed_late(e, past, Quantity::Soc, signals.of(Quantity::Soc));
            let (P_a, P_b) = network.agreed_late(e, past, Quantity::Share, signals.of(Quantity::Share));
            let d = soc_a - soc_b;
            if network.is_closed(a, b) {
                flows[e] = c(last[e]);
                continue;
            }
            let peers = network.peers_of([a, b]).map(f64::from);
            let crowd = c(1.0 + peers[0].max(peers[1]));
            let theta_s = self.theta_s[usize::from(network.crosses(edge.a, edge.b))];
            let m = d.abs();
            let law = c(SECONDS_PER_HOUR) * self.gain * c(edge.weight) * self.power.magnitude(m);
            let theta = if theta_s.value() > 0.0 {
                let longer = if edge.delay_ns.is_some() { c(0.0) } else { c(2.0) * self.late.delay };
                theta_s.max(c(2e-9 * network.delays_ns[e] as f64) + longer)
            } else {
                c(0.0)
            };
            let least = self.capacity[a].min(self.capacity[b]);
            let cap = c(SECONDS_PER_HOUR * least) * m / (theta * crowd);
            let wanted = if d.value() == 0.0 {
                d.through_zero(|| {
                    let law = SECONDS_PER_HOUR * self.gain.value() * edge.weight;
                    let law = if law == 0.0 { 0.0 } else { law * self.power.slope_at_zero() };
                    let cap = SECONDS_PER_HOUR * least / (theta.value() * crowd.value());
                    if law.min(cap).is_finite() { law.min(cap) } else { 0.0 }
                })
            } else {
                law.min(cap)
            };
            // The fuller end gives, the emptier takes.
            let ((giver, P_giver, soc_giver), (taker, P_taker, soc_taker)) = if d.value() > 0.0 {
                ((a, P_a, soc_a), (b, P_b, soc_b))
            } else {
                ((b, P_b, soc_b), (a, P_a, soc_a))
            };
            let [of_giver, of_taker] = if giver == a { peers } else { [peers[1], peers[0]] };
            let give = self.most(giver, P_giver, soc_giver, 1.0) / c(of_giver);
            let take = self.most(taker, P_taker, soc_taker, -1.0) / c(of_taker);
            limited[giver] |= wanted.value() > give.value();
            limited[taker] |= wanted.value() > take.value();
            let flow = wanted.min(give).min(take).copysign(d);
            let rate = ramp(network, self.limits, self.ended, [a, b]);
            let fade = self.fades.share(e);
            let flow = if fade < 1.0 { c(last[e]) + c(fade) * (flow - c(last[e])) } else { flow };
            let step = rate * self.h_s;
            flows[e] =
                if step.is_finite() { flow.min(c(last[e] + step)).max(c(last[e] - step)) } else { flow };
        }
    }

    /// The most that agent `i` may give (`sign` 1) or take (-1), pu, beside its share `P` of the load.
    fn most(&self, i: usize, P: S, soc: S, sign: f64) -> S {
        let mut most = S::constant(self.P_max[i]);
        if self.limits.power {
            let (low, high) = self.limits.P_range(i, soc);
            most = most.min(if sign > 0.0 { high - P } else { P - low }).max(S::constant(0.0));
        }
        if self.no_circulation && P.value() * sign < 0.0 {
            most = most.min(P.abs());
        }
        most
    }
}

/// Share of a link in the ramps of the P_set of its two ends, pu/s: the ramp of an agent is that of all its links
/// together, those that ended and still fade among them.
pub fn ramp(network: &Network, limits: &LimitTable, ended: &[u32], ends: [usize; 2]) -> f64 {
    let (peers, ended) = (network.peers_of(ends), network.ended_of(ends, ended));
    let [a, b] = [0, 1].map(|k| limits.P_set_rate[ends[k]] / (f64::from(peers[k]) + f64::from(ended[k])));
    a.min(b)
}

/// P_set_i = sum_j f_ij + what ended links still carry, pu, for the agents for which `write` holds; `carries`
/// gives what one of them does.
pub fn setpoints<S: Scalar>(
    network: &Network,
    flows: &[S],
    held: &[HeldLink],
    carries: impl Fn(&HeldLink) -> f64,
    write: impl Fn(usize) -> bool,
    P_set: &mut [S],
) {
    for (i, P) in P_set.iter_mut().enumerate() {
        if write(i) {
            *P = S::constant(0.0);
        }
    }
    let edges = network.graph.edges().iter().zip(flows).map(|(edge, &f)| (edge.ends(), f));
    let held = held.iter().map(|link| ((link.a as usize, link.b as usize), S::constant(carries(link))));
    for ((a, b), f) in edges.chain(held) {
        for (i, f) in [(a, f), (b, -f)] {
            if write(i) {
                P_set[i] = P_set[i] + f;
            }
        }
    }
}

/// A link that ended while it carried an exchange. Where it was lost with an agent, both ends keep its last
/// flow, because an exchange needs two: the lost agent holds its P_set, the sum stays 0 and nothing jumps.
/// Where both ends are there but no longer linked, the flow fades.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldLink {
    /// The lower end, from 0.
    pub a: u32,
    /// The higher end, from 0.
    pub b: u32,
    /// Power from `a` to `b`, pu.
    pub flow: f64,
    /// The same before the last step.
    pub before: f64,
    /// Time left of its fade, ns.
    pub left_ns: i64,
}

impl HeldLink {
    /// Whether both ends are live.
    pub fn is_between_live(&self, live: &[bool]) -> bool {
        live[self.a as usize] && live[self.b as usize]
    }
}

/// Carries values that belong to the edges of one graph over to another: edges in both keep theirs, new
/// ones start with `fresh`. Both edge lists are sorted.
pub fn carry_over<T: Copy>(from: &Network, to: &Network, per_edge: usize, values: &[T], fresh: T) -> Vec<T> {
    if values.is_empty() {
        return Vec::new();
    }
    let mut carried = vec![fresh; to.graph.edges().len() * per_edge];
    for (new, edge) in to.graph.edges().iter().enumerate() {
        if let Some(old) = from.graph.find(edge.a, edge.b) {
            let (new, old) = (new * per_edge, old * per_edge);
            carried[new..new + per_edge].copy_from_slice(&values[old..old + per_edge]);
        }
    }
    carried
}

/// The same of one value per edge, new edges starting with theirs in `fresh`.
pub fn carry_over_or(from: &Network, to: &Network, values: &[f64], fresh: &[f64]) -> Vec<f64> {
    let edges = to.graph.edges().iter().zip(fresh);
    let old = |edge: &Edge| values.get(from.graph.find(edge.a, edge.b)?).copied();
    edges.map(|(edge, &fresh)| old(edge).unwrap_or(fresh)).collect()
}

/// The flows over the edges of `now` that go on from those over `before` without a jump: edges in both keep
/// theirs, ended ones are held, held ones that are back start with what was held.
pub fn hand_over(
    held: &mut Vec<HeldLink>,
    (before, now): (&Network, &Network),
    (flows, began): (&[f64], &[f64]),
    fade_ns: i64,
) -> Vec<f64> {
    let mut carried = match carry_over(before, now, 1, flows, 0.0) {
        kept if kept.is_empty() => vec![0.0; now.graph.edges().len()],
        kept => kept,
    };
    held.retain(|link| match now.graph.find(link.a, link.b) {
        Some(edge) => {
            carried[edge] += link.flow;
            false
        }
        None => true,
    });
    for (e, (edge, &flow)) in before.graph.edges().iter().zip(flows).enumerate() {
        if flow != 0.0 && now.graph.find(edge.a, edge.b).is_none() {
            let began = began.get(e).copied().unwrap_or(flow);
            held.push(HeldLink { a: edge.a, b: edge.b, flow, before: began, left_ns: fade_ns });
        }
    }
    carried
}

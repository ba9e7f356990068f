//! Dynamic average consensus: every agent's estimate of the mean voltage from its own voltage and its
//! neighbours' estimates. Used by `voltage_policy = "average"` only.
//!
//! The memory is one transfer z_ij = -z_ji per edge: vbar_i = V_i + sum_j z_ij. So the sum of the estimates
//! is the sum of the voltages by construction, in every connected part, at every instant; when a link
//! ends, both ends drop its transfer and the sum is right again at once, without anybody starting anew.

use super::delay::{History, Quantity, Signals};
use super::discretisation::Flow;
use super::network::Network;
use super::time::seconds;

/// vbar_i = V_i + sum_j z_ij, pu.
pub fn estimates(network: &Network, transfers: &[f64], V: &[f64], vbar: &mut [f64]) {
    vbar.copy_from_slice(V);
    for (edge, &z) in network.graph.edges().iter().zip(transfers) {
        let (a, b) = edge.ends();
        vbar[a] += z;
        vbar[b] -= z;
    }
}

/// One Metropolis step on what both ends agree on: z_ij(t + h) = z_ij(t - tau) - (tau + h) f_ij(t - tau), f_ij the
/// capped flow (DESIGN 1.1) of vbar_i - vbar_j with theta = max(tau + h, theta_min); `flows` are made for no delay,
/// at which this is z_ij -= h f_ij, the second for edges between parts of a fleet.
///
/// Taking the transfer too at t - tau makes each round of messages a full step of consensus, where an
/// integrator z_ij' = -f_ij(t - tau) must be kept slow, theta >= 2 tau, not to overshoot on old values. In the
/// boundary layer the edges are then c_ij p / (1 - p), p the shift by tau_ij + h: c_ij (1 / (1 - p) - 1), whose real
/// part is at least -c_ij / 2 wherever abs(p) <= 1. So the estimates settle for all delays, equal or not, as
/// long as no eigenvalue of the Laplacian of the c_ij reaches 2; with sums of c_ij below 1 at every agent,
/// which `round_shares` are, none does.
pub fn advance(
    network: &Network,
    history: &History,
    signals: &Signals,
    flows: [&Flow; 2],
    h_ns: i64,
    before: &[f64],
    after: &mut [f64],
) {
    let vbar = signals.of(Quantity::MeanV);
    for (e, edge) in network.graph.edges().iter().enumerate() {
        let (at_a, at_b) = network.agreed(e, history, Quantity::MeanV, vbar);
        let (z, age_ns) = network.agreed_transfer(e, history, before);
        let (a, b) = edge.ends();
        if network.is_closed(a, b) {
            after[e] = before[e];
            continue;
        }
        let mut flow = *flows[usize::from(network.crosses(edge.a, edge.b))];
        let mut share = network.shares[e];
        let round_s = seconds(age_ns.saturating_add(h_ns));
        if age_ns > 0 {
            flow.inverse_theta = flow.inverse_theta.min(1.0 / round_s);
            share = network.round_shares[e];
        }
        after[e] = z - round_s * flow.along(edge.weight, at_a - at_b, share);
    }
}

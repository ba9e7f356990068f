//! Dynamic average consensus: every agent's estimate of the mean voltage from its own voltage and its
//! neighbours' estimates. Used by `voltage_policy = "average"` only.
//!
//! The memory is one transfer z_ij = -z_ji per edge: vbar_i = V_i + sum_j z_ij. So the sum of the estimates
//! is the sum of the voltages by construction, in every connected part, at every instant; when a link
//! ends, both ends drop its transfer and the sum is right again at once, without anybody starting anew.

use super::delay::{History, Quantity, Signals};
use super::discretisation::Flow;
use super::network::Network;

/// vbar_i = V_i + sum_j z_ij, pu.
pub fn estimates(network: &Network, transfers: &[f64], V: &[f64], vbar: &mut [f64]) {
    vbar.copy_from_slice(V);
    for (edge, &z) in network.graph.edges().iter().zip(transfers) {
        let (a, b) = edge.ends();
        vbar[a] += z;
        vbar[b] -= z;
    }
}

/// z_ij -= h f_ij, f_ij the capped flow (DESIGN 1.1) of vbar_i - vbar_j, both at t - tau, with
/// theta = max(h, theta_min, 2 tau) so that no delay destabilises it; `flow` is made for no delay.
pub fn advance(
    network: &Network,
    history: &History,
    signals: &Signals,
    flow: &Flow,
    h_s: f64,
    transfers: &mut [f64],
) {
    let vbar = signals.of(Quantity::MeanV);
    for (e, edge) in network.graph.edges().iter().enumerate() {
        let (at_a, at_b) = network.agreed(e, history, Quantity::MeanV, vbar);
        let mut flow = *flow;
        // At no delay this is infinite and leaves theta alone.
        flow.inverse_theta = flow.inverse_theta.min(1e9 / (2.0 * network.delays_ns[e] as f64));
        transfers[e] -= h_s * flow.along(edge.weight, at_a - at_b, network.shares[e]);
    }
}

//! The five control laws, one function per numbered equation (9)-(13), each with its gain and its
//! boundary layer in the [`Flow`]. They turn differences into rates; what happens to the rates is not theirs.

use super::delay::{History, Quantity, Signals};
use super::discretisation::Flow;
use super::network::{Lateness, Network};
use super::scalar::Scalar;

/// What the laws look at: the graph, the past, the present.
#[derive(Clone, Copy)]
pub struct View<'a, S = f64> {
    /// The graph in force.
    pub network: &'a Network,
    /// Past values.
    pub history: &'a History,
    /// Present values.
    pub signals: &'a Signals<S>,
    /// What agents tell of them: the same, but for faults.
    pub told: &'a Signals<S>,
    /// 0, but in a derivative.
    pub late: Lateness<S>,
}

impl<S: Scalar> View<'_, S> {
    fn diffuse(&self, quantity: Quantity, flow: &Flow<S>, out: &mut [S]) {
        let (own, told) = (self.signals.of(quantity), self.told.of(quantity));
        self.network.diffuse((self.history, self.late), (quantity, own, told), flow, out);
    }
}

/// (9): u_P_i = -sum_j w_ij s(p_i - p_j), pu/s, p_i = K_P_i (P_i - P_set_i). With `dispatch` the pinned
/// agents add -a_0i s(p_i - P_ref), by which the fleet follows the virtual leader's power.
pub fn active_power<S: Scalar>(view: View<'_, S>, flow: &Flow<S>, dispatch: Option<S>, u_P: &mut [S]) {
    u_P.fill(S::constant(0.0));
    view.diffuse(Quantity::P, flow, u_P);
    if let Some(P_ref) = dispatch {
        view.network.pull(view.signals.of(Quantity::P), P_ref, flow, u_P);
    }
}

/// (10): u_Q_i = -sum_j w_ij s(q_i - q_j), pu/s, q_i = K_Q_i (Q_i - Q_set_i).
pub fn reactive_power<S: Scalar>(view: View<'_, S>, flow: &Flow<S>, u_Q: &mut [S]) {
    u_Q.fill(S::constant(0.0));
    view.diffuse(Quantity::Q, flow, u_Q);
}

/// (12): u_omega_i = -sum_j w_ij s(omega_i - omega_j) + u_P_i - a_0i s(omega_i - omega_ref), pu/s.
pub fn frequency<S: Scalar>(view: View<'_, S>, flow: &Flow<S>, u_P: &[S], omega_ref: S, u_omega: &mut [S]) {
    u_omega.fill(S::constant(0.0));
    view.diffuse(Quantity::Omega, flow, u_omega);
    view.network.pull(view.signals.of(Quantity::Omega), omega_ref, flow, u_omega);
    add(u_P, u_omega);
}

/// (13): u_V_i = -sum_j w_ij s(V_i - V_j) + u_Q_i - a_0i s(V_i - V_ref), pu/s.
pub fn voltage<S: Scalar>(view: View<'_, S>, flow: &Flow<S>, u_Q: &[S], V_ref: S, u_V: &mut [S]) {
    u_V.fill(S::constant(0.0));
    view.diffuse(Quantity::V, flow, u_V);
    view.network.pull(view.signals.of(Quantity::V), V_ref, flow, u_V);
    add(u_Q, u_V);
}

fn add<S: Scalar>(terms: &[S], sums: &mut [S]) {
    for (sum, &term) in sums.iter_mut().zip(terms) {
        *sum = *sum + term;
    }
}

/// (13) for the average voltage: u_V_i = u_Q_i - a_0i s(vbar_i - V_ref), pu/s; vbar_i from `estimator`. An agent's
/// own voltage moves its estimate at once and by its full size, though it is one of n: what the neighbours take
/// of it shows after tau. A pull that does not wait for that holds the estimate of the leader instead of the
/// mean, and two leaders hold each other: the law is also capped at abs(vbar_i - V_ref) / tau.
pub fn average_voltage<S: Scalar>(view: View<'_, S>, flow: &Flow<S>, u_Q: &[S], V_ref: S, u_V: &mut [S]) {
    u_V.copy_from_slice(u_Q);
    view.network.pull_by_rounds(view.signals.of(Quantity::MeanV), (V_ref, view.late), flow, u_V);
}

/// (11): u_E_i = -P_set_i / (3600 C_i), 1/s: the rate of SoC that the power exchange of `exchange`
/// brings about, which with unit gain and capacity is -sum_j w_ij s(E_i - E_j).
pub fn energy<S: Scalar>(P_set: &[S], capacity: &[f64], u_E: &mut [S]) {
    for (u, (&P, &C)) in u_E.iter_mut().zip(P_set.iter().zip(capacity)) {
        *u = -P / S::constant(3600.0 * C);
    }
}

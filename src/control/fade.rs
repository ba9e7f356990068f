//! How the energy exchange fades from what it was to what the law asks for: a straight line over
//! `exchange_fade_s`, link by link, after enabling and where a link is new or has other neighbours. Knows times and
//! links; never a flow.

use super::graph::Edge;
use super::network::Network;
use super::state::State;

/// What is left of the fades, ns: by edge, or where that is empty the same for all.
#[derive(Clone, Copy, Debug)]
pub struct Fades<'a> {
    /// Length of the step, ns.
    pub h_ns: i64,
    /// Of all edges.
    pub left_ns: i64,
    /// Of each; empty where all are alike.
    pub of_edges_ns: &'a [i64],
}

impl Fades<'_> {
    /// Share of the step's law in the flow of edge `e`, the rest being the flow of the last step: 1 but while it
    /// fades.
    #[inline]
    pub fn share(&self, e: usize) -> f64 {
        share(self.h_ns, self.of_edges_ns.get(e).copied().unwrap_or(self.left_ns))
    }
}

/// Share of a step of `h_ns` in what is left of a fade: a straight line.
pub fn share(h_ns: i64, left_ns: i64) -> f64 {
    if h_ns >= left_ns { 1.0 } else { h_ns.max(0) as f64 / left_ns as f64 }
}

/// What is left for the edges of `now`: those of `before` that are as they were go on, the others begin anew.
pub fn carried(
    (before, now): (&Network, &Network),
    (left_ns, of_edges_ns): (i64, &[i64]),
    fade_ns: i64,
) -> Vec<i64> {
    let of = |edge: &Edge| {
        let ends = [edge.a as usize, edge.b as usize];
        let old = before.graph.find(edge.a, edge.b)?;
        let was = before.graph.edges().get(old)?;
        let is_same = was.weight == edge.weight
            && was.delay_ns == edge.delay_ns
            && before.peers_of(ends) == now.peers_of(ends);
        is_same.then(|| of_edges_ns.get(old).copied().unwrap_or(left_ns))
    };
    now.graph.edges().iter().map(|edge| of(edge).unwrap_or(fade_ns)).collect()
}

impl State {
    /// Takes over what is left of the fades of all edges, ns.
    pub(super) fn set_fades(&mut self, left_ns: Vec<i64>) {
        self.edge_fades_ns = left_ns;
        self.join_fades();
    }

    /// A step of `h_ns` is over, but on closed links of `network`. Allocates nothing.
    pub(super) fn pass_fades(&mut self, h_ns: i64, network: &Network) {
        let left = |left_ns: i64| (left_ns - h_ns).max(0);
        if self.edge_fades_ns.is_empty() && !network.has_closed() {
            self.fade_left_ns = left(self.fade_left_ns);
            return;
        }
        if self.edge_fades_ns.is_empty() {
            self.edge_fades_ns.resize(network.graph.edges().len(), self.fade_left_ns);
        }
        for (fade, edge) in self.edge_fades_ns.iter_mut().zip(network.graph.edges()) {
            let (a, b) = edge.ends();
            if !network.is_closed(a, b) {
                *fade = left(*fade);
            }
        }
        self.fade_left_ns = left(self.fade_left_ns);
        self.join_fades();
    }

    /// Fades that are all alike are told in one number.
    fn join_fades(&mut self) {
        if let Some(&first) = self.edge_fades_ns.first()
            && self.edge_fades_ns.iter().all(|&left| left == first)
        {
            self.fade_left_ns = first;
            self.edge_fades_ns.clear();
        }
    }
}

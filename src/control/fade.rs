//! How the energy exchange fades from what it was to what the law asks for: a straight line over
//! `exchange_fade_s`, link by link, after enabling and where a link is new or has other neighbours. Knows times and
//! links; never a flow.

use super::graph::Edge;
use super::network::Network;
use serde::{Deserialize, Serialize};

/// What is left of the fades, ns, of a step.
#[derive(Clone, Copy, Debug)]
pub struct Fades<'a> {
    /// Length of the step, ns.
    pub h_ns: i64,
    /// What is left.
    pub left: &'a Left,
}

impl Fades<'_> {
    /// Share of the step's law in the flow of edge `e`, the rest being the flow of the last step: 1 but while it
    /// fades.
    #[inline]
    pub fn share(&self, e: usize) -> f64 {
        share(self.h_ns, self.left.of(e))
    }
}

/// What is left of the fades, ns.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Left {
    /// Of all edges, while they are alike.
    all_ns: i64,
    /// Of each edge, where they are not; else 0.
    edges_ns: Vec<i64>,
    differ: bool,
}

/// Share of a step of `h_ns` in what is left of a fade: a straight line.
pub fn share(h_ns: i64, left_ns: i64) -> f64 {
    if h_ns >= left_ns { 1.0 } else { h_ns.max(0) as f64 / left_ns as f64 }
}

impl Left {
    /// All anew, of `edges` edges.
    pub fn all(fade_ns: i64, edges: usize) -> Self {
        Self { all_ns: fade_ns, edges_ns: vec![0; edges], differ: false }
    }

    /// All anew.
    pub fn begin(&mut self, fade_ns: i64) {
        self.edges_ns.fill(0);
        (self.all_ns, self.differ) = (fade_ns, false);
    }

    /// What is left of edge `e`, ns.
    #[inline]
    fn of(&self, e: usize) -> i64 {
        if self.differ { self.edges_ns.get(e).copied().unwrap_or(self.all_ns) } else { self.all_ns }
    }

    /// The same of all edges, where they are alike.
    pub fn alike(&self) -> Option<i64> {
        (!self.differ).then_some(self.all_ns)
    }

    /// Whether it is that of `edges` edges.
    pub fn fits(&self, edges: usize) -> bool {
        self.all_ns >= 0 && self.edges_ns.len() == edges && self.edges_ns.iter().all(|&left| left >= 0)
    }

    /// Sets what is left of the edges for which `change` says something. Allocates nothing.
    pub fn set(&mut self, change: impl Fn(usize) -> Option<i64>) {
        for e in 0..self.edges_ns.len() {
            self.edges_ns[e] = change(e).unwrap_or_else(|| self.of(e));
        }
        self.differ = true;
        self.join();
    }

    /// A step of `h_ns` is over, but on closed links of `network`. Allocates nothing.
    pub fn pass(&mut self, h_ns: i64, network: &Network) {
        let after = |left_ns: i64| (left_ns - h_ns).max(0);
        if !self.differ && !network.has_closed() {
            self.all_ns = after(self.all_ns);
            return;
        }
        for (e, edge) in network.graph.edges().iter().enumerate() {
            let (a, b) = edge.ends();
            let left = self.of(e);
            self.edges_ns[e] = if network.is_closed(a, b) { left } else { after(left) };
        }
        self.differ = true;
        self.join();
    }

    /// Fades that are all alike are told in one number.
    fn join(&mut self) {
        if self.edges_ns.windows(2).all(|pair| pair[0] == pair[1]) {
            let all_ns = self.edges_ns.first().copied().unwrap_or(self.all_ns);
            self.begin(all_ns);
        }
    }

    /// What is left for the edges of `now`: those of `before` that are as they were go on, the others begin anew.
    pub fn carried(&self, (before, now): (&Network, &Network), fade_ns: i64) -> Self {
        let mut carried = Self::all(fade_ns, now.graph.edges().len());
        let of = |edge: &Edge| {
            let (a, b) = edge.ends();
            let old = before.graph.find(edge.a, edge.b)?;
            let was = before.graph.edges().get(old)?;
            let is_same = was.weight == edge.weight
                && was.delay_ns == edge.delay_ns
                && before.peers_of([a, b]) == now.peers_of([a, b])
                && (now.is_closed(a, b) || !before.is_closed(a, b));
            is_same.then(|| self.of(old))
        };
        carried.set(|e| of(&now.graph.edges()[e]));
        carried
    }
}

//! What a part of a fleet knows of its links to other parts, ready for the laws: who is outside, and of both ends
//! of such a link what both told of the same sample. Knows no graph and no messages; `across` fills it.

use super::delay::{Bracket, History, Quantity};
use super::graph::Edge;
use super::network::Network;
use super::scalar::Scalar;

/// By agent of the part, its neighbours outside among them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outer {
    /// Whether the agent is a neighbour outside.
    pub outside: Vec<bool>,
    /// Its number in the fleet, from 0.
    pub numbers: Vec<u32>,
    /// Links it told of.
    pub peers: Vec<u32>,
    /// Ended links it told of.
    pub ended: Vec<u32>,
    /// Whether it told that its controller acts.
    pub enabled: Vec<bool>,
    /// Whether it told that it takes part.
    pub available: Vec<bool>,
    /// Whether it leads its cluster by what all told; empty where that is fixed.
    pub leads: Vec<bool>,
    /// Least delay of a link to another part, ns.
    pub step_ns: i64,
    /// The longest delay that a link anywhere in the fleet has of its own, ns.
    pub longest_delay_ns: i64,
    /// Whether one anywhere has the common delay.
    pub has_common_delay: bool,
}

impl Outer {
    /// Whether a link between these two leads to another part.
    pub fn crosses(&self, a: usize, b: usize) -> bool {
        self.outside[a] != self.outside[b]
    }

    /// Whether nothing moves over it, because one end acts and the other does not. Where neither did, both may
    /// begin now: who was wrong about that takes the step back when it is told.
    pub fn is_closed(&self, a: usize, b: usize) -> bool {
        self.crosses(a, b) && self.enabled[a] != self.enabled[b]
    }

    /// Whether both told that they take part.
    pub fn are_available(&self, a: usize, b: usize) -> bool {
        self.available[a] && self.available[b]
    }

    /// Whether an edge leads to another part.
    pub fn crosses_edge(&self, edge: &Edge) -> bool {
        self.crosses(edge.a as usize, edge.b as usize)
    }
}

impl Network {
    /// Takes over what is known of the links to other parts, and gives those links the shares that both ends agree on.
    pub fn set_outer(&mut self, outer: Outer) {
        for (e, edge) in self.graph.edges().iter().enumerate().filter(|(_, edge)| outer.crosses_edge(edge)) {
            let [a, b] = [edge.a as usize, edge.b as usize];
            let peers = outer.peers[a].max(outer.peers[b]);
            let is_pinned = |i: usize| outer.leads.get(i).copied().unwrap_or(self.graph.pins()[i] > 0.0);
            let degree = |i: usize| outer.peers[i] + u32::from(is_pinned(i));
            self.shares[e] = 1.0 / (1.0 + f64::from(degree(a).max(degree(b))));
            self.round_shares[e] = 1.0 / (0.5 + f64::from(peers));
        }
        self.outer = Some(outer);
    }

    /// What is known of links to other parts, where there are any.
    pub fn outer(&self) -> Option<&Outer> {
        self.outer.as_ref()
    }

    /// Whether a link between these two leads to another part.
    pub fn crosses(&self, a: u32, b: u32) -> bool {
        self.outer.as_ref().is_some_and(|outer| outer.crosses(a as usize, b as usize))
    }

    /// Whether a link between these two leads to another part and nothing moves over it, because one end acts and the
    /// other does not.
    pub fn is_closed(&self, a: usize, b: usize) -> bool {
        self.outer.as_ref().is_some_and(|outer| outer.is_closed(a, b))
    }

    /// Whether any link is closed.
    pub(super) fn has_closed(&self) -> bool {
        self.outer.as_ref().is_some_and(|outer| {
            self.graph.edges().iter().any(|edge| outer.is_closed(edge.a as usize, edge.b as usize))
        })
    }

    /// Number of neighbours of the two ends of a link, as both know it.
    pub fn peers_of(&self, [a, b]: [usize; 2]) -> [u32; 2] {
        match &self.outer {
            Some(outer) if outer.crosses(a, b) => [outer.peers[a], outer.peers[b]],
            _ => [self.graph.peers(a), self.graph.peers(b)],
        }
    }

    /// Ended links of the two ends of a link, `ended` by agent, as both know it.
    pub fn ended_of(&self, [a, b]: [usize; 2], ended: &[u32]) -> [u32; 2] {
        match &self.outer {
            Some(outer) if outer.crosses(a, b) => [outer.ended[a], outer.ended[b]],
            _ => [ended[a], ended[b]],
        }
    }

    /// Number of agent `i` in the fleet, from 0.
    pub(super) fn number(&self, i: u32) -> u32 {
        self.outer.as_ref().map_or(i, |outer| outer.numbers[i as usize])
    }

    /// What is known of agent `i`'s quantity. What arrives from another part is of the newest sample: it moves with
    /// the input that it arrives by.
    pub(super) fn value<S: Scalar>(
        &self,
        history: &History,
        at: Bracket,
        (quantity, i): (Quantity, usize),
        present: &[S],
        late: S,
    ) -> S {
        let arrives = S::CARRIES_TANGENT && self.outer.as_ref().is_some_and(|outer| outer.outside[i]);
        let at = if arrives { history.arriving(at) } else { at };
        history.value_late(at, quantity, i, present, late)
    }
}

//! A part of a fleet runs: what its agents tell their neighbours in other parts, what they hear, and the graph that
//! follows from it. Acts on what both ends of a link told of the same sample, so that both do the same; never on
//! anything else of the outside.
//!
//! A message about sample t leaves with the step from t and arrives with the next one, at t + h. So a neighbour's
//! value of t - h is there, where the laws ask for x_j(t - tau), tau >= h, and where they ask for both ends at t - tau
//! one's own is in the past that is kept anyway. What the neighbour did in the step from t - h is known a step late
//! too: who moved while the other did not takes that step back.

use super::controller::Controller;
use super::delay::Quantity;
use super::graph::{Components, Edge, Graph};
use super::messages::Standing;
use super::network::Network;
use super::outer::Outer;
use super::part::Part;
use super::scalar::Dual;
use super::tangent::Tangents;
use super::time::nanoseconds;
use super::topology::Topology;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A part, with the places of those who hear and are heard.
#[derive(Clone, Debug)]
pub(super) struct Across {
    pub part: Part,
    /// Whether each agent is outside.
    pub outside: Vec<bool>,
    /// Place of each neighbour outside.
    pub slots: Vec<usize>,
    /// Place of each of one's own agents that has one.
    pub tellers: Vec<usize>,
}

impl Across {
    /// Of a checked part, with the communication of its configuration.
    pub fn new(part: &Part, communication: &super::communication::Communication) -> Self {
        let place = |agent: u32| part.agents.binary_search(&agent).unwrap_or(0);
        Self {
            outside: part.agents.iter().map(|&agent| part.is_outside(agent)).collect(),
            slots: part.outside.iter().map(|outside| place(outside.agent)).collect(),
            tellers: part.tellers(communication).into_iter().map(place).collect(),
            part: part.clone(),
        }
    }

    /// Hops to be expected of these agents in topology `k`.
    pub fn hops(&self, k: usize, agents: &[usize]) -> Vec<i32> {
        agents.iter().map(|&i| self.part.topologies[k].hops[i]).collect()
    }
}

impl Controller {
    /// The part that this is, where it is one.
    pub fn part(&self) -> Option<&Part> {
        self.fixed.across.as_ref().map(|across| &across.part)
    }

    /// Places of its own agents; all, where it is no part.
    pub fn own_agents(&self) -> Vec<usize> {
        let outside = |i: usize| self.fixed.across.as_ref().is_some_and(|across| across.outside[i]);
        (0..self.agents()).filter(|&i| !outside(i)).collect()
    }

    /// Places of the neighbours outside, and of its own agents that have some.
    pub fn slots_and_tellers(&self) -> (&[usize], &[usize]) {
        self.fixed.across.as_ref().map_or((&[], &[]), |across| (&across.slots, &across.tellers))
    }

    /// In initialisation the agents tell how they stand now, as if the graph were whole, and take over what they
    /// have been told.
    pub(super) fn introduce(&mut self) {
        let Some(across) = &self.fixed.across else { return };
        let (inputs, k) = (&self.state.inputs, self.state.adopted.topology);
        let standing = &mut self.state.outputs.local.standing;
        for (m, &i) in across.tellers.iter().enumerate() {
            let hops = across.part.topologies[k].hops[i];
            standing.available[m] = inputs.available[i] && hops < across.part.fleet as i32;
            standing.enabled[m] = inputs.enable;
            (standing.hops[m], standing.links[m], standing.ended[m]) = (hops, 0, 0);
        }
        let state = &mut self.state;
        state.adopted.own.clone_from(&state.outputs.local.standing);
        state.adopted.remote.clone_from(&state.inputs.remote.standing);
        for (k, &slot) in across.slots.iter().enumerate() {
            state.inputs.available[slot] = state.adopted.remote.available[k];
        }
    }

    /// Takes over what both ends of the links to other parts told last; says whether the graph is another one now.
    pub(super) fn take_standings(&mut self) -> bool {
        let Some(across) = &self.fixed.across else { return false };
        let state = &mut self.state;
        let (own, remote) = (&state.outputs.local.standing, &state.inputs.remote.standing);
        if state.adopted.own == *own && state.adopted.remote == *remote {
            return false;
        }
        let shown = |standing: &Standing| (standing.available.clone(), standing.hops.clone());
        let graph_changes =
            state.adopted.own.available != own.available || shown(&state.adopted.remote) != shown(remote);
        state.adopted.own.clone_from(own);
        state.adopted.remote.clone_from(remote);
        for (k, &slot) in across.slots.iter().enumerate() {
            state.inputs.available[slot] = remote.available[k];
        }
        self.take_back();
        if !graph_changes {
            self.look_outside();
        }
        graph_changes
    }

    /// The last step on links whose other end did not make it.
    fn take_back(&mut self) {
        let Some(across) = &self.fixed.across else { return };
        let state = &mut self.state;
        let remote = &state.adopted.remote;
        let mut gone = vec![false; across.outside.len()];
        let mut off = gone.clone();
        for (k, &slot) in across.slots.iter().enumerate() {
            (gone[slot], off[slot]) = (!remote.available[k], !remote.enabled[k]);
        }
        // Of those who were gone before, both ends knew it.
        let were_there = |a: u32, b: u32| {
            self.network.outer().is_some_and(|outer| outer.are_available(a as usize, b as usize))
        };
        let did_not = |a: u32, b: u32| {
            let either = |flags: &[bool]| flags[a as usize] || flags[b as usize];
            either(&off) || (either(&gone) && were_there(a, b))
        };
        // Who acts sums its links anew in the next step; who does not, holds what it has to.
        let P_set = &mut state.outputs.P_set;
        let mut restore = |(a, b): (u32, u32), flow: &mut f64, before: f64| {
            let back = before - *flow;
            for (i, back) in [(a as usize, back), (b as usize, -back)] {
                P_set[i] += if across.outside[i] { 0.0 } else { back };
            }
            *flow = before;
        };
        for (e, edge) in self.network.graph.edges().iter().enumerate() {
            if did_not(edge.a, edge.b) {
                restore((edge.a, edge.b), &mut state.flows[e], state.before.flows[e]);
                state.transfers[e] = state.before.transfers[e];
            }
        }
        for link in &mut state.held {
            if did_not(link.a, link.b) {
                restore((link.a, link.b), &mut link.flow, link.before);
            }
        }
    }

    /// What is known of the links to other parts, from what was taken over last.
    fn outer(&self) -> Option<Outer> {
        let across = self.fixed.across.as_ref()?;
        let (adopted, n) = (&self.state.adopted, across.outside.len());
        let agreed = &across.part.topologies[adopted.topology];
        let mut outer = Outer {
            outside: across.outside.clone(),
            numbers: across.part.agents.iter().map(|agent| agent - 1).collect(),
            peers: agreed.links.clone(),
            ended: vec![0; n],
            enabled: vec![false; n],
            available: vec![false; n],
            leads: Vec::new(),
            step_ns: nanoseconds(across.part.step_s),
            longest_delay_ns: nanoseconds(agreed.longest_delay_s),
            has_common_delay: agreed.has_common_delay,
        };
        let own = across.tellers.iter().enumerate().map(|(m, &i)| (i, &adopted.own, m));
        let remote = across.slots.iter().enumerate().map(|(k, &i)| (i, &adopted.remote, k));
        for (i, standing, k) in own.chain(remote) {
            // Nobody has fewer links than the one that is asked about.
            outer.peers[i] = outer.peers[i].saturating_add_signed(standing.links[k]).max(1);
            outer.ended[i] = standing.ended[k].max(0) as u32;
            (outer.enabled[i], outer.available[i]) = (standing.enabled[k], standing.available[k]);
        }
        if let Some((_, leaders)) = self.elected(&outer.available) {
            outer.leads = (0..n).map(|i| leaders.contains(&i)).collect();
        }
        Some(outer)
    }

    /// The same graph, whose ends know something new of each other.
    fn look_outside(&mut self) {
        let Some(outer) = self.outer() else { return };
        let mut before = self.network.clone();
        std::mem::swap(&mut before, &mut self.network);
        self.network.set_outer(outer);
        self.carry_fades(&before);
    }

    /// Gives a new graph what is known of the links to other parts.
    pub(super) fn surround(&mut self) {
        if let Some(outer) = self.outer() {
            self.network.set_outer(outer);
        }
    }

    /// Lets the fades of links go on that are as they were; the others begin anew.
    pub(super) fn carry_fades(&mut self, before: &Network) {
        let fade_ns = nanoseconds(self.fixed.exchange_fade_s);
        self.state.fades = self.state.fades.carried((before, &self.network), fade_ns);
        for link in &mut self.state.held {
            let [a, b] = [link.a as usize, link.b as usize];
            if before.is_closed(a, b) && !self.network.is_closed(a, b) {
                link.left_ns = fade_ns;
            }
        }
    }

    /// The graph in force: links to other parts where both ends told that they take part, live agents where a pin is
    /// in reach. Agents outside are never live here: nobody acts for them.
    pub(super) fn part_topology(&self, across: &Across) -> Option<(Topology, Vec<i32>)> {
        let adopted = &self.state.adopted;
        let (graph, cluster, leaders) = self.topologies.written(adopted.topology)?;
        let outer = self.outer()?;
        let (n, none) = (graph.agents(), across.part.fleet as i32);
        let is_in = |i: usize| if across.outside[i] { outer.available[i] } else { adopted.available[i] };
        let elected = self.elect(across, &outer);
        let (graph, leaders) =
            elected.as_ref().map_or((graph, leaders), |(graph, all)| (graph, all.as_slice()));
        let mut hops = vec![none; n];
        for (k, &slot) in across.slots.iter().enumerate().filter(|(_, slot)| is_in(**slot)) {
            hops[slot] = adopted.remote.hops[k].clamp(0, none);
        }
        for i in (0..n).filter(|&i| !across.outside[i] && is_in(i) && graph.pins()[i] > 0.0) {
            hops[i] = 0;
        }
        let mut queue: BinaryHeap<_> = (0..n).map(|i| Reverse((hops[i], i))).collect();
        while let Some(Reverse((found, i))) = queue.pop() {
            if found > hops[i] || found + 1 >= none {
                continue;
            }
            for &j in graph.neighbours(i) {
                let j = j as usize;
                if !across.outside[j] && is_in(j) && hops[j] > found + 1 {
                    hops[j] = found + 1;
                    queue.push(Reverse((hops[j], j)));
                }
            }
        }
        let live: Vec<bool> = (0..n).map(|i| !across.outside[i] && is_in(i) && hops[i] < none).collect();
        let holds = |edge: &&Edge| {
            let (a, b) = edge.ends();
            if outer.crosses(a, b) {
                outer.are_available(a, b) && (live[a] || live[b])
            } else {
                live[a] && live[b]
            }
        };
        let edges = graph.edges().iter().filter(holds).copied().collect();
        let pins = graph
            .pins()
            .iter()
            .enumerate()
            .map(|(i, &pin)| if live[i] || (across.outside[i] && is_in(i)) { pin } else { 0.0 });
        let graph = Graph::new(n, edges, pins.collect());
        let part_of = |i: usize| match (across.outside[i] || !is_in(i), live[i]) {
            (true, _) => Components::NONE,
            (false, true) => 0,
            (false, false) => u32::from(live.contains(&true)),
        };
        let of: Vec<u32> = (0..n).map(part_of).collect();
        let count = of.iter().filter(|&&p| p != Components::NONE).max().map_or(0, |&p| p as usize + 1);
        let pinned = (0..count).map(|p| p == 0 && live.contains(&true)).collect();
        let leaders = leaders.iter().copied().filter(|&i| live[i]).collect();
        let parts = Components { of, pinned };
        Some((Topology { graph, cluster: cluster.to_vec(), leaders, live, parts }, hops))
    }

    /// Puts what arrived in the place of the newest sample of those outside.
    pub(super) fn hear(&mut self) {
        let Some(across) = &self.fixed.across else { return };
        let (state, signals) = (&mut self.state, &mut self.scratch.signals);
        for (values, remote) in signals.0.iter_mut().zip(&state.inputs.remote.values) {
            for (&slot, &value) in across.slots.iter().zip(remote) {
                values[slot] = value;
            }
        }
        for &slot in &across.slots {
            state.history.amend(slot, signals);
        }
    }

    /// Tells the other parts of the sample just evaluated; how the agents stand, after a step only.
    pub(super) fn tell_outside(&mut self, has_stepped: bool) {
        let Some(across) = &self.fixed.across else { return };
        let state = &mut self.state;
        state.outputs.local.tell(&across.tellers, self.scratch.told());
        if !has_stepped {
            return;
        }
        let agreed = &across.part.topologies[state.adopted.topology];
        let standing = &mut state.outputs.local.standing;
        for (m, &i) in across.tellers.iter().enumerate() {
            standing.available[m] = self.topology.live[i];
            standing.enabled[m] = state.adopted.enable;
            standing.hops[m] = self.scratch.hops[i];
            standing.links[m] = self.network.graph.peers(i) as i32 - agreed.links[i] as i32;
            standing.ended[m] = self.scratch.ended[i] as i32;
        }
    }

    /// Whether the message faults of agent `i` are somebody else's to make.
    pub(super) fn is_outside(&self, i: usize) -> bool {
        self.fixed.across.as_ref().is_some_and(|across| across.outside[i])
    }

    /// The share of the load counts where a limit asks for it; else nothing is told of it.
    pub fn tells_share(&self) -> bool {
        !self.scratch.shares.is_empty()
    }

    /// Whether agents tell of ended links: where the ramp of P_set is shared among them.
    pub fn tells_ended(&self) -> bool {
        self.fixed.limits.P_set_rate.iter().any(|rate| rate.is_finite())
    }

    /// A value of what arrived from slot `k`.
    pub fn heard(&self, quantity: Quantity, k: usize) -> f64 {
        self.state.inputs.remote.of(quantity)[k]
    }
}

impl Controller {
    /// What arrives moves as the inputs that it arrives by.
    pub(super) fn remote_rates(&self, tangents: &mut Tangents) {
        let Some(across) = &self.fixed.across else { return };
        let rates = tangents.inputs.remote.values.iter();
        for ((signals, values), rates) in
            tangents.signals.0.iter_mut().zip(&self.state.inputs.remote.values).zip(rates)
        {
            for ((&slot, &value), &rate) in across.slots.iter().zip(values).zip(rates) {
                signals[slot] = Dual::new(value, rate);
            }
        }
    }
}

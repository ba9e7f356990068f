//! Numbers the agents of a written graph such that neighbours are close in number, by reverse Cuthill-McKee (1969;
//! George 1971): what a step works on then stays in the cache. Renumbers a configuration; who is asked for agent
//! i afterwards, at [`Order::at`], is not its business.

use super::communication::{Communication, Explicit, ExplicitTopology};
use super::config::Config;

/// Fewer agents fit the cache in any order.
const FEW: usize = 4096;

/// Where each agent went; empty where all stayed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Order {
    position: Vec<u32>,
    agent: Vec<u32>,
}

impl Order {
    /// The place of agent `i`, both from 0.
    #[inline]
    pub fn at(&self, i: usize) -> usize {
        self.position.get(i).map_or(i, |&p| p as usize)
    }

    /// Whether every agent is at the place of its number.
    #[inline]
    pub fn is_as_given(&self) -> bool {
        self.agent.is_empty()
    }

    /// The agent at place `p`, both from 0.
    #[inline]
    pub fn agent(&self, p: usize) -> usize {
        self.agent.get(p).map_or(p, |&i| i as usize)
    }

    /// A good order for a validated configuration: of many agents, with written graphs that are not in local
    /// order already.
    pub fn local(config: &Config) -> Self {
        let n = config.agents();
        let Communication::Explicit(Explicit { topologies }) = &config.communication else {
            return Self::default();
        };
        if n < FEW {
            return Self::default();
        }
        let neighbours = Neighbours::new(n, topologies);
        let agent = cuthill_mckee(&neighbours);
        let mut position = vec![0; n];
        for (p, &i) in agent.iter().enumerate() {
            position[i as usize] = p as u32;
        }
        let order = Self { position, agent };
        let width = |at: &dyn Fn(usize) -> usize| {
            (0..n).flat_map(|i| neighbours.of(i).iter().map(move |&j| at(i).abs_diff(at(j as usize)))).max()
        };
        // A graph that is local as it is keeps its numbers.
        if width(&|i| i) <= width(&|i| order.at(i)).map(|found| 2 * found) {
            return Self::default();
        }
        order
    }

    /// The configuration with agent `i` at place [`Self::at`] of it.
    pub fn renumbered(&self, mut config: Config) -> Config {
        if self.agent.is_empty() {
            return config;
        }
        config.by_agent().for_each(|values| *values = self.moved(values));
        let number = |agent: u32| self.at((agent as usize).wrapping_sub(1)) as u32 + 1;
        config.message_faults.iter_mut().for_each(|fault| fault.agent = number(fault.agent));
        if let Communication::Explicit(Explicit { topologies }) = &mut config.communication {
            for topology in topologies {
                for edge in &mut topology.edges {
                    (edge.a, edge.b) = (number(edge.a), number(edge.b));
                }
                topology.pins.iter_mut().for_each(|pin| pin.agent = number(pin.agent));
                topology.leaders.iter_mut().flatten().for_each(|leader| *leader = number(*leader));
                if let Some(clusters) = &mut topology.clusters {
                    *clusters = self.moved(clusters);
                }
            }
        }
        config
    }

    fn moved<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.agent.iter().filter_map(|&i| values.get(i as usize).copied()).collect()
    }
}

/// Neighbours in any of the topologies, row by row.
struct Neighbours {
    offsets: Vec<u32>,
    adjacent: Vec<u32>,
}

impl Neighbours {
    fn new(n: usize, topologies: &[ExplicitTopology]) -> Self {
        let edges = || topologies.iter().flat_map(|t| &t.edges).map(|e| (e.a as usize - 1, e.b as usize - 1));
        let mut offsets = vec![0; n + 1];
        for (a, b) in edges() {
            offsets[a + 1] += 1;
            offsets[b + 1] += 1;
        }
        for i in 0..n {
            offsets[i + 1] += offsets[i];
        }
        let mut next = offsets.clone();
        let mut adjacent = vec![0; offsets[n] as usize];
        for (a, b) in edges() {
            for (from, to) in [(a, b), (b, a)] {
                adjacent[next[from] as usize] = to as u32;
                next[from] += 1;
            }
        }
        Self { offsets, adjacent }
    }

    fn of(&self, i: usize) -> &[u32] {
        &self.adjacent[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }
}

/// The agents in reverse Cuthill-McKee order, each part from an agent at its edge.
fn cuthill_mckee(neighbours: &Neighbours) -> Vec<u32> {
    let n = neighbours.offsets.len() - 1;
    let (mut order, mut seen) = (Vec::with_capacity(n), vec![false; n]);
    let mut row = Vec::new();
    for first in 0..n {
        if seen[first] {
            continue;
        }
        // The last one that a walk from anywhere meets is far out.
        let begin = order.len();
        walk(neighbours, first, &mut seen, &mut order, &mut row);
        let far = order.last().map_or(first, |&i: &u32| i as usize);
        for &i in &order[begin..] {
            seen[i as usize] = false;
        }
        order.truncate(begin);
        walk(neighbours, far, &mut seen, &mut order, &mut row);
    }
    order.reverse();
    order
}

/// Breadth first, the least connected first.
fn walk(neighbours: &Neighbours, from: usize, seen: &mut [bool], order: &mut Vec<u32>, row: &mut Vec<u32>) {
    let mut next = order.len();
    seen[from] = true;
    order.push(from as u32);
    while let Some(&i) = order.get(next) {
        next += 1;
        row.clear();
        row.extend(neighbours.of(i as usize).iter().copied().filter(|&j| !seen[j as usize]));
        row.sort_unstable_by_key(|&j| (neighbours.of(j as usize).len(), j));
        row.dedup();
        row.iter().for_each(|&j| seen[j as usize] = true);
        order.append(row);
    }
}

#[cfg(test)]
mod tests {
    use super::super::communication::{ExplicitEdge, ExplicitPin};
    use super::*;

    fn ring(n: u32, number: impl Fn(u32) -> u32) -> Config {
        let edge = |i: u32| ExplicitEdge {
            a: number(i) + 1,
            b: number((i + 1) % n) + 1,
            weight: f64::from(i + 1),
            delay_s: None,
        };
        let topology = ExplicitTopology {
            name: "ring".into(),
            edges: (0..n).map(edge).collect(),
            pins: vec![ExplicitPin { agent: number(0) + 1, weight: 1.0 }],
            clusters: None,
            leaders: None,
        };
        Config::unit(n as usize, Communication::Explicit(Explicit { topologies: vec![topology] }))
    }

    #[test]
    fn a_scattered_ring_becomes_narrow_and_everything_moves_along() {
        let n = 5001;
        // 1234 and 5001 have no common factor.
        let mut config = ring(n, |i| i * 1234 % n);
        config.K_P = (0..n).map(|i| f64::from(i + 1)).collect();
        let order = Order::local(&config);
        let moved = order.renumbered(config.clone());
        let edges = |config: &Config| match &config.communication {
            Communication::Explicit(e) => e.topologies[0].edges.clone(),
            Communication::StepByStep(_) => Vec::new(),
        };
        assert!(edges(&moved).iter().all(|e| e.a.abs_diff(e.b) <= 2));
        for (before, after) in edges(&config).iter().zip(edges(&moved)) {
            assert_eq!(moved.K_P[after.a as usize - 1], f64::from(before.a));
            assert_eq!(order.agent(after.b as usize - 1), before.b as usize - 1);
        }
    }

    #[test]
    fn few_agents_and_local_ones_stay_where_they_are() {
        assert_eq!(Order::local(&ring(100, |i| i * 7 % 100)), Order::default());
        let folded = |i: u32| if i < 2500 { 2 * i } else { 2 * (4999 - i) + 1 };
        assert_eq!(Order::local(&ring(5000, folded)), Order::default());
    }
}

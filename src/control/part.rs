//! A part of a fleet: one cluster, or one agent, whose controller runs apart from the others. Says which agents are
//! its own, which neighbours it has outside, and what was agreed about those when the links were set up. Plain data
//! and its checks; `partition` makes it, `across` runs it.

use super::communication::{Communication, StepByStep};
use super::config::Config;
use super::error::Problems;
use serde::{Deserialize, Serialize};

/// What makes a configuration that of a part. Its arrays by agent then hold the part's own agents and their
/// neighbours outside, by ascending number in the fleet; of a neighbour only `capacity`, `P_exchange_max` and the
/// limits of its power count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Its number, from 1.
    pub number: u32,
    /// Number of parts of the fleet.
    pub parts: u32,
    /// Number of agents of the fleet.
    pub fleet: u32,
    /// Number in the fleet, from 1, of each agent here.
    pub agents: Vec<u32>,
    /// The neighbours outside in the order of `remote_p[1]`, `remote_p[2]`, ...: by ascending number, of all topologies.
    pub outside: Vec<Outside>,
    /// Least time between a sample and its arrival in another part, s, > 0: the communication step.
    pub step_s: f64,
    /// What is agreed for each topology.
    pub topologies: Vec<Agreed>,
    /// Where each part is a cluster of a graph made step by step: what it is made of. All agents of the other clusters
    /// are then neighbours outside, because any of them may lead one day.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub election: Option<StepByStep>,
}

/// A neighbour outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outside {
    /// Its number in the fleet, from 1.
    pub agent: u32,
    /// The part that it belongs to, from 1.
    pub part: u32,
}

/// What was agreed for one topology while everybody was available.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Agreed {
    /// Number of links of each agent here.
    pub links: Vec<u32>,
    /// Links on its shortest way to a pinned agent.
    pub hops: Vec<i32>,
    /// The longest delay that a link anywhere has of its own, s.
    pub longest_delay_s: f64,
    /// Whether a link anywhere has the common delay.
    pub has_common_delay: bool,
}

impl Part {
    /// The numbers in the fleet of its own agents, from 1, ascending: those behind `P[1]`, `P[2]`, ...
    pub fn own(&self) -> impl Iterator<Item = u32> {
        self.agents.iter().copied().filter(|agent| !self.is_outside(*agent))
    }

    /// Whether a number is that of a neighbour outside.
    pub fn is_outside(&self, agent: u32) -> bool {
        self.outside.binary_search_by_key(&agent, |outside| outside.agent).is_ok()
    }

    /// Its own agents with neighbours outside, numbers in the fleet from 1, in the order of `local_p[1]`,
    /// `local_p[2]`, ...; all of them where leaders are elected. `communication` is that of its configuration.
    pub fn tellers(&self, communication: &Communication) -> Vec<u32> {
        let number = |place: u32| self.agents.get((place as usize).wrapping_sub(1)).copied().unwrap_or(0);
        if self.election.is_some() {
            return self.own().collect();
        }
        let Communication::Explicit(explicit) = communication else { return Vec::new() };
        let edges = explicit.topologies.iter().flat_map(|topology| &topology.edges);
        let mut tellers: Vec<u32> = edges
            .map(|edge| (number(edge.a), number(edge.b)))
            .flat_map(|(a, b)| [(a, b), (b, a)])
            .filter(|&(own, other)| !self.is_outside(own) && self.is_outside(other))
            .map(|(own, _)| own)
            .collect();
        tellers.sort_unstable();
        tellers.dedup();
        tellers
    }
}

/// Looks the part of a configuration for `n` agents through.
pub(super) fn check(problems: &mut Problems, config: &Config, part: &Part, n: usize) {
    let Communication::Explicit(explicit) = &config.communication else {
        problems.add("part", "communication.step_by_step", "graphs written out (communication.explicit)");
        return;
    };
    let ascending = |numbers: &[u32]| numbers.windows(2).all(|pair| pair[0] < pair[1]);
    let known = |agent: u32| agent >= 1 && agent <= part.fleet;
    if part.agents.len() != n || !ascending(&part.agents) || !part.agents.iter().all(|&a| known(a)) {
        let expected = format!("{n} ascending numbers from 1 to {}", part.fleet);
        problems.add("part.agents", format!("{:?}", part.agents), expected);
    }
    if !(part.number >= 1 && part.number <= part.parts) {
        problems.add("part.number", part.number, format!("1 to {}", part.parts));
    }
    let outside: Vec<u32> = part.outside.iter().map(|outside| outside.agent).collect();
    let is_here = |agent: &u32| part.agents.binary_search(agent).is_ok();
    if !ascending(&outside) || !outside.iter().all(is_here) || outside.len() >= part.agents.len().max(1) {
        problems.add("part.outside", format!("{outside:?}"), "some of part.agents, ascending, and not all");
    }
    for (k, outside) in part.outside.iter().enumerate() {
        if outside.part == part.number || outside.part < 1 || outside.part > part.parts {
            let expected = format!("another part, 1 to {}", part.parts);
            problems.add(format!("part.outside[{k}].part"), outside.part, expected);
        }
    }
    if !(part.step_s > 0.0 && part.step_s.is_finite()) {
        problems.add("part.step_s", part.step_s, "a finite number > 0");
    }
    let count = explicit.topologies.len();
    if let Some(election) = &part.election {
        let is_whole = part.agents.len() == part.fleet as usize;
        let has_clusters = explicit.topologies.iter().all(|topology| topology.clusters.is_some());
        if !is_whole || !has_clusters || election.distances.len() != n || election.topologies.len() != count {
            let expected = format!(
                "distances of all {} agents, who are in clusters, and {count} topologies",
                part.fleet
            );
            problems.add("part.election", "something else", expected);
        }
        super::validate::step_by_step(problems, election, n);
    }
    if part.topologies.len() != count {
        problems.add("part.topologies", part.topologies.len(), format!("{count}, one per graph"));
    }
    for (k, agreed) in part.topologies.iter().enumerate() {
        let fits = agreed.links.len() == n
            && agreed.hops.len() == n
            && agreed.links.iter().all(|&links| links < part.fleet)
            && agreed.hops.iter().all(|&hops| (0..=part.fleet as i32).contains(&hops))
            && agreed.longest_delay_s >= 0.0
            && agreed.longest_delay_s.is_finite();
        if !fits {
            let expected = format!("links and hops of {n} agents below {}, and a delay", part.fleet);
            problems.add(format!("part.topologies[{k}]"), "something else", expected);
        }
    }
    for (k, topology) in explicit.topologies.iter().enumerate() {
        for (e, edge) in topology.edges.iter().enumerate() {
            let foreign = |place: u32| {
                part.agents.get((place as usize).wrapping_sub(1)).is_none_or(|&agent| part.is_outside(agent))
            };
            if foreign(edge.a) && foreign(edge.b) {
                let path = format!("communication.explicit.topologies[{k}].edges[{e}]");
                problems.add(path, format!("{} to {}", edge.a, edge.b), "an agent of the part at one end");
            }
        }
    }
}

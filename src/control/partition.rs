//! Takes a controller's configuration apart: one configuration for each cluster, or for each agent, that holds what
//! its own agents are and do, and of everybody else only what was agreed about the links to them. Runs before
//! anything is exported; never during a run.

use super::communication::{
    Communication, Explicit, ExplicitEdge, ExplicitPin, ExplicitTopology, StepByStep,
};
use super::config::{Config, Limits};
use super::part::{Agreed, Outside, Part};
use super::told::MessageFault;
use super::topology::Topologies;
use std::collections::{BTreeSet, VecDeque};

/// Which agents belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// The clusters of the first topology.
    Clusters,
    /// Every agent for itself.
    Agents,
}

/// Why a configuration cannot be taken apart.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PartitionError {
    /// Not one part number per agent, each from 1 without gaps.
    #[error("parts: found {found}, expected {expected}")]
    Numbers {
        /// What is there.
        found: String,
        /// What belongs there.
        expected: String,
    },
    /// A step that messages cannot take.
    #[error("step of the messages between parts: found {found} s, expected a finite number > 0")]
    Step {
        /// What is there.
        found: f64,
    },
    /// A part cannot be taken apart once more.
    #[error(
        "the configuration is that of part {number} of {parts} already; expected that of the whole fleet"
    )]
    IsPart {
        /// Its number.
        number: u32,
        /// Of how many.
        parts: u32,
    },
}

/// The number of the part, from 1, of each agent of a validated configuration.
pub fn numbers(config: &Config, cut: Cut) -> Vec<u32> {
    let n = config.agents();
    match cut {
        Cut::Agents => (1..=n as u32).collect(),
        Cut::Clusters => {
            let topologies = Topologies::new(n, &config.communication);
            let cluster = topologies.build(0, &vec![true; n]).cluster;
            let known: BTreeSet<i32> = cluster.iter().copied().collect();
            let known: Vec<i32> = known.into_iter().collect();
            let number = |c: &i32| known.binary_search(c).map_or(1, |k| k as u32 + 1);
            cluster.iter().map(number).collect()
        }
    }
}

/// The configurations of the parts, the first first, of a validated configuration; `part_of` holds the number of the
/// part of each agent, from 1, and messages between parts take a communication step of `step_s`.
///
/// A graph made step by step becomes the one with everybody available: who leads a cluster cannot be found out
/// anew by those who know their neighbours only. Where each part is a cluster, its agents know each other, and hear all of
/// the other clusters: there leaders are elected anew.
pub fn split(config: &Config, part_of: &[u32], step_s: f64) -> Result<Vec<Config>, PartitionError> {
    let n = config.agents();
    if let Some(part) = &config.part {
        return Err(PartitionError::IsPart { number: part.number, parts: part.parts });
    }
    if !(step_s > 0.0 && step_s.is_finite()) {
        return Err(PartitionError::Step { found: step_s });
    }
    let known: BTreeSet<u32> = part_of.iter().copied().collect();
    if part_of.len() != n || !known.iter().copied().eq(1..=known.len() as u32) {
        let (found, expected) = (format!("{part_of:?}"), format!("{n} numbers from 1 without gaps"));
        return Err(PartitionError::Numbers { found, expected });
    }
    let graphs = written(config);
    let fleet: Vec<Whole> = graphs.iter().map(|topology| Whole::new(n, topology)).collect();
    let parts = known.len() as u32;
    let election = match &config.communication {
        Communication::StepByStep(made) if parts > 1 && numbers(config, Cut::Clusters) == part_of => {
            Some(made)
        }
        _ => None,
    };
    // What each part has its own of is not copied for each.
    let shared = Config {
        communication: Communication::Explicit(Explicit { topologies: Vec::new() }),
        message_faults: Vec::new(),
        ..config.clone()
    };
    let of =
        |&number: &u32| one((config, &shared), (&graphs, &fleet, election), part_of, (number, parts), step_s);
    Ok(known.iter().map(of).collect())
}

/// The graphs of a validated configuration, written out, with everybody available.
pub fn written(config: &Config) -> Vec<ExplicitTopology> {
    if let Communication::Explicit(explicit) = &config.communication {
        return explicit.topologies.clone();
    }
    let n = config.agents();
    let topologies = Topologies::new(n, &config.communication);
    let number = |i: usize| i as u32 + 1;
    let all = (0..topologies.count()).map(|k| {
        let built = topologies.build(k, &vec![true; n]);
        let edges = built.graph.edges().iter().map(|edge| ExplicitEdge {
            a: edge.a + 1,
            b: edge.b + 1,
            weight: edge.weight,
            delay_s: None,
        });
        let pins = built.graph.pins().iter().enumerate().filter(|(_, weight)| **weight > 0.0);
        ExplicitTopology {
            name: config.communication.topology_name(k).unwrap_or_default().to_owned(),
            edges: edges.collect(),
            pins: pins.map(|(i, &weight)| ExplicitPin { agent: number(i), weight }).collect(),
            clusters: Some(built.cluster.iter().map(|&c| c as u32).collect()),
            leaders: Some(built.leaders.iter().map(|&i| number(i)).collect()),
        }
    });
    all.collect()
}

/// What is agreed about one graph, of all agents.
struct Whole {
    neighbours: Vec<Vec<usize>>,
    hops: Vec<i32>,
    longest_delay_s: f64,
    has_common_delay: bool,
}

impl Whole {
    fn new(n: usize, topology: &ExplicitTopology) -> Self {
        let mut neighbours = vec![Vec::new(); n];
        for edge in &topology.edges {
            let (a, b) = (edge.a as usize - 1, edge.b as usize - 1);
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        let mut hops = vec![n as i32; n];
        let mut queue: VecDeque<usize> = topology.pins.iter().map(|pin| pin.agent as usize - 1).collect();
        queue.iter().for_each(|&i| hops[i] = 0);
        while let Some(i) = queue.pop_front() {
            for &j in &neighbours[i] {
                if hops[j] > hops[i] + 1 {
                    hops[j] = hops[i] + 1;
                    queue.push_back(j);
                }
            }
        }
        let delays = topology.edges.iter().filter_map(|edge| edge.delay_s);
        Self {
            neighbours,
            hops,
            longest_delay_s: delays.fold(0.0, f64::max),
            has_common_delay: topology.edges.iter().any(|edge| edge.delay_s.is_none()),
        }
    }
}

/// The configuration of part `number`; `shared` is what all have alike.
fn one(
    (config, shared): (&Config, &Config),
    (graphs, fleet, election): (&[ExplicitTopology], &[Whole], Option<&StepByStep>),
    part_of: &[u32],
    (number, parts): (u32, u32),
    step_s: f64,
) -> Config {
    let n = part_of.len();
    let own = |i: usize| part_of[i] == number;
    let is_neighbour = |i: usize| fleet.iter().any(|whole| whole.neighbours[i].iter().any(|&j| own(j)));
    let here: Vec<usize> = (0..n).filter(|&i| own(i) || election.is_some() || is_neighbour(i)).collect();
    let first = here.iter().copied().find(|&i| own(i)).unwrap_or(0);
    // Of a neighbour the value of an agent of one's own stands in: a number that is allowed, and never used.
    let known = |values: &[f64]| here.iter().map(|&i| values[if own(i) { i } else { first }]).collect();
    let agreed = |values: &[f64]| here.iter().map(|&i| values[i]).collect::<Vec<f64>>();
    let place = |agent: u32| here.binary_search(&(agent as usize - 1)).ok().map(|k| k as u32 + 1);
    let crosses = |edge: &ExplicitEdge| own(edge.a as usize - 1) != own(edge.b as usize - 1);
    let delay_elsewhere = |graph: &ExplicitTopology, whole: &Whole| {
        let is_cut = graph.edges.iter().any(|e| part_of[e.a as usize - 1] != part_of[e.b as usize - 1]);
        whole.longest_delay_s.max(if is_cut { step_s } else { 0.0 })
    };
    let topologies = graphs.iter().map(|graph| ExplicitTopology {
        name: graph.name.clone(),
        edges: graph
            .edges
            .iter()
            .filter(|edge| own(edge.a as usize - 1) || crosses(edge))
            .filter_map(|edge| Some(ExplicitEdge { a: place(edge.a)?, b: place(edge.b)?, ..*edge }))
            .collect(),
        pins: graph
            .pins
            .iter()
            .filter_map(|pin| Some(ExplicitPin { agent: place(pin.agent)?, ..*pin }))
            .collect(),
        clusters: graph.clusters.as_ref().map(|all| here.iter().map(|&i| all[i]).collect()),
        leaders: graph.leaders.as_ref().map(|all| all.iter().filter_map(|&i| place(i)).collect()),
    });
    let part = Part {
        number,
        parts,
        fleet: n as u32,
        agents: here.iter().map(|&i| i as u32 + 1).collect(),
        outside: here
            .iter()
            .filter(|&&i| !own(i))
            .map(|&i| Outside { agent: i as u32 + 1, part: part_of[i] })
            .collect(),
        step_s,
        topologies: graphs
            .iter()
            .zip(fleet)
            .map(|(graph, whole)| Agreed {
                links: here.iter().map(|&i| whole.neighbours[i].len() as u32).collect(),
                hops: here.iter().map(|&i| whole.hops[i]).collect(),
                longest_delay_s: delay_elsewhere(graph, whole),
                has_common_delay: whole.has_common_delay,
            })
            .collect(),
        election: election.cloned(),
    };
    let faults = config.message_faults.iter().filter_map(|fault| {
        let is_told = own(fault.agent as usize - 1);
        // That a neighbour sends nothing is seen; what it sends else comes with its messages.
        let counts = is_told || fault.is_mute();
        Some(MessageFault { agent: place(fault.agent).filter(|_| counts)?, ..*fault })
    });
    let limits = &config.limits;
    Config {
        K_P: known(&config.K_P),
        K_Q: known(&config.K_Q),
        capacity: agreed(&config.capacity),
        P_exchange_max: agreed(&config.P_exchange_max),
        omega_set_start: known(&config.omega_set_start),
        V_set_start: known(&config.V_set_start),
        communication: Communication::Explicit(Explicit { topologies: topologies.collect() }),
        limits: Limits {
            P_max: limits.P_max.as_deref().map(agreed),
            Q_max: limits.Q_max.as_deref().map(known),
            S_max: limits.S_max.as_deref().map(agreed),
            omega_set_rate: limits.omega_set_rate.as_deref().map(known),
            V_set_rate: limits.V_set_rate.as_deref().map(known),
            P_set_rate: limits.P_set_rate.as_deref().map(agreed),
            ..limits.clone()
        },
        message_faults: faults.collect(),
        part: Some(part),
        ..shared.clone()
    }
}

//! The step-by-step graph: clusters, active leaders, edges inside and among the clusters, pins to the
//! virtual leader; rebuilt from the available agents when one leaves or comes back. Runs between steps.

use super::clustering::{Clustering, Link, cluster, minimum_spanning_tree};
use super::communication::{Communication, Explicit, ExplicitTopology, Inside, StepByStep, Weights};
use super::graph::{Components, Edge, Graph};

/// All topologies of a configuration, ready to be built for any set of available agents.
#[derive(Clone, Debug)]
pub struct Topologies(Source);

#[derive(Clone, Debug)]
enum Source {
    StepByStep { config: StepByStep, clustering: Clustering },
    Explicit(Vec<Written>),
}

#[derive(Clone, Debug)]
struct Written {
    graph: Graph,
    cluster: Vec<i32>,
    leaders: Vec<usize>,
}

/// A graph in force: what is left of a topology for the available agents.
#[derive(Clone, Debug, PartialEq)]
pub struct Topology {
    /// Edges and pins among the live agents.
    pub graph: Graph,
    /// Cluster of each agent, from 1.
    pub cluster: Vec<i32>,
    /// Active leaders, from 0, ascending.
    pub leaders: Vec<usize>,
    /// Available and in a part with a pin; the others hold their setpoints.
    pub live: Vec<bool>,
    /// Connected parts of the available agents.
    pub parts: Components,
}

impl Topologies {
    /// Prepares the topologies of a validated configuration of `n` agents.
    pub fn new(n: usize, communication: &Communication) -> Self {
        Self(match communication {
            Communication::StepByStep(config) => {
                Source::StepByStep { config: config.clone(), clustering: cluster(&config.distances) }
            }
            Communication::Explicit(Explicit { topologies }) => {
                Source::Explicit(topologies.iter().map(|t| written(n, t)).collect())
            }
        })
    }

    /// Number of topologies.
    pub fn count(&self) -> usize {
        match &self.0 {
            Source::StepByStep { config, .. } => config.topologies.len(),
            Source::Explicit(list) => list.len(),
        }
    }

    /// Whether the graphs are written out, so that an agent has the same neighbours whoever else is there.
    pub fn are_written(&self) -> bool {
        matches!(self.0, Source::Explicit(_))
    }

    /// The neighbours of agent `i` in any graph written out, perhaps more than once.
    pub fn neighbours(&self, i: usize) -> impl Iterator<Item = usize> {
        let graphs = match &self.0 {
            Source::Explicit(list) => list.as_slice(),
            Source::StepByStep { .. } => &[],
        };
        graphs.iter().flat_map(move |written| written.graph.neighbours(i)).map(|&j| j as usize)
    }

    /// Graph, clusters and leaders of topology `k`, where it is written out.
    pub(super) fn written(&self, k: usize) -> Option<(&Graph, &[i32], &[usize])> {
        match &self.0 {
            Source::Explicit(list) => list
                .get(k)
                .map(|written| (&written.graph, written.cluster.as_slice(), written.leaders.as_slice())),
            Source::StepByStep { .. } => None,
        }
    }

    /// How CAK found the clusters, when distances were given.
    pub fn clustering(&self) -> Option<&Clustering> {
        match &self.0 {
            Source::StepByStep { clustering, .. } => Some(clustering),
            Source::Explicit(_) => None,
        }
    }

    /// Topology `k`, from 0 and below `count`, for the available agents.
    pub fn build(&self, k: usize, available: &[bool]) -> Topology {
        let (graph, cluster, leaders) = match &self.0 {
            Source::StepByStep { config, clustering } => {
                step_by_step(config, &clustering.cluster, k, available)
            }
            Source::Explicit(list) => {
                let written = &list[k];
                let leaders = written.leaders.iter().copied().filter(|&i| available[i]).collect();
                (written.graph.restricted(available), written.cluster.clone(), leaders)
            }
        };
        let parts = graph.components(available);
        let live: Vec<bool> =
            parts.of.iter().map(|&p| p != Components::NONE && parts.pinned[p as usize]).collect();
        Topology { graph: graph.restricted(&live), cluster, leaders, live, parts }
    }
}

fn written(n: usize, topology: &ExplicitTopology) -> Written {
    let edges = topology.edges.iter().map(|e| Edge {
        delay_ns: e.delay_s.map(super::time::nanoseconds),
        ..Edge::new(e.a as usize - 1, e.b as usize - 1, e.weight)
    });
    let mut pins = vec![0.0; n];
    for pin in &topology.pins {
        pins[pin.agent as usize - 1] = pin.weight;
    }
    let mut leaders: Vec<usize> = match &topology.leaders {
        Some(list) => list.iter().map(|&i| i as usize - 1).collect(),
        None => topology.pins.iter().map(|p| p.agent as usize - 1).collect(),
    };
    leaders.sort_unstable();
    let cluster = match &topology.clusters {
        Some(list) => list.iter().map(|&c| c as i32).collect(),
        None => vec![1; n],
    };
    Written { graph: Graph::new(n, edges.collect(), pins), cluster, leaders }
}

/// Graph, clusters and leaders of topology `k` for the available agents; `cluster` holds that of each agent, from 0.
pub(super) fn step_by_step(
    config: &StepByStep,
    cluster: &[usize],
    k: usize,
    available: &[bool],
) -> (Graph, Vec<i32>, Vec<usize>) {
    let d = &config.distances;
    let n = d.len();
    let mut links = Vec::new();
    let mut leaders = Vec::new();
    for number in 0..cluster.iter().max().map_or(0, |&last| last + 1) {
        let members: Vec<usize> = (0..n).filter(|&i| cluster[i] == number && available[i]).collect();
        let tree = minimum_spanning_tree(&members, d);
        links.extend(match config.topologies[k].inside {
            Inside::Tree => tree,
            Inside::Ring => ring(&members, &tree, d),
        });
        let outside: Vec<usize> = (0..n).filter(|&i| cluster[i] != number && available[i]).collect();
        leaders.extend(active_leader(&members, &outside, d));
    }
    leaders.sort_unstable();
    links.extend(minimum_spanning_tree(&leaders, d));
    let (nearest, farthest) = extremes(d);
    let edges = links.iter().map(|link| {
        let weight = match config.weights {
            Weights::InverseDistance => nearest / link.length,
            Weights::Distance => link.length / farthest,
        };
        Edge::new(link.a, link.b, weight)
    });
    let mut pins = vec![0.0; n];
    for &leader in &leaders {
        pins[leader] = 1.0;
    }
    let graph = Graph::new(n, edges.collect(), pins);
    (graph, cluster.iter().map(|&c| c as i32 + 1).collect(), leaders)
}

/// The agent nearest to the other clusters, ties to the lowest; where there is no other cluster, the
/// agent nearest to all of its own.
fn active_leader(members: &[usize], outside: &[usize], d: &[Vec<f64>]) -> Option<usize> {
    let reach = |i: usize| {
        if outside.is_empty() {
            members.iter().map(|&j| d[i][j]).sum()
        } else {
            outside.iter().map(|&j| d[i][j]).fold(f64::INFINITY, f64::min)
        }
    };
    members.iter().copied().min_by(|&x, &y| reach(x).total_cmp(&reach(y)).then(x.cmp(&y)))
}

/// A ring through the members in the order of a walk along their spanning tree, which keeps it at most
/// twice as long as the shortest. A ring of two is one edge.
fn ring(members: &[usize], tree: &[Link], d: &[Vec<f64>]) -> Vec<Link> {
    let mut order = Vec::with_capacity(members.len());
    let mut stack: Vec<usize> = members.first().copied().into_iter().collect();
    while let Some(i) = stack.pop() {
        if order.contains(&i) {
            continue;
        }
        order.push(i);
        // The tree lists its shortest edge first; pushed in reverse, the nearest is walked to first.
        for link in tree.iter().rev() {
            if link.a == i || link.b == i {
                stack.push(link.a + link.b - i);
            }
        }
    }
    let count = if order.len() == 2 { 1 } else { order.len() };
    let closed = |k: usize| order[(k + 1) % order.len()];
    let links = (0..count).map(|k| Link { a: order[k], b: closed(k), length: d[order[k]][closed(k)] });
    links.filter(|link| link.a != link.b).collect()
}

/// The least and the largest distance between two agents.
fn extremes(d: &[Vec<f64>]) -> (f64, f64) {
    let mut extremes = (f64::INFINITY, 0.0);
    for (i, row) in d.iter().enumerate() {
        for &x in &row[..i] {
            extremes = (x.min(extremes.0), x.max(extremes.1));
        }
    }
    extremes
}

#[cfg(test)]
mod tests {
    use super::super::communication::StepByStepTopology;
    use super::*;

    /// Two groups on a line: 0, 1, 2.5 and 10, 11.
    fn topologies() -> Topologies {
        let x = [0.0, 1.0, 2.5, 10.0, 11.0];
        let distances = x.iter().map(|a| x.iter().map(|b| f64::abs(a - b)).collect()).collect();
        let topology = |name: &str, inside| StepByStepTopology { name: name.into(), inside };
        Topologies::new(
            5,
            &Communication::StepByStep(StepByStep {
                distances,
                weights: Weights::InverseDistance,
                topologies: vec![topology("a3", Inside::Tree), topology("b3", Inside::Ring)],
            }),
        )
    }

    fn pairs(topology: &Topology) -> Vec<(u32, u32)> {
        topology.graph.edges().iter().map(|e| (e.a, e.b)).collect()
    }

    #[test]
    fn tree_and_ring_of_two_groups() {
        let tree = topologies().build(0, &[true; 5]);
        assert_eq!(tree.cluster, [1, 1, 1, 2, 2]);
        assert_eq!(tree.leaders, [2, 3]);
        assert_eq!(pairs(&tree), [(0, 1), (1, 2), (2, 3), (3, 4)]);
        assert_eq!(tree.graph.pins(), [0.0, 0.0, 1.0, 1.0, 0.0]);
        let weights: Vec<f64> = tree.graph.edges().iter().map(|e| e.weight).collect();
        assert_eq!(weights, [1.0, 1.0 / 1.5, 1.0 / 7.5, 1.0]);
        let ring = topologies().build(1, &[true; 5]);
        assert_eq!(pairs(&ring), [(0, 1), (0, 2), (1, 2), (2, 3), (3, 4)]);
    }

    #[test]
    fn the_next_leader_takes_over_and_the_graph_stays_whole() {
        let built = topologies().build(0, &[true, true, false, true, true]);
        assert_eq!(built.leaders, [1, 3]);
        assert_eq!(pairs(&built), [(0, 1), (1, 3), (3, 4)]);
        assert_eq!(built.parts.count(), 1);
        let one_cluster = topologies().build(1, &[true, true, true, false, false]);
        assert_eq!(one_cluster.leaders, [1], "the middle one is nearest to all");
        assert_eq!(one_cluster.live, [true, true, true, false, false]);
    }
}

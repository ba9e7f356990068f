//! The working memory of `sweep`: who has to be measured before which edges, the present values of the agents in
//! reach one cache line each, and what flows to them. A window slides over the agents, so that in local order
//! all of it stays in the cache however many agents there are. Knows no law.

use super::network::Network;

/// Agents that are finished together.
pub const CHUNK: usize = 256;
/// Edges whose differences are raised to a power together.
const BATCH: usize = 64;
/// Values that flows are made of, per edge.
pub const FLOWS: usize = 5;
/// Room for whole lines at all edges of a batch.
const ROOM: usize = FLOWS * BATCH + 8;
/// Numbers of the edges of a batch.
pub type Batch = [f64; ROOM];

/// One agent: omega, p, V, q, SoC, C, P_exchange_max / peers, 1 + peers; or what flows to it, by the first five.
pub type Line = [f64; 8];

/// An edge, as far as a step without delay needs it.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// The ends, from 0, the lower first.
    pub ends: [u32; 2],
    /// w_ij.
    pub weight: f64,
    /// 1 / (1 + max(deg_i, deg_j)).
    pub share: f64,
}

/// A chunk of agents: how many agents have to be measured before its edges, and where its edges end.
#[derive(Clone, Copy, Debug)]
struct Stop {
    measured: u32,
    edges: u32,
}

/// Window and order of a graph.
#[derive(Clone, Debug, Default)]
pub struct Wave {
    links: Vec<Link>,
    stops: Vec<Stop>,
    /// Lengths are one power of two, the window.
    lines: Vec<Line>,
    sums: Vec<Line>,
}

/// What is done on the way, in this order for each part of the graph.
pub trait Stages {
    /// Fills the lines of agents `from..to`; agent i has line i modulo their number.
    fn measure(&mut self, from: usize, to: usize, lines: &mut [Line]);
    /// Makes s of the magnitudes of differences.
    fn raise(&self, differences: &[f64], powers: &mut [f64]);
    /// Takes the flows of `batch`, the first of which is edge `first`, from the sums of the lower ends and adds them
    /// to those of the higher ends. `differences` and `powers` hold [`FLOWS`] numbers per edge.
    fn flow(&mut self, first: usize, batch: &[Link], lines: &[Line], of: (&Batch, &Batch), sums: &mut [Line]);
    /// Takes what flows to agents `from..to`, which nothing flows to any more.
    fn finish(&mut self, from: usize, to: usize, lines: &[Line], sums: &mut [Line]);
}

impl Wave {
    /// For the edges of this network, which are sorted by their lower, then by their higher ends.
    pub fn new(network: &Network) -> Self {
        let links: Vec<Link> = network
            .graph
            .edges()
            .iter()
            .zip(&network.shares)
            .map(|(e, &share)| Link { ends: [e.a, e.b], weight: e.weight, share })
            .collect();
        let n = network.graph.agents();
        let (mut stops, mut edges, mut measured, mut window) = (Vec::new(), 0, 0, 1);
        for from in (0..n).step_by(CHUNK) {
            let to = (from + CHUNK).min(n);
            measured = measured.max(to);
            while let Some(link) = links.get(edges).filter(|link| (link.ends[0] as usize) < to) {
                measured = measured.max(link.ends[1] as usize + 1);
                edges += 1;
            }
            window = window.max(measured - from);
            stops.push(Stop { measured: measured as u32, edges: edges as u32 });
        }
        let window = window.next_power_of_two();
        Self { links, stops, lines: vec![[0.0; 8]; window], sums: vec![[0.0; 8]; window] }
    }

    /// Runs the stages over all agents and edges.
    #[inline(always)]
    pub fn run(&mut self, n: usize, stages: &mut impl Stages) {
        let Self { links, stops, lines, sums } = self;
        let mask = lines.len() - 1;
        let (mut measured, mut edge) = (0, 0);
        let (mut differences, mut powers): (Batch, Batch) = ([0.0; ROOM], [0.0; ROOM]);
        for (chunk, stop) in stops.iter().enumerate() {
            let until = stop.measured as usize;
            if measured < until {
                stages.measure(measured, until, lines);
                for i in measured..until {
                    sums[i & mask] = [0.0; 8];
                }
                measured = until;
            }
            let last = stop.edges as usize;
            while edge < last {
                let batch = &links[edge..last.min(edge + BATCH)];
                for (k, link) in batch.iter().enumerate() {
                    let [a, b] = link.ends.map(|end| end as usize & mask);
                    let mut difference = lines[a];
                    for (x, y) in difference.iter_mut().zip(&lines[b]) {
                        *x -= y;
                    }
                    // The next edge overwrites what is too much.
                    differences[FLOWS * k..FLOWS * k + 8].copy_from_slice(&difference);
                }
                let values = FLOWS * batch.len();
                stages.raise(&differences[..values], &mut powers[..values]);
                stages.flow(edge, batch, lines, (&differences, &powers), sums);
                edge += batch.len();
            }
            let from = chunk * CHUNK;
            stages.finish(from, (from + CHUNK).min(n), lines, sums);
        }
    }
}

//! The edges of a graph in the order in which a sweep takes them: agents in blocks, and the edges of a block either
//! along diagonals, where neighbours of agents that follow each other follow each other too, or one by one.
//! Knows no values and no law.

use super::diagnosis::CHUNK;
use super::diagonals::place;
use super::network::Network;
use std::ops::Range;

/// The most diagonals of a block, so that what flows along them stays in the cache.
const DIAGONALS: usize = 32;
/// Diagonals may have this many times as many places as there are edges; a place without an edge has weight 0.
const PLACES_PER_EDGE: usize = 2;

/// [`CHUNK`] agents that follow each other, with their edges to higher ones.
#[derive(Clone, Debug)]
pub struct Block {
    /// The first agent, from 0.
    pub first: usize,
    /// Number of agents.
    pub rows: usize,
    /// Their edges.
    pub edges: Range<usize>,
    /// Where their weights stand among the weights of the layout.
    pub weights: usize,
    /// How they stand there.
    pub shape: Shape,
}

/// How the edges of a block are taken.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Place k rows + r is the edge from agent `first + r` to the one that is the k-th offset higher.
    Diagonals {
        /// Where the offsets stand, which ascend.
        offsets: Range<usize>,
        /// Where the place of each edge stands; `None` where every place is an edge.
        places: Option<usize>,
    },
    /// In the order of the edges.
    Scattered {
        /// Where their ends stand.
        ends: usize,
    },
}

/// All blocks of a graph.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// In ascending order.
    pub blocks: Vec<Block>,
    /// w_ij by place.
    pub weights: Vec<f64>,
    /// j - i of diagonals.
    pub offsets: Vec<u32>,
    /// Places of edges on diagonals that have gaps.
    pub places: Vec<u32>,
    /// Ends of scattered edges, from 0, the lower first.
    pub ends: Vec<[u32; 2]>,
    /// The largest number of diagonals of a block.
    pub most_diagonals: usize,
}

impl Layout {
    /// For the edges of this network, which are sorted by their lower, then by their higher ends.
    pub fn new(network: &Network) -> Self {
        let (mut layout, mut from) = (Self::default(), 0);
        let (n, edges) = (network.graph.agents(), network.graph.edges());
        for first in (0..n).step_by(CHUNK) {
            let rows = CHUNK.min(n - first);
            let count = edges[from..].iter().take_while(|e| (e.a as usize) < first + rows).count();
            layout.add(network, (first, rows), from..from + count);
            from += count;
        }
        layout
    }

    fn add(&mut self, network: &Network, (first, rows): (usize, usize), edges: Range<usize>) {
        let own = &network.graph.edges()[edges.clone()];
        let mut offsets: Vec<u32> = own.iter().map(|e| e.b - e.a).collect();
        offsets.sort_unstable();
        offsets.dedup();
        let (weights, count) = (self.weights.len(), offsets.len() * rows);
        let shape = if offsets.len() <= DIAGONALS && count <= PLACES_PER_EDGE * own.len() {
            self.weights.resize(weights + count, 0.0);
            let places = (count > own.len()).then_some(self.places.len());
            for edge in own {
                let k = offsets.partition_point(|&d| d < edge.b - edge.a);
                let row = edge.a as usize - first;
                self.weights[weights + k * rows + row] = edge.weight;
                if places.is_some() {
                    self.places.push(place(k, row) as u32);
                }
            }
            self.most_diagonals = self.most_diagonals.max(offsets.len());
            let begin = self.offsets.len();
            self.offsets.append(&mut offsets);
            Shape::Diagonals { offsets: begin..self.offsets.len(), places }
        } else {
            self.weights.extend(own.iter().map(|e| e.weight));
            let ends = self.ends.len();
            self.ends.extend(own.iter().map(|e| [e.a, e.b]));
            Shape::Scattered { ends }
        };
        self.blocks.push(Block { first, rows, edges, weights, shape });
    }

    /// One more than the highest agent, there or not, that a block looks at.
    pub fn top(&self, block: &Block) -> usize {
        let farthest = match &block.shape {
            Shape::Diagonals { offsets, .. } => {
                let most = self.offsets[offsets.clone()].last().map_or(0, |&d| d as usize);
                block.first + block.rows + most
            }
            Shape::Scattered { ends } => {
                let ends = &self.ends[*ends..*ends + block.edges.len()];
                ends.iter().map(|[_, b]| *b as usize + 1).max().unwrap_or(0)
            }
        };
        farthest.max(block.first + block.rows)
    }
}

//! The working memory of `sweep`: who has to be measured before which edges, the present values of the agents in
//! reach, and what flows to them. A window slides over the agents, so that in local order all of it stays in
//! the cache however many agents there are. Knows no law.

use super::blocks::{Block, Layout};
use super::diagnosis::CHUNK;
use super::diagonals::STRIDE;
use super::network::Network;
use std::ops::Range;

/// Values of an agent that flows are made of; their places are [`at`].
pub const SIGNALS: usize = 9;
/// What comes of flows at an agent: the sums of the first five, and the largest exchange wanted.
pub const SUMS: usize = 6;
/// Edges that are taken together where they are taken one by one.
pub const BATCH: usize = 64;

/// Where what stands.
pub mod at {
    /// omega, p, V, q, in this order: what the laws act on.
    pub const LAWS: usize = 4;
    /// SoC; among the sums the exchange.
    pub const SOC: usize = 4;
    /// C, pu*h.
    pub const CAPACITY: usize = 5;
    /// P_exchange_max / peers, pu.
    pub const LIMIT: usize = 6;
    /// 1 / (1 + deg).
    pub const SHARE: usize = 7;
    /// 1 + peers.
    pub const CROWD: usize = 8;
    /// Among the sums: the largest exchange that an edge wanted, pu.
    pub const WANTED: usize = 5;
}

/// The agents in reach.
#[derive(Clone, Debug, Default)]
pub struct Window {
    /// The agent of element 0.
    origin: usize,
    /// Values of the agents.
    pub signals: [Vec<f64>; SIGNALS],
    /// What flows to them.
    pub sums: [Vec<f64>; SUMS],
}

impl Window {
    /// Elements of agents `from..to`.
    #[inline(always)]
    pub fn of(&self, from: usize, to: usize) -> Range<usize> {
        from - self.origin..to - self.origin
    }

    /// The agent of element 0.
    #[inline(always)]
    pub fn origin(&self) -> usize {
        self.origin
    }

    /// Makes room up to agent `until`; agents below `from` are needed no more, those from `measured` not yet.
    #[inline(always)]
    fn slide(&mut self, (from, measured): (usize, usize), until: usize) {
        let kept = self.of(from, measured.max(from));
        if until - self.origin > self.signals[0].len() {
            for values in self.signals.iter_mut().chain(&mut self.sums) {
                values.copy_within(kept.clone(), 0);
            }
            self.origin = from;
        }
    }
}

/// Values of edges that are taken together.
pub type Batch<const N: usize> = [[f64; BATCH]; N];

/// What flows along the edges of a block.
#[derive(Clone, Debug)]
pub struct Work {
    /// By [`place`](super::diagonals::place).
    pub flows: Vec<f64>,
    /// The exchange as wanted, alike.
    pub wanted: Vec<f64>,
    /// 1 / (1 + max(deg_i, deg_j)).
    pub shares: Vec<f64>,
    /// Values at the lower ends of edges that are taken one by one.
    pub lower: Batch<SIGNALS>,
    /// Values at their higher ends.
    pub higher: Batch<SIGNALS>,
    /// What flows along them, by sum, and their shares.
    pub batch: Batch<{ SUMS + 1 }>,
}

impl Default for Work {
    fn default() -> Self {
        Self {
            flows: Vec::new(),
            wanted: Vec::new(),
            shares: Vec::new(),
            lower: [[0.0; BATCH]; SIGNALS],
            higher: [[0.0; BATCH]; SIGNALS],
            batch: [[0.0; BATCH]; SUMS + 1],
        }
    }
}

/// Window and order of a graph.
#[derive(Clone, Debug, Default)]
pub struct Wave {
    layout: Layout,
    /// For each block, how far up its edges and those of the blocks before look.
    tops: Vec<usize>,
    window: Window,
    work: Work,
}

/// What is done on the way, in this order for each part of the graph.
pub trait Stages {
    /// Fills in the signals of agents `from..to`.
    fn measure(&mut self, from: usize, to: usize, window: &mut Window);
    /// Takes the flows of a block from the sums of the lower ends and adds them to those of the higher ends.
    fn flow(&mut self, block: &Block, layout: &Layout, window: &mut Window, work: &mut Work);
    /// Takes what flows to agents `from..to`, which nothing flows to any more.
    fn finish(&mut self, from: usize, to: usize, window: &mut Window);
}

impl Wave {
    /// For the edges of this network.
    pub fn new(network: &Network) -> Self {
        let layout = Layout::new(network);
        let (mut tops, mut top, mut live) = (Vec::new(), 0, 0);
        for block in &layout.blocks {
            top = layout.top(block).max(top);
            live = live.max(top - block.first);
            tops.push(top);
        }
        // Where the reach is long the window slides once in as many agents, so that each is moved once.
        let length = live + live.saturating_sub(CHUNK);
        let window = Window {
            origin: 0,
            signals: std::array::from_fn(|_| vec![0.0; length]),
            sums: std::array::from_fn(|_| vec![0.0; length]),
        };
        let places = vec![0.0; layout.most_diagonals * STRIDE];
        let shares = vec![0.0; layout.most_diagonals * CHUNK];
        let work = Work { flows: places.clone(), wanted: places, shares, ..Work::default() };
        Self { layout, tops, window, work }
    }

    /// Runs the stages over all agents and edges.
    #[inline(always)]
    pub fn run(&mut self, n: usize, stages: &mut impl Stages) {
        let Self { layout, tops, window, work } = self;
        let mut measured = 0;
        window.origin = 0;
        for (block, &top) in layout.blocks.iter().zip(&*tops) {
            let (from, until) = (block.first, top.min(n));
            window.slide((from, measured), top);
            if measured < until {
                stages.measure(measured, until, window);
                let fresh = window.of(measured, until);
                for sums in &mut window.sums {
                    sums[fresh.clone()].fill(0.0);
                }
                measured = until;
            }
            stages.flow(block, layout, window, work);
            stages.finish(from, from + block.rows, window);
        }
    }
}

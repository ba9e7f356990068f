//! An undirected weighted graph with pins to the virtual leader, as compact arrays: a sorted edge list,
//! compressed neighbour rows and degrees. Knows nothing of delays in progress, values or laws.

/// An undirected edge with `a < b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// The lower end, from 0.
    pub a: u32,
    /// The higher end, from 0.
    pub b: u32,
    /// w_ab = w_ba > 0.
    pub weight: f64,
    /// tau_ab of this edge alone, ns; `None`: the common delay.
    pub delay_ns: Option<i64>,
}

impl Edge {
    /// An edge with the common delay, its ends put in order.
    pub fn new(a: usize, b: usize, weight: f64) -> Self {
        Self { a: a.min(b) as u32, b: a.max(b) as u32, weight, delay_ns: None }
    }

    /// The two ends as positions.
    pub fn ends(&self) -> (usize, usize) {
        (self.a as usize, self.b as usize)
    }
}

/// A communication graph on agents 0 .. n.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Graph {
    n: usize,
    edges: Vec<Edge>,
    /// a_0i of each agent, 0 when not pinned.
    pins: Vec<f64>,
    /// Number of neighbours among the agents.
    peers: Vec<u32>,
    /// Start of each agent's row in `adjacent`.
    offsets: Vec<u32>,
    /// Neighbours, row by row.
    adjacent: Vec<u32>,
}

impl Graph {
    /// Builds the arrays. Ends must be below `n` and `pins` n long; edges are sorted, and of edges
    /// between the same two agents the first is kept.
    pub fn new(n: usize, mut edges: Vec<Edge>, pins: Vec<f64>) -> Self {
        edges.sort_by_key(|e| (e.a, e.b));
        edges.dedup_by_key(|e| (e.a, e.b));
        let mut peers = vec![0u32; n];
        for edge in &edges {
            let (a, b) = edge.ends();
            peers[a] += 1;
            peers[b] += 1;
        }
        let mut offsets = Vec::with_capacity(n + 1);
        offsets.push(0);
        for (i, &degree) in peers.iter().enumerate() {
            offsets.push(offsets[i] + degree);
        }
        let mut next: Vec<u32> = offsets[..n].to_vec();
        let mut adjacent = vec![0u32; 2 * edges.len()];
        for edge in &edges {
            for (from, to) in [(edge.a, edge.b), (edge.b, edge.a)] {
                let slot = &mut next[from as usize];
                adjacent[*slot as usize] = to;
                *slot += 1;
            }
        }
        Self { n, edges, pins, peers, offsets, adjacent }
    }

    /// Number of agents, connected or not.
    pub fn agents(&self) -> usize {
        self.n
    }

    /// Edges in ascending order of their ends.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// a_0i of each agent.
    pub fn pins(&self) -> &[f64] {
        &self.pins
    }

    /// Neighbours of agent `i`, without the virtual leader.
    pub fn neighbours(&self, i: usize) -> &[u32] {
        &self.adjacent[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }

    /// Number of neighbours of agent `i`, without the virtual leader.
    pub fn peers(&self, i: usize) -> u32 {
        self.peers[i]
    }

    /// Number of neighbours of each agent, without the virtual leader.
    pub fn all_peers(&self) -> &[u32] {
        &self.peers
    }

    /// Number of neighbours of agent `i`; a pinned agent counts the virtual leader as one (DESIGN 1.1).
    pub fn degree(&self, i: usize) -> u32 {
        self.peers[i] + u32::from(self.pins[i] > 0.0)
    }

    /// Position of the edge between `a` and `b`.
    pub fn find(&self, a: u32, b: u32) -> Option<usize> {
        self.edges.binary_search_by_key(&(a.min(b), a.max(b)), |e| (e.a, e.b)).ok()
    }

    /// The graph without the agents for which `keep` is false: they stay in the numbering, alone.
    pub fn restricted(&self, keep: &[bool]) -> Self {
        if keep.iter().all(|&k| k) {
            return self.clone();
        }
        let kept = |i: u32| keep[i as usize];
        let edges = self.edges.iter().copied().filter(|e| kept(e.a) && kept(e.b)).collect();
        let pins = self.pins.iter().zip(keep).map(|(&pin, &k)| if k { pin } else { 0.0 }).collect();
        Self::new(self.n, edges, pins)
    }

    /// The connected components of the agents for which `member` is true.
    pub fn components(&self, member: &[bool]) -> Components {
        let mut of = vec![Components::NONE; self.n];
        let mut pinned = Vec::new();
        let mut stack = Vec::new();
        for start in 0..self.n {
            if !member[start] || of[start] != Components::NONE {
                continue;
            }
            let number = pinned.len() as u32;
            let mut pin = false;
            of[start] = number;
            stack.push(start);
            while let Some(i) = stack.pop() {
                pin |= self.pins[i] > 0.0;
                for &j in self.neighbours(i) {
                    let j = j as usize;
                    if member[j] && of[j] == Components::NONE {
                        of[j] = number;
                        stack.push(j);
                    }
                }
            }
            pinned.push(pin);
        }
        Components { of, pinned }
    }
}

/// Connected components, numbered from 0 in the order of their lowest agents.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// Component of each agent, or [`Components::NONE`].
    pub of: Vec<u32>,
    /// Whether a component has a pinned agent.
    pub pinned: Vec<bool>,
}

impl Components {
    /// The component of an agent that was left out.
    pub const NONE: u32 = u32::MAX;

    /// Number of components.
    pub fn count(&self) -> usize {
        self.pinned.len()
    }

    /// Lowest agent of component `number`.
    pub fn first(&self, number: usize) -> Option<usize> {
        self.of.iter().position(|&c| c as usize == number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_degrees_and_components_of_a_path_and_a_pair() {
        let edges =
            vec![Edge::new(2, 1, 0.5), Edge::new(0, 1, 1.0), Edge::new(4, 3, 1.0), Edge::new(3, 4, 9.0)];
        let graph = Graph::new(5, edges, vec![1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(graph.edges().len(), 3, "the second edge between 4 and 5 is dropped");
        assert_eq!(graph.neighbours(1), &[0, 2]);
        assert_eq!((graph.degree(0), graph.peers(0)), (2, 1));
        assert_eq!(graph.find(2, 1), Some(1));
        let parts = graph.components(&[true; 5]);
        assert_eq!(parts.of, vec![0, 0, 0, 1, 1]);
        assert_eq!(parts.pinned, vec![true, false]);
        let without = graph.restricted(&[true, false, true, true, true]);
        assert_eq!(
            without.components(&[true, false, true, true, true]).of,
            vec![0, Components::NONE, 1, 2, 2]
        );
    }
}

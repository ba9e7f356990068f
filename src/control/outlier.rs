//! The outlier-resilient option: which of its neighbours' values an agent leaves out of a sum. Sorts out
//! values, never computes a flow; used for sharing, frequency and voltage, never for the energy exchange.
//!
//! Each agent drops the f largest and the f smallest values that its neighbours tell it, where it has more than 2f
//! neighbours; its own value and the virtual leader's are never dropped. So no f neighbours, whatever they tell, can
//! draw it beyond what the others tell. On a (2f + 1)-robust graph with at most f wrong neighbours around each agent
//! the others then agree all the same: LeBlanc, Zhang, Koutsoukos, Sundaram, "Resilient asymptotic consensus in robust
//! networks", IEEE JSAC 31 (2013), whose rule spares values on the agent's own side and has the same guarantee. The
//! two ends of an edge sort out on their own, so that flows no longer cancel and the mean of what is told is not kept.

use super::graph::Graph;

/// One neighbour of an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// The edge to it.
    pub edge: u32,
    /// The neighbour, from 0.
    pub neighbour: u32,
    /// Which end of the edge the agent itself is: 0 for the lower.
    pub end: u8,
}

/// The neighbours of every agent, and how many of them are sorted out.
#[derive(Clone, Debug)]
pub struct Trimming {
    f: usize,
    offsets: Vec<u32>,
    links: Vec<Link>,
}

impl Trimming {
    /// For a graph; none where `f` is 0, for then nothing is sorted out.
    pub fn new(graph: &Graph, f: u32) -> Option<Self> {
        if f == 0 {
            return None;
        }
        let mut offsets = vec![0u32];
        let mut links = Vec::with_capacity(2 * graph.edges().len());
        for i in 0..graph.agents() as u32 {
            let row = graph.neighbours(i as usize).iter();
            links.extend(row.filter_map(|&j| {
                let edge = graph.find(i.min(j), i.max(j))? as u32;
                Some(Link { edge, neighbour: j, end: u8::from(i > j) })
            }));
            offsets.push(links.len() as u32);
        }
        Some(Self { f: f as usize, offsets, links })
    }

    /// The neighbours of agent `i`.
    pub fn links(&self, i: usize) -> &[Link] {
        &self.links[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }

    /// Whether the value of `link`, one of the `row` of an agent's neighbours, stays among those that it `hears`. Of
    /// equal values the first counts as the smaller. Counting takes the square of the number of neighbours, but no
    /// memory.
    pub fn keeps(
        &self,
        link: &Link,
        row: &[Link],
        hears: impl Fn(&Link) -> bool,
        value: impl Fn(&Link) -> f64,
    ) -> bool {
        let own = value(link);
        let (mut below, mut heard) = (0, 0);
        for other in row.iter().filter(|other| hears(other)) {
            heard += 1;
            let found = value(other);
            below += usize::from(found < own || (found == own && other.neighbour < link.neighbour));
        }
        heard <= 2 * self.f || (below >= self.f && heard - 1 - below >= self.f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::graph::Edge;

    fn kept(f: u32, values: &[f64]) -> Vec<f64> {
        // A star around agent 0, whose neighbour k + 1 tells values[k].
        let n = values.len() + 1;
        let star = Graph::new(n, (1..n).map(|j| Edge::new(0, j, 1.0)).collect(), vec![0.0; n]);
        let trimming = Trimming::new(&star, f).unwrap();
        let told = |link: &Link| values[link.neighbour as usize - 1];
        let row = trimming.links(0);
        row.iter().filter(|link| trimming.keeps(link, row, |_| true, told)).map(told).collect()
    }

    #[test]
    fn the_f_largest_and_the_f_smallest_go_where_there_are_more_than_2f() {
        assert_eq!(kept(1, &[5.0, -1.0, 3.0]), [3.0]);
        assert_eq!(kept(1, &[5.0, -1.0]), [5.0, -1.0], "two neighbours are not more than 2f");
        assert_eq!(kept(2, &[1.0, 9.0, 2.0, 8.0, 3.0]), [3.0]);
        assert_eq!(kept(1, &[4.0, 4.0, 4.0, 4.0]).len(), 2, "equal values are counted one by one");
    }

    #[test]
    fn rows_know_their_edges_and_ends() {
        let edges = vec![Edge::new(0, 1, 1.0), Edge::new(1, 2, 1.0), Edge::new(0, 2, 1.0)];
        let graph = Graph::new(3, edges, vec![0.0; 3]);
        let trimming = Trimming::new(&graph, 1).unwrap();
        for i in 0..3 {
            for link in trimming.links(i) {
                let ends = graph.edges()[link.edge as usize].ends();
                let (own, other) = if link.end == 0 { ends } else { (ends.1, ends.0) };
                assert_eq!((own, other), (i, link.neighbour as usize));
            }
        }
        assert!(Trimming::new(&graph, 0).is_none());
    }
}

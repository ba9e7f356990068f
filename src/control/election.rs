//! Leaders elected anew in a fleet whose parts are the clusters of a graph made step by step. Who is there in one's own
//! cluster is known at once, and decides who leads it and how its agents are linked. Of the links to other clusters both
//! ends must think the same, so those follow what both told of the same sample. Decides nothing of when.

use super::across::Across;
use super::controller::Controller;
use super::graph::Graph;
use super::outer::Outer;
use super::topology::step_by_step;

impl Controller {
    /// Graph and leaders among these agents of the fleet, where a part elects them.
    pub(super) fn elected(&self, available: &[bool]) -> Option<(Graph, Vec<usize>)> {
        let across = self.fixed.across.as_ref()?;
        let election = across.part.election.as_ref()?;
        let k = self.state.adopted.topology;
        let (_, cluster, _) = self.topologies.written(k)?;
        let from_zero: Vec<usize> = cluster.iter().map(|&c| c.max(1) as usize - 1).collect();
        let (graph, _, leaders) = step_by_step(election, &from_zero, k, available);
        Some((graph, leaders))
    }

    /// The graph that a part sees: its own cluster as it is, the links to others as all told.
    pub(super) fn elect(&self, across: &Across, outer: &Outer) -> Option<(Graph, Vec<usize>)> {
        let own = |i: usize| !across.outside[i];
        let n = across.outside.len();
        let present = |i: usize| if own(i) { self.state.adopted.available[i] } else { outer.available[i] };
        let (inside, leaders) = self.elected(&(0..n).map(present).collect::<Vec<_>>())?;
        let (told, _) = self.elected(&outer.available)?;
        let links = inside.edges().iter().filter(|edge| own(edge.a as usize) && own(edge.b as usize));
        let links = links.chain(told.edges().iter().filter(|edge| outer.crosses_edge(edge)));
        let pins = (0..n).map(|i| if own(i) { inside.pins()[i] } else { told.pins()[i] });
        Some((Graph::new(n, links.copied().collect(), pins.collect()), leaders))
    }
}

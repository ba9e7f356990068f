//! `bess cluster`: who talks to whom, and why.

use super::{Failure, ScenarioArgs, print};
use crate::control::clustering::{Clustering, Verdict};
use crate::control::topology::{Topologies, Topology};
use crate::scenario::Resolved;
use std::fmt::Write as _;

/// Prints the spanning tree, the cuts with their gains, and each topology with its clusters, leaders and weights.
pub fn cluster(args: &ScenarioArgs) -> Result<(), Failure> {
    let resolved = args.resolve()?;
    let n = resolved.control.agents();
    let topologies = Topologies::new(n, &resolved.control.communication);
    let mut text = format!("{}: {n} batteries\n", resolved.scenario.name);
    if let Some(clustering) = topologies.clustering() {
        write_clustering(&mut text, &resolved, clustering);
    }
    for k in 0..topologies.count() {
        let name = resolved.control.communication.topology_name(k).unwrap_or_default();
        let _ = writeln!(text, "\nTopology {} ({name})", k + 1);
        write_topology(&mut text, &resolved, &topologies.build(k, &vec![true; n]));
    }
    print(&text)
}

fn write_clustering(text: &mut String, resolved: &Resolved, clustering: &Clustering) {
    let name = |i: usize| resolved.bess_name(i);
    text.push_str("\nMinimum spanning tree\n");
    for link in &clustering.tree {
        let _ = writeln!(text, "  {:<10} {:<10} {:>10.5}", name(link.a), name(link.b), link.length);
    }
    text.push_str("\nCuts, in the order tried (gain: fall of the standard deviation of the trees' edges)\n");
    for cut in &clustering.cuts {
        let verdict = verdict(cut.verdict);
        let _ = writeln!(
            text,
            "  {:<10} {:<10} {:>10.5}  gain {:.5}  {verdict}",
            name(cut.link.a),
            name(cut.link.b),
            cut.link.length,
            cut.gain
        );
    }
    for i in &clustering.joined {
        let _ = writeln!(text, "  {} stood alone and joined the nearest cluster", name(*i));
    }
}

fn write_topology(text: &mut String, resolved: &Resolved, topology: &Topology) {
    let name = |i: usize| resolved.bess_name(i);
    let clusters = topology.cluster.iter().copied().max().unwrap_or(0);
    for c in 1..=clusters {
        let members: Vec<String> = (0..topology.cluster.len())
            .filter(|i| topology.cluster[*i] == c)
            .map(|i| if topology.leaders.contains(&i) { format!("{} (leader)", name(i)) } else { name(i) })
            .collect();
        let _ = writeln!(text, "  cluster {c}: {}", members.join(", "));
    }
    text.push_str("  edges\n");
    for edge in topology.graph.edges() {
        let (a, b) = edge.ends();
        let _ = writeln!(text, "    {:<10} {:<10} weight {:.5}", name(a), name(b), edge.weight);
    }
    for (i, weight) in topology.graph.pins().iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
        let _ = writeln!(text, "    {:<10} {:<10} weight {weight:.5}", "leader 0", name(i));
    }
}

/// Why a cut stands or not, in words.
pub fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::First => "cut",
        Verdict::Gains => "cut: gains at least as much as the first",
        Verdict::OnTheWay => "cut: a later cut gains at least as much as the first",
        Verdict::Kept => "kept: from here on no cut gains as much as the first",
    }
}

//! The sections of a run's report: overlays of a run with its variants, communication graphs, clustering, bounds.

use super::super::{Failure, bounds, certified};
use super::comparison::{self, Compared, Row};
use super::record::Record;
use super::terms::Terms;
use crate::control::clustering::Link;
use crate::control::topology::{Topologies, Topology};
use crate::report::{
    Branch, Edge, Figure, GraphFigure, Item, Line, Node, Section, Table, TreeFigure, cluster_layout, dash_of,
    format_value,
};
use crate::scenario::Resolved;
use miette::IntoDiagnostic;

/// Numbers of the paper's figures of states and errors for its four cases.
pub fn figures_of_paper(name: &str) -> Option<(u32, u32)> {
    let first = match name {
        "case1" => 6,
        "case2" => 8,
        "case3" => 10,
        "case4" => 12,
        _ => return None,
    };
    Some((first, first + 1))
}

/// A run and its variants side by side: the table, and one line per run in each error figure.
pub fn side_by_side(rows: &[Row], own: (&Terms, &Record), compared: &[Compared]) -> Result<Section, Failure> {
    let mut overlays: Vec<Figure> = Vec::new();
    for row in rows {
        let figures = match row.run.checked_sub(1).and_then(|k| compared.get(k)) {
            Some(other) => Terms::of(&other.resolved).errors(&other.record),
            None => own.0.errors(own.1),
        };
        let figures = figures.into_diagnostic()?;
        if overlays.is_empty() {
            overlays = figures.iter().map(empty_overlay).collect();
        }
        for (overlay, figure) in overlays.iter_mut().zip(&figures) {
            overlay.lines.extend(worst_line(figure, &row.label, row.run));
        }
    }
    Ok(Section {
        heading: "Side by side".into(),
        text: comparison::eta_verdict(rows).unwrap_or_default(),
        items: std::iter::once(Item::Table(comparison::table(rows)))
            .chain(overlays.into_iter().map(Item::Figure))
            .collect(),
    })
}

fn empty_overlay(figure: &Figure) -> Figure {
    Figure {
        title: format!("{}, worst BESS of each run", figure.title),
        lines: Vec::new(),
        note: format!("One line per run: the largest over all BESS. {}", figure.note),
        ..figure.clone()
    }
}

/// The largest of all lines at each instant, as the line of run number `k`.
fn worst_line(figure: &Figure, label: &str, k: usize) -> Option<Line> {
    let x = figure.lines.first()?.x.clone();
    let worst = |s: usize| figure.lines.iter().filter_map(|l| l.y.get(s)).copied().fold(f64::NAN, f64::max);
    let y = (0..x.len()).map(worst).collect();
    Some(Line { name: label.to_owned(), x, y, color: Some(k), dash: dash_of(k) })
}

/// How CAK found the clusters, and the communication graphs, at the positions of the batteries where they are
/// known.
pub fn communication(resolved: &Resolved) -> Section {
    let config = &resolved.control;
    let n = config.agents();
    let topologies = Topologies::new(n, &config.communication);
    let mut items = Vec::new();
    items.extend(tree(resolved, &topologies).map(Item::Tree));
    items.extend(clustering(resolved, &topologies).map(Item::Table));
    for k in 0..topologies.count() {
        let topology = topologies.build(k, &vec![true; n]);
        let groups: Vec<usize> = topology.cluster.iter().map(|c| (*c - 1).max(0) as usize).collect();
        let nodes = nodes(resolved, &groups, &topology);
        let edges = topology.graph.edges().iter().map(|e| {
            let (a, b) = e.ends();
            Edge { a, b, weight: e.weight }
        });
        let pins = topology.graph.pins().iter().enumerate().filter(|(_, w)| **w > 0.0).map(|(i, _)| i);
        let name = config.communication.topology_name(k).unwrap_or_default();
        items.push(Item::Graph(GraphFigure {
            title: format!("Topology {}: {name}", k + 1),
            nodes,
            edges: edges.collect(),
            pins: pins.collect(),
            note: "Shaded: clusters. Edges: who talks to whom, with weights.".into(),
        }));
    }
    let text = "The counterpart of the paper's Figure 5.".into();
    Section { heading: "Communication".into(), text, items }
}

/// What the theorem certifies: over eta, and for the scenario's own.
pub fn certificates(resolved: &Resolved) -> Result<Section, Failure> {
    let bounds = bounds::Bounds::of(resolved)?;
    let mut items: Vec<Item> = certified::figures(resolved, &bounds)?.into_iter().map(Item::Figure).collect();
    items.push(Item::Table(bounds.table()));
    Ok(Section { heading: "Certified times".into(), text: certified::TEXT.into(), items })
}

/// The batteries in clusters `groups`, at their positions where those are known.
fn nodes(resolved: &Resolved, groups: &[usize], topology: &Topology) -> Vec<Node> {
    let given: Option<Vec<(f64, f64)>> =
        resolved.scenario.bess.iter().map(|b| b.position.map(|[x, y]| (x, y))).collect();
    let leads: Vec<bool> = (0..groups.len()).map(|i| topology.leaders.contains(&i)).collect();
    let places = given.unwrap_or_else(|| cluster_layout(groups, &leads));
    let node = |(i, (group, (x, y))): (usize, (&usize, &(f64, f64)))| Node {
        name: resolved.bess_name(i),
        x: *x,
        y: *y,
        group: *group,
        is_leader: topology.leaders.contains(&i),
    };
    groups.iter().zip(&places).enumerate().map(node).collect()
}

/// The minimum spanning tree with its cuts as a drawing, where distances were given.
fn tree(resolved: &Resolved, topologies: &Topologies) -> Option<TreeFigure> {
    let found = topologies.clustering()?;
    let topology = topologies.build(0, &vec![true; resolved.control.agents()]);
    let branch = |link: &Link| {
        let cut = found.cuts.iter().find(|c| (c.link.a, c.link.b) == (link.a, link.b));
        Branch {
            a: link.a,
            b: link.b,
            length: link.length,
            gain: cut.map(|cut| cut.gain),
            is_cut: cut.is_some_and(|cut| cut.verdict.is_cut()),
            verdict: cut.map_or("kept", |cut| super::super::cluster::verdict(cut.verdict)).to_owned(),
        }
    };
    Some(TreeFigure {
        title: "Clustering: the minimum spanning tree and its cuts".into(),
        nodes: nodes(resolved, &found.cluster, &topology),
        branches: found.tree.iter().map(branch).collect(),
        note: "Colours: clusters, here and not the batteries. Numbers: distances, and what a cut gains (fall of the \
               standard deviation of the trees' edges). Framed: active leaders. Point at an edge for the verdict."
            .into(),
    })
}

/// The minimum spanning tree with its cuts, where distances were given.
fn clustering(resolved: &Resolved, topologies: &Topologies) -> Option<Table> {
    let found = topologies.clustering()?;
    let row = |link: &Link| {
        let cut = found.cuts.iter().find(|c| (c.link.a, c.link.b) == (link.a, link.b));
        let (gain, verdict) = match cut {
            Some(cut) => (format_value(cut.gain, 3), super::super::cluster::verdict(cut.verdict)),
            None => ("\u{2013}".into(), "kept"),
        };
        let (a, b) = (resolved.bess_name(link.a), resolved.bess_name(link.b));
        vec![format!("{a} to {b}"), format_value(link.length, 4), gain, verdict.to_owned()]
    };
    let alone: Vec<String> = found.joined.iter().map(|i| resolved.bess_name(*i)).collect();
    let joined = if alone.is_empty() {
        String::new()
    } else {
        format!(" {} stood alone and joined the nearest cluster.", alone.join(", "))
    };
    Some(Table {
        caption: format!(
            "Clustering (CAK): the minimum spanning tree over the distances. Gain of a cut: fall of the standard \
             deviation of the trees' edges.{joined}"
        ),
        header: ["edge of the tree", "distance", "gain", "verdict"].map(str::to_owned).to_vec(),
        rows: found.tree.iter().map(row).collect(),
    })
}

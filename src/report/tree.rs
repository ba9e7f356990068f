//! A minimum spanning tree with its cuts, drawn at positions: what was kept and what was cut, the clusters
//! in colours, leaders marked. Draws what it is told; finds no tree and makes no cut.

use super::error::ReportError;
use super::figure::legend;
use super::graph::{Edge, GraphFigure, Node};
use super::{escape, format_value, palette};
use plotly::Scatter;
use plotly::common::{DashType, HoverInfo, Line as Stroke, Marker, MarkerSymbol, Mode};
use plotly::layout::Margin;
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// A minimum spanning tree at the positions of its agents.
#[derive(Clone, Debug, Default)]
pub struct TreeFigure {
    /// Shown above the figure.
    pub title: String,
    /// The agents; their cluster fixes the colour.
    pub nodes: Vec<Node>,
    /// The edges of the tree.
    pub branches: Vec<Branch>,
    /// Small print below; may be empty.
    pub note: String,
}

/// An edge of the tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Branch {
    /// One end, counted from 0.
    pub a: usize,
    /// The other end.
    pub b: usize,
    /// Distance of the ends, in the unit of the distances.
    pub length: f64,
    /// What cutting it gains, in the same unit, where that was weighed.
    pub gain: Option<f64>,
    /// Whether it was cut.
    pub is_cut: bool,
    /// Why, in words.
    pub verdict: String,
}

const KEPT: &str = "#4b5563";
const CUT: &str = "#b91c1c";

impl TreeFigure {
    /// What the page's script draws: `data` and `layout` as Plotly wants them.
    pub(super) fn to_json(&self) -> Result<Map<String, Value>, ReportError> {
        let graph = self.graph();
        graph.check()?;
        let frame = graph.frame();
        let mut data = Vec::new();
        for is_cut in [false, true] {
            data.extend(self.strokes(is_cut)?);
        }
        data.extend(self.clusters()?);
        data.extend(self.leaders()?);
        let texts: Vec<String> = self.branches.iter().map(Branch::label).collect();
        let layout = graph
            .layout(frame, None, &texts)
            .margin(Margin::new().left(10).right(130).top(14).bottom(10))
            .show_legend(true)
            .legend(legend());
        let mut object = Map::new();
        object.insert("data".to_owned(), Value::Array(data));
        object.insert("layout".to_owned(), serde_json::to_value(layout)?);
        Ok(object)
    }

    /// Height of the whole figure, px.
    pub(super) fn height(&self) -> usize {
        super::graph::HEIGHT
    }

    /// The tree as a graph, which knows how to place things.
    fn graph(&self) -> GraphFigure {
        let edge = |branch: &Branch| Edge { a: branch.a, b: branch.b, weight: branch.length };
        GraphFigure {
            title: self.title.clone(),
            nodes: self.nodes.clone(),
            edges: self.branches.iter().map(edge).collect(),
            ..GraphFigure::default()
        }
    }

    /// The kept or the cut edges: one entry in the legend hides or shows them all.
    fn strokes(&self, is_cut: bool) -> Result<Vec<Value>, ReportError> {
        let (name, color, dash) =
            if is_cut { ("cut", CUT, DashType::Dash) } else { ("kept", KEPT, DashType::Solid) };
        let mut traces = Vec::new();
        let (mut x, mut y, mut text) = (Vec::new(), Vec::new(), Vec::new());
        for branch in self.branches.iter().filter(|branch| branch.is_cut == is_cut) {
            let (Some(a), Some(b)) = (self.nodes.get(branch.a), self.nodes.get(branch.b)) else { continue };
            let stroke = Scatter::<f64, f64>::default()
                .x(vec![a.x, b.x])
                .y(vec![a.y, b.y])
                .mode(Mode::Lines)
                .name(format!("edge {name}"))
                .legend_group(name)
                .show_legend(traces.is_empty())
                .line(Stroke::new().color(color).width(2.4).dash(dash.clone()))
                .hover_info(HoverInfo::Skip);
            traces.push(serde_json::to_value(stroke)?);
            x.push((a.x + b.x) / 2.0);
            y.push((a.y + b.y) / 2.0);
            text.push(branch.hover(a, b));
        }
        if !traces.is_empty() {
            let middles = Scatter::<f64, f64>::default()
                .x(x)
                .y(y)
                .text_array(text)
                .mode(Mode::Markers)
                .legend_group(name)
                .show_legend(false)
                .marker(Marker::new().size(16).color(color).opacity(0.0))
                .hover_info(HoverInfo::Text);
            traces.push(serde_json::to_value(middles)?);
        }
        Ok(traces)
    }

    /// The agents, one trace for each cluster.
    fn clusters(&self) -> Result<Vec<Value>, ReportError> {
        let mut members: BTreeMap<usize, Vec<&Node>> = BTreeMap::new();
        for node in &self.nodes {
            members.entry(node.group).or_default().push(node);
        }
        let trace = |(group, nodes): (&usize, &Vec<&Node>)| {
            let role = |node: &Node| if node.is_leader { ", active leader" } else { "" };
            let text =
                |node: &&Node| format!("{}<br>cluster {}{}", escape::html(&node.name), group + 1, role(node));
            let marks = Scatter::<f64, f64>::default()
                .x(nodes.iter().map(|node| node.x).collect())
                .y(nodes.iter().map(|node| node.y).collect())
                .text_array(nodes.iter().map(text).collect())
                .mode(Mode::Markers)
                .name(format!("cluster {}", group + 1))
                .marker(
                    Marker::new()
                        .size(20)
                        .color(palette::color_of(*group))
                        .opacity(1.0)
                        .line(Stroke::new().color("#ffffff").width(2.0)),
                )
                .hover_info(HoverInfo::Text)
                .clip_on_axis(false);
            Ok(serde_json::to_value(marks)?)
        };
        members.iter().map(trace).collect()
    }

    /// A frame around each active leader.
    fn leaders(&self) -> Result<Option<Value>, ReportError> {
        let leaders = || self.nodes.iter().filter(|node| node.is_leader);
        if leaders().next().is_none() {
            return Ok(None);
        }
        let marker = Marker::new()
            .size(28)
            .symbol(MarkerSymbol::SquareOpen)
            .color(palette::INK)
            .opacity(1.0)
            .line(Stroke::new().color(palette::INK).width(2.0));
        let marks = Scatter::<f64, f64>::default()
            .x(leaders().map(|node| node.x).collect())
            .y(leaders().map(|node| node.y).collect())
            .mode(Mode::Markers)
            .name("active leader")
            .marker(marker)
            .hover_info(HoverInfo::Skip)
            .clip_on_axis(false);
        Ok(Some(serde_json::to_value(marks)?))
    }
}

impl Branch {
    fn label(&self) -> String {
        let length = format_value(self.length, 3);
        match self.gain.filter(|_| self.is_cut) {
            Some(gain) => format!("{length}, gain {}", format_value(gain, 2)),
            None => length,
        }
    }

    fn hover(&self, a: &Node, b: &Node) -> String {
        let ends = format!("{} \u{2013} {}", escape::html(&a.name), escape::html(&b.name));
        let gain = match self.gain {
            Some(gain) => format!("<br>gain of the cut {}", format_value(gain, 4)),
            None => String::new(),
        };
        let verdict = escape::html(&self.verdict);
        format!("{ends}<br>distance {}{gain}<br>{verdict}", format_value(self.length, 4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree() -> TreeFigure {
        let node = |x: f64, group| Node { name: format!("<{x}>"), x, y: 0.0, group, is_leader: x == 1.0 };
        let branch = |a, b, length: f64, gain: Option<f64>| Branch {
            a,
            b,
            length,
            gain,
            is_cut: gain.is_some(),
            verdict: "because".to_owned(),
        };
        TreeFigure {
            nodes: vec![node(0.0, 0), node(1.0, 0), node(3.0, 1), node(4.0, 1)],
            branches: vec![branch(0, 1, 1.0, None), branch(2, 3, 1.0, None), branch(1, 2, 2.0, Some(0.5))],
            ..TreeFigure::default()
        }
    }

    #[test]
    fn kept_and_cut_edges_clusters_and_leaders_each_have_one_entry_in_the_legend() {
        let json = tree().to_json().unwrap();
        let traces = json["data"].as_array().unwrap();
        let shown: Vec<&str> =
            traces.iter().filter(|t| t["showlegend"] != false).map(|t| t["name"].as_str().unwrap()).collect();
        assert_eq!(shown, ["edge kept", "edge cut", "cluster 1", "cluster 2", "active leader"]);
        assert_eq!(traces.iter().filter(|t| t["mode"] == "lines").count(), 3);
        assert_eq!(json["layout"]["showlegend"], true);
    }

    #[test]
    fn an_edge_tells_its_distance_its_gain_and_why() {
        let text = tree().to_json().unwrap()["data"].to_string();
        let cut = "&lt;1&gt; \u{2013} &lt;3&gt;<br>distance 2<br>gain of the cut 0.5<br>because";
        assert!(text.contains(cut), "{text}");
        assert!(text.contains("&lt;0&gt; \u{2013} &lt;1&gt;<br>distance 1<br>because"), "{text}");
        assert!(!text.contains("<1>"));
    }

    #[test]
    fn an_edge_to_nowhere_is_refused() {
        let mut bad = tree();
        bad.branches[0].b = 9;
        assert!(bad.to_json().unwrap_err().to_string().contains('9'));
    }
}

//! A communication graph drawn at positions: edges by weight, clusters shaded, leaders and the virtual
//! leader marked.

use super::error::ReportError;
use super::graph_labels::labels;
use super::{escape, figure, palette};
use plotly::common::{DashType, Font, HoverInfo, Label, Line as Stroke, Marker, MarkerSymbol, Mode};
use plotly::layout::{
    Axis, AxisConstrain, HoverMode, Layout, Margin, Shape, ShapeLayer, ShapeLine, ShapeType,
};
use plotly::{Scatter, layout::AxisRange};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// A communication graph at the positions of its agents.
#[derive(Clone, Debug, Default)]
pub struct GraphFigure {
    /// Shown above the figure.
    pub title: String,
    /// The agents; their index fixes the colour, as in the other figures.
    pub nodes: Vec<Node>,
    /// Undirected edges.
    pub edges: Vec<Edge>,
    /// Agents pinned to the virtual leader, counted from 0; it is drawn where there are any.
    pub pins: Vec<usize>,
    /// Small print below; may be empty.
    pub note: String,
}

/// An agent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Name beside the mark.
    pub name: String,
    /// Position, in any unit, the same for both axes.
    pub x: f64,
    /// Position.
    pub y: f64,
    /// Its cluster, counted from 0.
    pub group: usize,
    /// Whether it is its cluster's active leader.
    pub is_leader: bool,
}

/// An undirected edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Edge {
    /// One end, counted from 0.
    pub a: usize,
    /// The other end.
    pub b: usize,
    /// w_ij.
    pub weight: f64,
}

const EDGE: &str = "#9aa3af";
pub(super) const HEIGHT: usize = 440;

/// An extent: of the agents, or of the drawing with room around them.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    pub x: (f64, f64),
    pub y: (f64, f64),
    span: f64,
}

impl GraphFigure {
    /// What the page's script draws: `data` and `layout` as Plotly wants them.
    pub(super) fn to_json(&self) -> Result<Map<String, Value>, ReportError> {
        self.check()?;
        let frame = self.frame();
        let leader = self.virtual_leader(frame);
        let mut data = Vec::new();
        for pin in &self.pins {
            if let (Some(from), Some(to)) = (leader, self.at(*pin)) {
                data.push(segment(from, to, palette::NEUTRAL, 1.4, DashType::Dash)?);
            }
        }
        let heaviest = self.edges.iter().map(|edge| edge.weight.abs()).fold(0.0, f64::max);
        let share = |edge: &Edge| if heaviest > 0.0 { edge.weight.abs() / heaviest } else { 0.0 };
        for edge in &self.edges {
            if let (Some(from), Some(to)) = (self.at(edge.a), self.at(edge.b)) {
                data.push(segment(from, to, EDGE, 1.2 + 3.6 * share(edge), DashType::Solid)?);
            }
        }
        data.push(self.edge_middles()?);
        data.push(self.marks(false)?);
        data.push(self.marks(true)?);
        if let Some(at) = leader {
            data.push(virtual_mark(at)?);
        }
        let mut object = Map::new();
        object.insert("data".to_owned(), Value::Array(data));
        let weights: Vec<String> =
            self.edges.iter().map(|edge| super::format_value(edge.weight, 2)).collect();
        object.insert("layout".to_owned(), serde_json::to_value(self.layout(frame, leader, &weights))?);
        Ok(object)
    }

    /// Height of the whole figure, px.
    pub(super) fn height(&self) -> usize {
        HEIGHT
    }

    pub(super) fn check(&self) -> Result<(), ReportError> {
        let no_node = |place: String, found| ReportError::NoSuchNode {
            graph: self.title.clone(),
            place,
            found,
            nodes: self.nodes.len(),
        };
        let not_finite =
            |place: String, found| ReportError::NotFinite { graph: self.title.clone(), place, found };
        for (i, node) in self.nodes.iter().enumerate() {
            for found in [node.x, node.y] {
                if !found.is_finite() {
                    return Err(not_finite(format!("position of node {i} `{}`", node.name), found));
                }
            }
        }
        for (k, edge) in self.edges.iter().enumerate() {
            for found in [edge.a, edge.b] {
                if found >= self.nodes.len() {
                    return Err(no_node(format!("edge {k}"), found));
                }
            }
            if !edge.weight.is_finite() {
                return Err(not_finite(format!("weight of edge {k}"), edge.weight));
            }
        }
        match self.pins.iter().find(|&&pin| pin >= self.nodes.len()) {
            Some(&pin) => Err(no_node("a pin".to_owned(), pin)),
            None => Ok(()),
        }
    }

    pub(super) fn at(&self, node: usize) -> Option<(f64, f64)> {
        self.nodes.get(node).map(|n| (n.x, n.y))
    }

    pub(super) fn frame(&self) -> Frame {
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let x = range(&mut self.nodes.iter().map(|n| n.x));
        let y = range(&mut self.nodes.iter().map(|n| n.y));
        if self.nodes.is_empty() {
            return Frame { x: (0.0, 1.0), y: (0.0, 1.0), span: 1.0 };
        }
        let span = (x.1 - x.0).max(y.1 - y.0);
        Frame { x, y, span: if span > 0.0 { span } else { 1.0 } }
    }

    /// Above all agents, over the middle of those that it is pinned to.
    fn virtual_leader(&self, frame: Frame) -> Option<(f64, f64)> {
        let pinned: Vec<f64> = self.pins.iter().filter_map(|&pin| self.at(pin)).map(|at| at.0).collect();
        let count = pinned.len();
        (count > 0).then(|| (pinned.iter().sum::<f64>() / count as f64, frame.y.1 + 0.15 * frame.span))
    }

    /// What the axes show: the agents and the virtual leader, with room for names.
    fn range(&self, frame: Frame, leader: Option<(f64, f64)>) -> Frame {
        let pad = 0.11 * frame.span;
        let top = leader.map_or(frame.y.1, |(_, y)| y.max(frame.y.1));
        Frame {
            x: (frame.x.0 - pad, frame.x.1 + pad),
            y: (frame.y.0 - pad, top + pad),
            span: frame.span + 2.0 * pad,
        }
    }

    fn edge_middles(&self) -> Result<Value, ReportError> {
        let (mut x, mut y, mut text) = (Vec::new(), Vec::new(), Vec::new());
        for edge in &self.edges {
            if let (Some(a), Some(b)) = (self.nodes.get(edge.a), self.nodes.get(edge.b)) {
                x.push((a.x + b.x) / 2.0);
                y.push((a.y + b.y) / 2.0);
                let ends = format!("{} \u{2013} {}", escape::html(&a.name), escape::html(&b.name));
                text.push(format!("{ends}<br>weight {}", super::format_value(edge.weight, 4)));
            }
        }
        let marker = Marker::new().size(14).color(EDGE).opacity(0.0);
        let scatter = Scatter::<f64, f64>::default().x(x).y(y).text_array(text).mode(Mode::Markers);
        Ok(serde_json::to_value(scatter.marker(marker).hover_info(HoverInfo::Text).show_legend(false))?)
    }

    /// The agents: squares for active leaders, circles for the others.
    fn marks(&self, leaders: bool) -> Result<Value, ReportError> {
        let (mut x, mut y, mut text, mut colors) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (i, node) in self.nodes.iter().enumerate().filter(|(_, node)| node.is_leader == leaders) {
            x.push(node.x);
            y.push(node.y);
            colors.push(palette::color_of(i));
            let role = if leaders { ", active leader" } else { "" };
            let pinned = if self.pins.contains(&i) { "<br>pinned to the virtual leader" } else { "" };
            text.push(format!("{}<br>cluster {}{role}{pinned}", escape::html(&node.name), node.group + 1));
        }
        let symbol = if leaders { MarkerSymbol::Square } else { MarkerSymbol::Circle };
        let marker = Marker::new()
            .size(20)
            .symbol(symbol)
            .color_array(colors)
            .opacity(1.0)
            .line(Stroke::new().color("#ffffff").width(2.0));
        let scatter = Scatter::<f64, f64>::default().x(x).y(y).text_array(text).mode(Mode::Markers);
        Ok(serde_json::to_value(
            scatter.marker(marker).hover_info(HoverInfo::Text).show_legend(false).clip_on_axis(false),
        )?)
    }

    /// `texts` stand in the middle of the edges, one each.
    pub(super) fn layout(&self, frame: Frame, leader: Option<(f64, f64)>, texts: &[String]) -> Layout {
        let range = self.range(frame, leader);
        // The plot area gives way to keep the scales equal; else a range would grow at every resize.
        let hidden = || Axis::new().visible(false).constrain(AxisConstrain::Domain);
        Layout::new()
            .auto_size(true)
            .height(HEIGHT)
            .margin(Margin::new().left(10).right(10).top(14).bottom(10))
            .font(Font::new().family(figure::FONT).size(12).color(palette::INK))
            .paper_background_color("#ffffff")
            .plot_background_color("#ffffff")
            .hover_mode(HoverMode::Closest)
            .hover_label(Label::new().background_color("#ffffff").border_color(palette::AXIS))
            .show_legend(false)
            .x_axis(hidden().range(AxisRange::new(range.x.0, range.x.1)))
            .y_axis(hidden().range(AxisRange::new(range.y.0, range.y.1)).scale_anchor("x").scale_ratio(1.0))
            .shapes(self.shades(frame))
            .annotations(labels(self, texts, leader, range))
    }

    /// A light rectangle behind each cluster.
    fn shades(&self, frame: Frame) -> Vec<Shape> {
        let mut boxes: BTreeMap<usize, [f64; 4]> = BTreeMap::new();
        for node in &self.nodes {
            let corner = boxes.entry(node.group).or_insert([node.x, node.y, node.x, node.y]);
            *corner =
                [corner[0].min(node.x), corner[1].min(node.y), corner[2].max(node.x), corner[3].max(node.y)];
        }
        let pad = 0.07 * frame.span;
        let shade = |c: &[f64; 4]| {
            Shape::new()
                .shape_type(ShapeType::Rect)
                .layer(ShapeLayer::Below)
                .x_ref("x")
                .y_ref("y")
                .x0(c[0] - pad)
                .y0(c[1] - pad)
                .x1(c[2] + pad)
                .y1(c[3] + pad)
                .fill_color("#f3f4f6")
                .line(ShapeLine::new().color(palette::GRID).width(1.0))
        };
        boxes.values().map(shade).collect()
    }
}

fn segment(
    from: (f64, f64),
    to: (f64, f64),
    color: &'static str,
    width: f64,
    dash: DashType,
) -> Result<Value, ReportError> {
    let scatter = Scatter::<f64, f64>::default()
        .x(vec![from.0, to.0])
        .y(vec![from.1, to.1])
        .mode(Mode::Lines)
        .line(Stroke::new().color(color).width(width).dash(dash))
        .hover_info(HoverInfo::Skip)
        .show_legend(false);
    Ok(serde_json::to_value(scatter)?)
}

fn virtual_mark(at: (f64, f64)) -> Result<Value, ReportError> {
    let marker = Marker::new().size(20).symbol(MarkerSymbol::Star).color(palette::INK).opacity(1.0);
    let scatter = Scatter::<f64, f64>::default()
        .x(vec![at.0])
        .y(vec![at.1])
        .text_array(vec!["virtual leader 0<br>holds the references"])
        .mode(Mode::Markers)
        .marker(marker)
        .hover_info(HoverInfo::Text)
        .show_legend(false);
    Ok(serde_json::to_value(scatter)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph() -> GraphFigure {
        let node = |x: f64, group| Node { name: format!("<{x}>"), x, y: 0.0, group, is_leader: x == 0.0 };
        GraphFigure {
            title: "a3".to_owned(),
            nodes: vec![node(0.0, 0), node(1.0, 0), node(3.0, 1)],
            edges: vec![Edge { a: 0, b: 1, weight: 1.0 }, Edge { a: 1, b: 2, weight: 0.5 }],
            pins: vec![0],
            note: String::new(),
        }
    }

    #[test]
    fn every_pin_edge_and_agent_is_drawn_and_each_cluster_shaded() {
        let json = graph().to_json().unwrap();
        let traces = json["data"].as_array().unwrap();
        let lines = traces.iter().filter(|t| t["mode"] == "lines").count();
        assert_eq!(lines, 3);
        let marks: usize = traces
            .iter()
            .filter(|t| t["marker"]["opacity"] == 1.0)
            .map(|t| t["x"].as_array().unwrap().len())
            .sum();
        assert_eq!(marks, 4);
        assert_eq!(json["layout"]["shapes"].as_array().unwrap().len(), 2);
        assert!(!json["layout"].to_string().contains("<0>"));
    }

    #[test]
    fn an_edge_to_nowhere_is_refused_by_name() {
        let mut g = graph();
        g.edges[1].b = 7;
        let message = g.to_json().unwrap_err().to_string();
        assert_eq!(message, "graph `a3`: edge 1 names node 7 (counted from 0), but there are 3 nodes");
        let mut g = graph();
        g.nodes[2].y = f64::NAN;
        assert!(g.to_json().unwrap_err().to_string().contains("position of node 2 `<3>`"));
    }
}

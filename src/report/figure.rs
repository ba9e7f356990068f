//! Lines over a common axis, as the data and layout that Plotly draws.

use super::decimate::{decimate, decimate_shared, pick};
use super::error::ReportError;
use super::{escape, events, palette};
use plotly::common::{Anchor, DashType, ExponentFormat, Font, Line as Stroke, Mode, Title};
use plotly::layout::{Axis, AxisType, DragMode, HoverMode, ItemClick, Layout, Legend, Margin};
use plotly::{Scatter, common::Label};
use serde_json::{Map, Value};
use std::sync::Arc;

/// Lines over a common axis, often time.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Shown above the figure.
    pub title: String,
    /// Below the figure, with its unit: "t (s)".
    pub x_label: String,
    /// Left of the figure, with its unit: "P (pu)".
    pub y_label: String,
    /// Logarithmic axis; values that are not positive become gaps.
    pub log_y: bool,
    /// In the order of the legend.
    pub lines: Vec<Line>,
    /// Thin vertical lines: position on the x axis and a short label.
    pub events: Vec<(f64, String)>,
    /// Small print below; may be empty.
    pub note: String,
}

/// A line of a figure.
#[derive(Clone, Debug)]
pub struct Line {
    /// Name in the legend and beside the values.
    pub name: String,
    /// Abscissae, ascending; lines that share them are read off together.
    pub x: Arc<[f64]>,
    /// As many ordinates; what is not finite becomes a gap.
    pub y: Vec<f64>,
    /// Index of the BESS, counted from 0, which fixes the colour; none for neutral grey.
    pub color: Option<usize>,
    /// How the line is broken.
    pub dash: Dash,
}

/// How a line is broken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dash {
    /// Unbroken.
    #[default]
    Solid,
    /// Dashes.
    Dash,
    /// Dots.
    Dot,
    /// Dashes and dots in turn.
    DashDot,
}

/// Points kept per line, about two per pixel, and per figure, so that the page stays light however many
/// lines there are.
const MAX_POINTS_LINE: usize = 2000;
const MAX_POINTS_FIGURE: usize = 60_000;
/// Height of the area between the axes, and of what is below and at least above it, px.
const PLOT_HEIGHT: usize = 236;
const BELOW: usize = 44;
const ABOVE: usize = 12;
/// Above this number of lines one box with all values would hide the figure.
const MAX_LINES_READ_TOGETHER: usize = 14;

pub(super) const FONT: &str =
    "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', Arial, sans-serif";

impl Figure {
    /// What the page's script draws: `data` and `layout` as Plotly wants them, and once for all lines
    /// the abscissae `x` where they share them.
    pub(super) fn to_json(&self) -> Result<Map<String, Value>, ReportError> {
        self.check()?;
        let budget = (MAX_POINTS_FIGURE / self.lines.len().max(1)).clamp(50, MAX_POINTS_LINE);
        let mut object = Map::new();
        let mut data = Vec::with_capacity(self.lines.len());
        let drawn: Vec<Vec<f64>> = self.lines.iter().map(|line| self.drawn(line)).collect();
        if let Some(x) = self.shared_x() {
            let views: Vec<&[f64]> = drawn.iter().map(Vec::as_slice).collect();
            let kept = decimate_shared(x.len(), &views, budget);
            object.insert("x".to_owned(), serde_json::to_value(pick(x, &kept))?);
            for (line, y) in self.lines.iter().zip(&drawn) {
                data.push(trace(line, None, pick(y, &kept))?);
            }
        } else {
            for (line, y) in self.lines.iter().zip(&drawn) {
                let (x, y) = decimate(&line.x, y, budget);
                data.push(trace(line, Some(x), y)?);
            }
        }
        object.insert("data".to_owned(), Value::Array(data));
        let mut layout = serde_json::to_value(self.layout())?;
        for shape in layout.get_mut("shapes").and_then(Value::as_array_mut).into_iter().flatten() {
            // Event lines over the grid and under the lines: Plotly knows this layer, its Rust types do not.
            shape["layer"] = Value::String("between".to_owned());
        }
        object.insert("layout".to_owned(), layout);
        Ok(object)
    }

    /// Height of the whole figure, px.
    pub(super) fn height(&self) -> usize {
        PLOT_HEIGHT + BELOW + self.above()
    }

    fn above(&self) -> usize {
        ABOVE + events::ROW_HEIGHT * events::rows(&self.placed_events()).max(1)
    }

    fn check(&self) -> Result<(), ReportError> {
        for line in &self.lines {
            if line.x.len() != line.y.len() {
                return Err(ReportError::Length {
                    place: format!("figure `{}`, line `{}`", self.title, line.name),
                    found: line.y.len(),
                    expected: line.x.len(),
                    reason: "one per abscissa",
                });
            }
        }
        Ok(())
    }

    /// The ordinates with gaps for what the axis cannot show.
    fn drawn(&self, line: &Line) -> Vec<f64> {
        let shown = |v: f64| v.is_finite() && (!self.log_y || v > 0.0);
        line.y.iter().map(|&v| if shown(v) { v } else { f64::NAN }).collect()
    }

    fn shared_x(&self) -> Option<&[f64]> {
        let first = &self.lines.first()?.x;
        let same = |line: &Line| Arc::ptr_eq(first, &line.x) || *first == line.x;
        self.lines.iter().all(same).then_some(first)
    }

    fn placed_events(&self) -> Vec<events::Placed> {
        let finite = || self.lines.iter().flat_map(|line| line.x.iter().copied()).filter(|x| x.is_finite());
        let low = finite().fold(f64::INFINITY, f64::min);
        let high = finite().fold(f64::NEG_INFINITY, f64::max);
        events::place(&self.events, low, high)
    }

    fn layout(&self) -> Layout {
        let placed = self.placed_events();
        let together = self.lines.len() <= MAX_LINES_READ_TOGETHER;
        let mut y_axis = axis(&self.y_label).hover_format(if self.log_y { ".2e" } else { ".7g" });
        if self.log_y {
            y_axis = y_axis.type_(AxisType::Log);
        }
        Layout::new()
            .auto_size(true)
            .height(self.height())
            .margin(Margin::new().left(84).right(116).top(self.above()).bottom(BELOW))
            .font(Font::new().family(FONT).size(12).color(palette::INK))
            .paper_background_color("#ffffff")
            .plot_background_color("#ffffff")
            .hover_mode(if together { HoverMode::XUnified } else { HoverMode::Closest })
            .hover_distance(40)
            .hover_label(
                Label::new()
                    .background_color("rgba(255,255,255,0.92)")
                    .border_color(palette::AXIS)
                    .name_length(28)
                    .font(Font::new().family(FONT).size(12).color(palette::INK)),
            )
            .drag_mode(DragMode::Zoom)
            .show_legend(true)
            .legend(legend())
            .x_axis(axis(&self.x_label).hover_format(".6~g"))
            .y_axis(y_axis)
            .shapes(placed.iter().map(|event| events::line(event, PLOT_HEIGHT as f64)).collect())
            .annotations(placed.iter().filter_map(events::label).collect())
    }
}

/// Beside the plot; a click hides an entry, a double click all others.
pub(super) fn legend() -> Legend {
    Legend::new()
        .x(1.01)
        .x_anchor(Anchor::Left)
        .y(1.0)
        .y_anchor(Anchor::Top)
        .item_click(ItemClick::Toggle)
        .item_double_click(ItemClick::ToggleOthers)
        .font(Font::new().size(12).color(palette::INK))
}

fn axis(label: &str) -> Axis {
    Axis::new()
        .title(Title::with_text(escape::html(label)).font(Font::new().size(12).color(palette::INK_SOFT)))
        .auto_margin(true)
        .show_line(true)
        .line_color(palette::AXIS)
        .line_width(1)
        .grid_color(palette::GRID)
        .zero_line(false)
        .exponent_format(ExponentFormat::SmallE)
        .tick_font(Font::new().size(12).color(palette::INK_SOFT))
}

fn trace(line: &Line, x: Option<Vec<f64>>, y: Vec<f64>) -> Result<Value, ReportError> {
    let dash = match line.dash {
        Dash::Solid => DashType::Solid,
        Dash::Dash => DashType::Dash,
        Dash::Dot => DashType::Dot,
        Dash::DashDot => DashType::DashDot,
    };
    let color = line.color.map_or(palette::NEUTRAL, palette::color_of);
    let mut scatter = Scatter::<f64, f64>::default()
        .y(y)
        .name(escape::short_label(&line.name, 28))
        .mode(Mode::Lines)
        .connect_gaps(false)
        .line(Stroke::new().color(color).width(1.6).dash(dash));
    if let Some(x) = x {
        scatter = scatter.x(x);
    }
    Ok(serde_json::to_value(scatter)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(lines: Vec<Line>) -> Figure {
        Figure { title: "P".to_owned(), lines, ..Figure::default() }
    }

    fn line(x: &Arc<[f64]>, y: Vec<f64>) -> Line {
        Line { name: "BESS 1".to_owned(), x: x.clone(), y, color: Some(0), dash: Dash::Solid }
    }

    #[test]
    fn gaps_are_null_and_a_log_axis_makes_more_of_them() {
        let x: Arc<[f64]> = vec![0.0, 1.0, 2.0, 3.0].into();
        let mut f = figure(vec![line(&x, vec![1.0, f64::NAN, -1.0, f64::INFINITY])]);
        let y = |f: &Figure| f.to_json().unwrap()["data"][0]["y"].to_string();
        assert_eq!(y(&f), "[1.0,null,-1.0,null]");
        f.log_y = true;
        assert_eq!(y(&f), "[1.0,null,null,null]");
    }

    #[test]
    fn a_common_axis_is_written_once_and_others_apart() {
        let x: Arc<[f64]> = vec![0.0, 1.0].into();
        let shared = figure(vec![line(&x, vec![1.0, 2.0]), line(&x, vec![3.0, 4.0])]).to_json().unwrap();
        assert_eq!(shared["x"].to_string(), "[0.0,1.0]");
        assert!(shared["data"][1].get("x").is_none());
        let other: Arc<[f64]> = vec![5.0].into();
        let apart = figure(vec![line(&x, vec![1.0, 2.0]), line(&other, vec![3.0])]).to_json().unwrap();
        assert!(apart.get("x").is_none());
        assert_eq!(apart["data"][1]["x"].to_string(), "[5.0]");
    }

    #[test]
    fn lengths_must_agree() {
        let x: Arc<[f64]> = vec![0.0, 1.0].into();
        let message = figure(vec![line(&x, vec![1.0])]).to_json().unwrap_err().to_string();
        assert_eq!(message, "figure `P`, line `BESS 1`: found 1 values, expected 2 (one per abscissa)");
    }
}

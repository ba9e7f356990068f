//! Events as thin vertical lines with labels above the figure, in as many rows as keep the labels apart.

use super::{escape, palette};
use plotly::common::{Anchor, DashType, Font};
use plotly::layout::{Annotation, Shape, ShapeLine, ShapeType};

/// Height of a row of labels, px.
pub(super) const ROW_HEIGHT: usize = 15;
/// Labels beyond these rows are left out; their lines stay.
const MAX_ROWS: usize = 3;
/// Longer labels are cut and shown whole when pointed at.
const MAX_CHARS: usize = 30;
/// The plot area of a window 800 px wide, and the mean width of a character of the labels: labels that
/// keep apart here do so in every wider window.
const PLOT_WIDTH: f64 = 540.0;
const CHAR_WIDTH: f64 = 6.2;

/// An event with a place for its label.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Placed {
    pub x: f64,
    pub label: String,
    /// Row of the label, from the plot upwards; none where all rows are full.
    pub row: Option<usize>,
    /// The label lies to the left of its line, because it would leave the plot on the right.
    pub leftward: bool,
}

/// Places the labels of the events between `low` and `high`; events at one instant share a label.
pub(super) fn place(events: &[(f64, String)], low: f64, high: f64) -> Vec<Placed> {
    let mut inside: Vec<&(f64, String)> = events.iter().filter(|(x, _)| *x >= low && *x <= high).collect();
    inside.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut placed: Vec<Placed> = Vec::with_capacity(inside.len());
    for (x, label) in inside {
        match placed.last_mut() {
            Some(last) if last.x == *x => {
                last.label.push_str(", ");
                last.label.push_str(label);
            }
            _ => placed.push(Placed { x: *x, label: label.clone(), row: None, leftward: false }),
        }
    }
    let scale = if high > low { PLOT_WIDTH / (high - low) } else { 0.0 };
    // From the right, because labels stand to the right of their lines: the line of a later event must end
    // below the label of an earlier one that reaches over it.
    let mut labelled: Vec<(f64, (f64, f64), usize)> = Vec::with_capacity(placed.len());
    for event in placed.iter_mut().rev() {
        let width = (event.label.chars().count().min(MAX_CHARS) as f64 + 2.0) * CHAR_WIDTH;
        let at = (event.x - low) * scale;
        event.leftward = at + width > PLOT_WIDTH && at > width;
        let span = if event.leftward { (at - width, at) } else { (at, at + width) };
        let over = labelled.iter().filter(|(line, _, _)| *line >= span.0 && *line <= span.1);
        let lowest = over.map(|(_, _, row)| row + 1).max().unwrap_or(0);
        let free = |row: &usize| labelled.iter().all(|(_, s, r)| r != row || span.0 >= s.1 || span.1 <= s.0);
        if let Some(row) = (lowest..MAX_ROWS).find(free) {
            labelled.push((at, span, row));
            event.row = Some(row);
        }
    }
    placed
}

/// Rows of labels in use.
pub(super) fn rows(placed: &[Placed]) -> usize {
    placed.iter().filter_map(|event| event.row).max().map_or(0, |row| row + 1)
}

/// The vertical line of an event, from the plot's foot up to its label.
pub(super) fn line(event: &Placed, plot_height: f64) -> Shape {
    let top = event.row.map_or(1.0, |row| 1.0 + ((row * ROW_HEIGHT) as f64 + 9.0) / plot_height);
    Shape::new()
        .shape_type(ShapeType::Line)
        .x_ref("x")
        .y_ref("paper")
        .x0(event.x)
        .x1(event.x)
        .y0(0.0)
        .y1(top)
        .line(ShapeLine::new().color(palette::EVENT).width(1.0).dash(DashType::Solid))
}

/// The label of an event beside the upper end of its line.
pub(super) fn label(event: &Placed) -> Option<Annotation> {
    let row = event.row?;
    let annotation = Annotation::new()
        .text(escape::short_label(&event.label, MAX_CHARS))
        .show_arrow(false)
        .x_ref("x")
        .y_ref("paper")
        .x(event.x)
        .y(1.0)
        .x_anchor(if event.leftward { Anchor::Right } else { Anchor::Left })
        .y_anchor(Anchor::Bottom)
        .x_shift(if event.leftward { -1.0 } else { 1.0 })
        .y_shift((row * ROW_HEIGHT) as f64 - 1.0)
        .font(Font::new().size(11).color(palette::INK_SOFT));
    let cut = event.label.chars().count() > MAX_CHARS;
    Some(if cut { annotation.hover_text(escape::html(&event.label)) } else { annotation })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(x: f64, label: &str) -> (f64, String) {
        (x, label.to_owned())
    }

    #[test]
    fn near_labels_go_to_different_rows_and_far_ones_share_one() {
        let placed = place(
            &[event(50.0, "load -0.5"), event(52.0, "load +1.0"), event(5.0, "controller on")],
            0.0,
            120.0,
        );
        let seen: Vec<_> = placed.iter().map(|e| (e.x, e.row)).collect();
        assert_eq!(seen, [(5.0, Some(0)), (50.0, Some(1)), (52.0, Some(0))]);
    }

    #[test]
    fn one_instant_has_one_label_and_outside_has_none() {
        let placed = place(&[event(20.0, "b3"), event(200.0, "late"), event(20.0, "tie")], 0.0, 100.0);
        assert_eq!(placed.len(), 1);
        assert_eq!(placed[0].label, "b3, tie");
    }

    #[test]
    fn the_last_label_turns_inwards_and_a_crowd_keeps_its_lines() {
        let placed = place(&[event(118.0, "load step")], 0.0, 120.0);
        assert!(placed[0].leftward);
        let crowd: Vec<_> = (0..9).map(|k| event(10.0 + 0.1 * f64::from(k), "same place")).collect();
        let placed = place(&crowd, 0.0, 120.0);
        assert_eq!(placed.len(), 9);
        assert_eq!(placed.iter().filter(|e| e.row.is_some()).count(), MAX_ROWS);
    }
}

//! Names and weights in the drawing of a graph, each where it hides least.

use super::graph::{Frame, GraphFigure, HEIGHT};
use super::{escape, palette};
use plotly::common::{Anchor, Font};
use plotly::layout::Annotation;

/// With more, labels would hide the drawing; pointing at an agent or at the middle of an edge tells.
const MAX_WEIGHT_LABELS: usize = 30;
const MAX_NAME_LABELS: usize = 60;
const MAX_NAME_CHARS: usize = 24;

/// The drawing in a window 800 px wide, and the size of its text: what keeps apart here does so in every
/// wider window.
const WIDTH: f64 = 750.0;
const CHAR_WIDTH: f64 = 6.9;
const LINE_HEIGHT: f64 = 17.0;
/// From the middle of a mark to a name beside it and to the middle of a name above or below it, px.
const BESIDE: f64 = 13.0;
const APART: f64 = 21.0;

/// Texts (weights, lengths) in the middle of the edges, one each; names beside the agents.
pub(super) fn labels(
    graph: &GraphFigure,
    texts: &[String],
    leader: Option<(f64, f64)>,
    range: Frame,
) -> Vec<Annotation> {
    let mut labels = Vec::new();
    let pixels = Pixels::of(range);
    let mut taken = Vec::new();
    let ends = |a: usize, b: usize| Some((graph.at(a)?, graph.at(b)?));
    for (from, to) in graph.edges.iter().filter_map(|edge| ends(edge.a, edge.b)) {
        taken.extend(along(pixels.at(from), pixels.at(to)));
    }
    for (from, to) in graph.pins.iter().filter_map(|&pin| leader.zip(graph.at(pin))) {
        taken.extend(along(pixels.at(from), pixels.at(to)));
    }
    if graph.edges.len() <= MAX_WEIGHT_LABELS {
        for (edge, text) in graph.edges.iter().zip(texts) {
            if let Some((a, b)) = ends(edge.a, edge.b) {
                let middle = ((a.0 + b.0) / 2.0, (a.1 + b.1) / 2.0);
                taken.push(Area::around(
                    pixels.at(middle),
                    text.chars().count() as f64 * CHAR_WIDTH,
                    LINE_HEIGHT,
                    4.0,
                ));
                labels.push(label(middle, text, palette::INK_SOFT, 11));
            }
        }
    }
    if graph.nodes.len() <= MAX_NAME_LABELS {
        taken.extend(
            graph.nodes.iter().map(|node| Area::around(pixels.at((node.x, node.y)), 22.0, 22.0, 4.0)),
        );
        for node in &graph.nodes {
            let width = node.name.chars().count().min(MAX_NAME_CHARS) as f64 * CHAR_WIDTH;
            let at = pixels.at((node.x, node.y));
            let place = clearest(at, width, &taken, &pixels);
            taken.push(place.area(at, width));
            let text = escape::short_label(&node.name, MAX_NAME_CHARS);
            labels.push(place.move_label(label((node.x, node.y), &text, palette::INK, 12)));
        }
    }
    labels.extend(leader.map(|at| PLACES[1].move_label(label(at, "virtual leader 0", palette::INK, 12))));
    labels
}

/// From positions to px, y upwards.
struct Pixels {
    scale: f64,
    left: f64,
    right: f64,
}

impl Pixels {
    fn of(range: Frame) -> Self {
        let (wide, high) = (range.x.1 - range.x.0, range.y.1 - range.y.0);
        let scale = (WIDTH / wide).min(HEIGHT as f64 / high);
        let middle = scale * (range.x.0 + range.x.1) / 2.0;
        Self { scale, left: middle - WIDTH / 2.0, right: middle + WIDTH / 2.0 }
    }

    fn at(&self, position: (f64, f64)) -> (f64, f64) {
        (self.scale * position.0, self.scale * position.1)
    }
}

/// A rectangle in px, and how bad it is to cover it.
#[derive(Clone, Copy)]
struct Area {
    x: (f64, f64),
    y: (f64, f64),
    weight: f64,
}

impl Area {
    fn around(at: (f64, f64), width: f64, height: f64, weight: f64) -> Self {
        let (w, h) = (width / 2.0, height / 2.0);
        Self { x: (at.0 - w, at.0 + w), y: (at.1 - h, at.1 + h), weight }
    }

    fn covered_by(&self, other: &Area) -> f64 {
        let common = |a: (f64, f64), b: (f64, f64)| (a.1.min(b.1) - a.0.max(b.0)).max(0.0);
        self.weight * common(self.x, other.x) * common(self.y, other.y)
    }
}

/// Small areas along a stroke.
fn along(from: (f64, f64), to: (f64, f64)) -> impl Iterator<Item = Area> {
    let step = 6.0;
    let count = ((to.0 - from.0).hypot(to.1 - from.1) / step).clamp(1.0, 500.0) as usize;
    (0..=count).map(move |k| {
        let s = k as f64 / count as f64;
        Area::around((from.0 + s * (to.0 - from.0), from.1 + s * (to.1 - from.1)), step, step, 1.0)
    })
}

/// A place for a name: to the left, above or below, or to the right (-1, 0, 1), and how far up, px.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    side: i8,
    up: f64,
}

/// The better ones first: they win where several are equally clear.
const PLACES: [Place; 8] = [
    Place { side: 0, up: -APART },
    Place { side: 0, up: APART },
    Place { side: 1, up: 0.0 },
    Place { side: -1, up: 0.0 },
    Place { side: 1, up: -APART },
    Place { side: -1, up: -APART },
    Place { side: 1, up: APART },
    Place { side: -1, up: APART },
];

impl Place {
    /// How far from the middle of the mark the name begins; nearer where it stands above or below.
    fn gap(self) -> f64 {
        if self.up == 0.0 { BESIDE } else { -BESIDE / 2.0 }
    }

    fn area(self, mark: (f64, f64), width: f64) -> Area {
        let across = f64::from(self.side) * (self.gap() + width / 2.0);
        Area::around((mark.0 + across, mark.1 + self.up), width, LINE_HEIGHT, 4.0)
    }

    fn move_label(self, label: Annotation) -> Annotation {
        let label = label.y_shift(self.up).x_shift(f64::from(self.side) * self.gap());
        match self.side {
            1 => label.x_anchor(Anchor::Left),
            -1 => label.x_anchor(Anchor::Right),
            _ => label,
        }
    }
}

/// The place where a name covers least and stays within the drawing.
fn clearest(mark: (f64, f64), width: f64, taken: &[Area], pixels: &Pixels) -> Place {
    let cost = |place: &Place| {
        let area = place.area(mark, width);
        let outside = (pixels.left - area.x.0).max(0.0) + (area.x.1 - pixels.right).max(0.0);
        taken.iter().map(|t| t.covered_by(&area)).sum::<f64>() + outside * LINE_HEIGHT * 4.0
    };
    let mut best = (PLACES[0], cost(&PLACES[0]));
    for place in &PLACES[1..] {
        let here = cost(place);
        if here < best.1 {
            best = (*place, here);
        }
    }
    best.0
}

fn label(at: (f64, f64), text: &str, color: &'static str, size: usize) -> Annotation {
    Annotation::new()
        .text(text)
        .show_arrow(false)
        .x(at.0)
        .y(at.1)
        .x_anchor(Anchor::Center)
        .y_anchor(Anchor::Middle)
        .border_pad(1.0)
        .background_color("rgba(255,255,255,0.85)")
        .font(Font::new().size(size).color(color))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: Pixels = Pixels { scale: 1.0, left: -400.0, right: 400.0 };

    #[test]
    fn a_name_keeps_clear_of_strokes_and_of_other_labels() {
        let mark = (0.0, 0.0);
        let down: Vec<Area> = along(mark, (0.0, -100.0)).collect();
        assert_eq!(clearest(mark, 80.0, &[], &PAGE), PLACES[0]);
        assert_eq!(clearest(mark, 80.0, &down, &PAGE), PLACES[1]);
        let mut more = down.clone();
        more.extend(along(mark, (0.0, 100.0)));
        assert_eq!(clearest(mark, 80.0, &more, &PAGE), PLACES[2]);
        more.push(Area::around((60.0, 0.0), 20.0, 17.0, 4.0));
        assert_eq!(clearest(mark, 80.0, &more, &PAGE), PLACES[3]);
    }

    #[test]
    fn a_name_stays_within_the_drawing() {
        let mark = (395.0, 0.0);
        assert_eq!(clearest(mark, 80.0, &[], &PAGE), PLACES[3]);
    }
}

//! One colour and dash per BESS, the same in every figure: Okabe and Ito's palette, which people with
//! any colour vision tell apart (Okabe, Ito 2008, "Color universal design"), without its yellow, which
//! is too pale for a line on white.

use super::figure::Dash;

/// Blue first: black is kept for the last, since it draws the eye most.
const COLORS: [&str; 7] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"];

/// For what is not a BESS: references, ranges.
pub(super) const NEUTRAL: &str = "#6b7280";
/// Text and axes.
pub(super) const INK: &str = "#1f2937";
/// Ticks, notes.
pub(super) const INK_SOFT: &str = "#4b5563";
/// Grid lines.
pub(super) const GRID: &str = "#e5e7eb";
/// Axes.
pub(super) const AXIS: &str = "#9ca3af";
/// Event lines.
pub(super) const EVENT: &str = "#6b7280";

/// Colour of the BESS with this index, counted from 0, as `#rrggbb`.
pub fn color_of(index: usize) -> &'static str {
    COLORS.get(index % COLORS.len()).copied().unwrap_or(NEUTRAL)
}

/// Dash of the BESS with this index, counted from 0: solid for the first seven, then one more kind for
/// each seven, so that 28 differ.
pub fn dash_of(index: usize) -> Dash {
    match (index / COLORS.len()) % 4 {
        0 => Dash::Solid,
        1 => Dash::Dash,
        2 => Dash::Dot,
        _ => Dash::DashDot,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn twenty_eight_lines_differ() {
        let looks: BTreeSet<String> = (0..28).map(|i| format!("{} {:?}", color_of(i), dash_of(i))).collect();
        assert_eq!(looks.len(), 28);
    }

    /// Contrast ratio against white after WCAG 2.1; graphics want at least 2, text 4.5.
    fn contrast_on_white(color: &str) -> f64 {
        let channel = |k: usize| {
            let v = f64::from(u8::from_str_radix(&color[k..k + 2], 16).unwrap()) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        1.05 / (0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5) + 0.05)
    }

    #[test]
    fn lines_and_text_stand_out_on_white() {
        for i in 0..COLORS.len() {
            assert!(contrast_on_white(color_of(i)) > 2.0, "{}", color_of(i));
        }
        assert!(contrast_on_white(INK) > 4.5 && contrast_on_white(INK_SOFT) > 4.5);
    }
}

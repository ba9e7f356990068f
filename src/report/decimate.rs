//! Fewer points that look the same: per bin the smallest and the largest sample stay, so that no spike
//! vanishes. Never invents or moves a sample.

/// Picks at most `max_points` samples of a line, in order: the first, the last, and from each of
/// equally long bins the smallest, the largest and, where there is one, a gap (a value that is not
/// finite). All are kept where they already fit.
///
/// `x` and `y` count as far as both go. At least one bin is made, so up to 5 samples stay however small
/// `max_points` is.
pub fn decimate(x: &[f64], y: &[f64], max_points: usize) -> (Vec<f64>, Vec<f64>) {
    let samples = x.len().min(y.len());
    let kept = decimate_shared(samples, &[y], max_points);
    (pick(x, &kept), pick(y, &kept))
}

/// The indices that [`decimate`] would keep, chosen for several lines over one axis of `samples` values
/// at once: each line keeps its extremes in every bin, and all lines share their abscissae, so that a
/// reader sees them side by side. The number of bins is halved until at most `max_points` are left; one
/// bin is the least, with at most `2 + 3 * lines.len()` indices.
pub fn decimate_shared(samples: usize, lines: &[&[f64]], max_points: usize) -> Vec<usize> {
    if samples <= max_points {
        return (0..samples).collect();
    }
    let mut bins = (samples / 2).max(1);
    loop {
        let kept = extremes(samples, lines, bins);
        if kept.len() <= max_points || bins == 1 {
            return kept;
        }
        bins /= 2;
    }
}

/// The values at these indices; an index beyond the end gives a gap.
pub(super) fn pick(values: &[f64], indices: &[usize]) -> Vec<f64> {
    indices.iter().map(|&k| values.get(k).copied().unwrap_or(f64::NAN)).collect()
}

fn extremes(samples: usize, lines: &[&[f64]], bins: usize) -> Vec<usize> {
    let mut kept = vec![0, samples - 1];
    for bin in 0..bins {
        let (begin, end) = (edge(samples, bins, bin), edge(samples, bins, bin + 1));
        for line in lines {
            let (mut low, mut high, mut gap) = (None, None, None);
            for k in begin..end {
                let value = line.get(k).copied().unwrap_or(f64::NAN);
                if !value.is_finite() {
                    gap = gap.or(Some(k));
                    continue;
                }
                if low.is_none_or(|(v, _)| value < v) {
                    low = Some((value, k));
                }
                if high.is_none_or(|(v, _)| value > v) {
                    high = Some((value, k));
                }
            }
            kept.extend(low.map(|(_, k)| k));
            kept.extend(high.map(|(_, k)| k));
            kept.extend(gap);
        }
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

/// Where a bin begins; in 128 bits, because the product of two lengths need not fit in 64.
fn edge(samples: usize, bins: usize, bin: usize) -> usize {
    (samples as u128 * bin as u128 / bins as u128) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn finite_extremes(y: &[f64]) -> Option<(f64, f64)> {
        y.iter()
            .copied()
            .filter(|v| v.is_finite())
            .map(|v| (v, v))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    fn any_sample() -> impl Strategy<Value = f64> {
        prop_oneof![20 => -1e3..1e3, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY)]
    }

    proptest! {
        #[test]
        fn extremes_ends_and_order_stay(
            y in prop::collection::vec(any_sample(), 1..600),
            max_points in 0_usize..300,
        ) {
            let x: Vec<f64> = (0..y.len()).map(|k| k as f64 * 0.01).collect();
            let (dx, dy) = decimate(&x, &y, max_points);
            prop_assert!(dx.len() == dy.len() && dx.len() <= max_points.max(5));
            prop_assert_eq!(finite_extremes(&dy), finite_extremes(&y));
            prop_assert!(dx.windows(2).all(|w| w[0] < w[1]));
            prop_assert_eq!((dx[0], *dx.last().unwrap()), (x[0], *x.last().unwrap()));
            // Every point is a sample, gaps included.
            for (a, b) in dx.iter().zip(&dy) {
                let k = (a / 0.01).round() as usize;
                prop_assert!(y[k].to_bits() == b.to_bits());
            }
            prop_assert_eq!(dy.iter().any(|v| !v.is_finite()), y.iter().any(|v| !v.is_finite()));
        }

        #[test]
        fn lines_over_one_axis_each_keep_their_extremes(
            a in prop::collection::vec(any_sample(), 300),
            b in prop::collection::vec(any_sample(), 300),
            max_points in 8_usize..250,
        ) {
            let kept = decimate_shared(300, &[&a, &b], max_points);
            prop_assert!(kept.len() <= max_points);
            for line in [&a, &b] {
                prop_assert_eq!(finite_extremes(&pick(line, &kept)), finite_extremes(line));
            }
        }
    }

    #[test]
    fn one_spike_in_a_million_is_kept_at_its_place() {
        let x: Vec<f64> = (0..1_000_000).map(f64::from).collect();
        let mut y = vec![1.0; x.len()];
        y[654_321] = 1.0 + 1e-12;
        let (dx, dy) = decimate(&x, &y, 1000);
        assert!(dx.len() <= 1000);
        let at = dy.iter().position(|&v| v > 1.0).unwrap();
        assert_eq!(dx[at], 654_321.0);
    }

    #[test]
    fn what_fits_is_untouched_and_nothing_gives_nothing() {
        let (x, y) = (vec![0.0, 1.0, 2.0], vec![3.0, 4.0, 5.0]);
        assert_eq!(decimate(&x, &y, 3), (x.clone(), y.clone()));
        assert_eq!(decimate(&x, &[], 3), (vec![], vec![]));
        assert_eq!(decimate(&[], &[], 0), (vec![], vec![]));
    }
}

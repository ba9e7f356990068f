//! A few values side by side, as vector code wants them: out of arrays of at most as many, and back. Knows numbers
//! only.

/// How many.
pub(super) const LANES: usize = 8;
const HALF: usize = LANES / 2;

/// Values side by side; those of nobody are 0.
pub(super) type Lanes = [f64; LANES];

/// The first values, at most as many as there are lanes. By their number, because a copy of a length that nobody
/// knows is a call or goes through memory twice.
#[inline(always)]
pub(super) fn load_few(values: &[f64]) -> Lanes {
    let (first, rest) = match values.split_first_chunk::<HALF>() {
        Some((first, rest)) => (*first, load_half(rest)),
        None => (load_half(values), [0.0; HALF]),
    };
    let mut lanes = [0.0; LANES];
    lanes[..HALF].copy_from_slice(&first);
    lanes[HALF..].copy_from_slice(&rest);
    lanes
}

#[inline(always)]
fn load_half(values: &[f64]) -> [f64; HALF] {
    match *values {
        [] => [0.0; HALF],
        [a] => [a, 0.0, 0.0, 0.0],
        [a, b] => [a, b, 0.0, 0.0],
        [a, b, c] => [a, b, c, 0.0],
        [a, b, c, d, ..] => [a, b, c, d],
    }
}

/// The other way.
#[inline(always)]
pub(super) fn store_few(lanes: &Lanes, values: &mut [f64]) {
    match values.split_first_chunk_mut::<HALF>() {
        Some((first, rest)) => {
            first.copy_from_slice(&lanes[..HALF]);
            store_half(&lanes[HALF..], rest);
        }
        None => store_half(&lanes[..HALF], values),
    }
}

#[inline(always)]
fn store_half(lanes: &[f64], values: &mut [f64]) {
    let &[a, b, c, d] = lanes else { return };
    match values {
        [] => {}
        [x] => *x = a,
        [x, y] => (*x, *y) = (a, b),
        [x, y, z] => (*x, *y, *z) = (a, b, c),
        [x, y, z, w, ..] => (*x, *y, *z, *w) = (a, b, c, d),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_and_out_at_every_length() {
        let values: Vec<f64> = (1..=9).map(f64::from).collect();
        for n in 0..=values.len() {
            let lanes = load_few(&values[..n]);
            let expected = |k: usize| if k < n { values[k] } else { 0.0 };
            assert!((0..LANES).all(|k| lanes[k] == expected(k)), "{n}: {lanes:?}");
            let mut out = vec![-1.0; values.len()];
            store_few(&lanes, &mut out[..n]);
            let expected = |k: usize| if k < n.min(LANES) { values[k] } else { -1.0 };
            assert!((0..out.len()).all(|k| out[k] == expected(k)), "{n}: {out:?}");
        }
    }
}

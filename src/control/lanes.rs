//! A few values side by side, as vector code wants them: out of arrays of at most as many, and back. Knows numbers
//! only.

/// How many.
pub(super) const LANES: usize = 8;
const HALF: usize = LANES / 2;

/// Values side by side. The first half holds the first values, the other one the last: with less than all, those in
/// the middle stand in both, and with less than half of all, 0 stands where there is none.
pub(super) type Lanes = [f64; LANES];

/// Where value `i` of `n` stands, the first time.
pub(super) fn lane(i: usize, n: usize) -> usize {
    if n < HALF || i < HALF { i } else { i + LANES - n }
}

/// Out of an array, two halves at once: a copy of a length that nobody knows would be a call, or go through memory
/// twice.
#[inline(always)]
pub(super) fn load_few(values: &[f64]) -> Lanes {
    let mut lanes = [0.0; LANES];
    if let (Some(first), Some(last)) = (values.first_chunk::<HALF>(), values.last_chunk::<HALF>()) {
        lanes[..HALF].copy_from_slice(first);
        lanes[HALF..].copy_from_slice(last);
    } else {
        for lane in 0..HALF {
            if let Some(&value) = values.get(lane) {
                lanes[lane] = value;
            }
        }
    }
    lanes
}

/// The other way; of what stands twice the first counts.
#[inline(always)]
pub(super) fn store_few(lanes: &Lanes, values: &mut [f64]) {
    let Some(last) = values.last_chunk_mut::<HALF>() else {
        for lane in 0..HALF {
            if let Some(value) = values.get_mut(lane) {
                *value = lanes[lane];
            }
        }
        return;
    };
    last.copy_from_slice(&lanes[HALF..]);
    if let Some(first) = values.first_chunk_mut::<HALF>() {
        first.copy_from_slice(&lanes[..HALF]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_and_out_at_every_length() {
        let values: Vec<f64> = (1..=8).map(f64::from).collect();
        for n in 0..=LANES {
            let mut lanes = load_few(&values[..n]);
            assert!((0..n).all(|i| lanes[lane(i, n)] == values[i]), "{n}: {lanes:?}");
            assert!(n >= HALF || lanes[n..].iter().all(|x| *x == 0.0), "{n}: {lanes:?}");
            // What stands twice may differ in the second place.
            for k in (0..LANES).filter(|&k| (0..n).all(|i| lane(i, n) != k)) {
                lanes[k] = f64::NAN;
            }
            let mut out = [-1.0; LANES];
            store_few(&lanes, &mut out[..n]);
            assert!((0..LANES).all(|i| out[i] == if i < n { values[i] } else { -1.0 }), "{n}: {out:?}");
        }
    }
}

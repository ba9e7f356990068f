//! The flows of a block of edges along diagonals, where all edges of one distance are taken side by side: every
//! agent fetches what flows to it from its own block, and only what leaves the block is handed on. Knows where
//! flows go, not what makes them.

use super::diagnosis::CHUNK;
use super::kernels;
use std::ops::Range;

/// Between the flows of two diagonals: as many zeros as agents, which stand for what flows from outside the block, and
/// then the flows.
pub const STRIDE: usize = 2 * CHUNK;

/// Where the flow along the k-th diagonal from the agent in this row of the block stands.
#[inline(always)]
pub fn place(k: usize, row: usize) -> usize {
    k * STRIDE + CHUNK + row
}

/// Where those of a block of `rows` stand.
#[inline(always)]
pub fn places(k: usize, rows: usize) -> Range<usize> {
    place(k, 0)..place(k, rows)
}

/// What flows of the k-th diagonal, `offset` long, to the agents of the block itself.
#[inline(always)]
fn arriving(flows: &[f64], k: usize, offset: u32, rows: usize) -> &[f64] {
    let from = place(k, 0) - (offset as usize).min(CHUNK);
    &flows[from..from + rows]
}

/// Where that which flows beyond the block stands, and where it goes among `sums` of the agents from the first of
/// the block on.
#[inline(always)]
fn leaving(k: usize, offset: u32, rows: usize) -> (Range<usize>, Range<usize>) {
    let offset = offset as usize;
    let first = rows - offset.min(rows);
    (place(k, first)..place(k, rows), first + offset..rows + offset)
}

/// Takes the flows along diagonals from the agents at the lower ends, the first of which is that of `sums`, and adds them
/// to those at the other ends. At each agent this is in the order of the edges: first what comes from lower agents,
/// the lowest, whose diagonal is the farthest, first; then what goes to higher ones. No sum is ever -0, so that
/// a zero more changes nothing.
#[inline(always)]
pub fn give(flows: &[f64], offsets: &[u32], rows: usize, sums: &mut [f64]) {
    match offsets {
        &[a] => give_rows(flows, [a], &mut sums[..rows]),
        &[a, b] => give_rows(flows, [a, b], &mut sums[..rows]),
        &[a, b, c] => give_rows(flows, [a, b, c], &mut sums[..rows]),
        &[a, b, c, d] => give_rows(flows, [a, b, c, d], &mut sums[..rows]),
        many => {
            for (k, &offset) in many.iter().enumerate().rev() {
                kernels::add(&mut sums[..rows], arriving(flows, k, offset, rows));
            }
            for k in 0..many.len() {
                kernels::subtract(&mut sums[..rows], &flows[places(k, rows)]);
            }
        }
    }
    for (k, &offset) in offsets.iter().enumerate().rev() {
        let (from, to) = leaving(k, offset, rows);
        kernels::add(&mut sums[to], &flows[from]);
    }
}

/// The same within the block, for `K` diagonals at once.
#[inline(always)]
fn give_rows<const K: usize>(flows: &[f64], offsets: [u32; K], sums: &mut [f64]) {
    let rows = sums.len();
    let arriving: [&[f64]; K] = std::array::from_fn(|k| arriving(flows, k, offsets[k], rows));
    let going: [&[f64]; K] = std::array::from_fn(|k| &flows[places(k, rows)]);
    for r in 0..rows {
        let mut sum = sums[r];
        for k in (0..K).rev() {
            sum += arriving[k][r];
        }
        for k in 0..K {
            sum -= going[k][r];
        }
        sums[r] = sum;
    }
}

/// Raises `most` of the agents at both ends of diagonals to these values, none of which is below 0.
#[inline(always)]
pub fn raise(values: &[f64], offsets: &[u32], rows: usize, most: &mut [f64]) {
    for (k, &offset) in offsets.iter().enumerate() {
        kernels::raise(&mut most[..rows], (arriving(values, k, offset, rows), &values[places(k, rows)]));
        let (from, to) = leaving(k, offset, rows);
        kernels::raise(&mut most[to], (&values[from.clone()], &values[from]));
    }
}

/// The exchange of a block without a gap in its diagonals, row by row and positive from the lower end.
#[inline(always)]
pub fn remember(flows: &[f64], diagonals: usize, last: &mut [f64]) {
    match diagonals {
        1 => remember_rows::<1>(flows, last),
        2 => remember_rows::<2>(flows, last),
        3 => remember_rows::<3>(flows, last),
        4 => remember_rows::<4>(flows, last),
        many => {
            for (row, last) in last.chunks_exact_mut(many).enumerate() {
                last.iter_mut().enumerate().for_each(|(k, last)| *last = -flows[place(k, row)]);
            }
        }
    }
}

#[inline(always)]
fn remember_rows<const K: usize>(flows: &[f64], last: &mut [f64]) {
    let (last, _) = last.as_chunks_mut::<K>();
    let rows = last.len();
    let flows: [&[f64]; K] = std::array::from_fn(|k| &flows[places(k, rows)]);
    for (r, last) in last.iter_mut().enumerate() {
        for k in 0..K {
            last[k] = -flows[k][r];
        }
    }
}

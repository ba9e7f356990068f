//! Asks the memory for what the next block of a sweep needs while the flows of this one are computed. Processors
//! follow a few streams of memory by themselves, hardly the thirty of a sweep. Changes nothing but times.

use super::blocks::Block;
use super::diagnosis::CHUNK;
use super::lag::LONGEST;
use super::state::State;
use std::ops::Range;

/// Agents whose numbers stay in the caches; asking for what is there costs more than it gives.
const NEAR: usize = 32_768;

/// What comes after a block.
pub struct Ahead {
    /// Agents to be measured next, and to be finished next; nobody where all is near.
    measure: Range<usize>,
    finish: Range<usize>,
}

impl Ahead {
    /// Of a block with these diagonals, `n` agents in all.
    #[inline(always)]
    pub fn of(block: &Block, offsets: &[u32], n: usize) -> Self {
        if n <= NEAR {
            return Self { measure: 0..0, finish: 0..0 };
        }
        let end = block.first + block.rows;
        let top = end + offsets.last().map_or(0, |&d| d as usize);
        Self { measure: top..top + CHUNK, finish: end..end + CHUNK }
    }

    /// Asks for weights and flows, as many as these rows have, which stand as far behind them as the block is long.
    #[inline(always)]
    pub fn ask_edges(&self, block: &Block, rows: &Range<usize>, weights: &[f64], flows: &[f64]) {
        if !self.finish.is_empty() {
            let edges = block.edges.len();
            // Where diagonals have gaps not all rows have as many: too many are asked for rather than too few.
            let diagonals = edges.div_ceil(block.rows.max(1));
            let (from, to) = (rows.start * diagonals, rows.end * diagonals);
            let places = block.weights + edges;
            ask(weights, places + from..places + to);
            ask(flows, block.edges.end + from..block.edges.end + to);
        }
    }

    /// Asks for one of four parts of as many agents as these rows, so that the memory always has something to do,
    /// but not all at once.
    #[inline(always)]
    pub fn ask(&self, part: usize, rows: &Range<usize>, state: &State, (live, peers): (&[bool], &[u32])) {
        if self.finish.is_empty() {
            return;
        }
        let of = |range: &Range<usize>| range.start + rows.start..range.start + rows.end;
        let (measure, finish) = (of(&self.measure), of(&self.finish));
        let State { inputs, parameters, outputs, lags, adopted, .. } = state;
        let numbers: [(&Range<usize>, &[&[f64]]); 2] = match part {
            0 => [
                (&measure, &[&inputs.omega, &inputs.V, &inputs.P, &parameters.K_P, &outputs.P_set]),
                (&finish, &[]),
            ],
            1 => [
                (&measure, &[&inputs.Q, &parameters.K_Q, &outputs.Q_set, &inputs.E, &parameters.capacity]),
                (&finish, &[]),
            ],
            2 => [
                (&measure, &[&parameters.P_exchange_max]),
                (
                    &finish,
                    &[&outputs.u_omega, &outputs.u_P, &outputs.omega_set, &lags.frequency.past[LONGEST]],
                ),
            ],
            _ => [
                (&measure, &[]),
                (
                    &finish,
                    &[&outputs.u_V, &outputs.u_Q, &outputs.u_E, &outputs.V_set, &lags.voltage.past[LONGEST]],
                ),
            ],
        };
        for (range, arrays) in numbers {
            for values in arrays {
                ask(values, range.clone());
            }
        }
        if part == 2 {
            ask(peers, measure.clone());
            for flags in [live, &adopted.available, &outputs.saturated] {
                ask(flags, finish.clone());
            }
        }
    }
}

/// Asks for these values, as far as there are any.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn ask<T>(values: &[T], range: Range<usize>) {
    use pulp::core_arch::x86::Sse;
    /// Bytes that come together.
    const LINE: usize = 64;
    /// Into the cache of second level (_MM_HINT_T1).
    const SECOND: i32 = 2;
    let values = &values[range.start.min(values.len())..range.end.min(values.len())];
    if let Some(sse) = Sse::try_new() {
        for value in values.iter().step_by(LINE / size_of::<T>()) {
            sse._mm_prefetch::<SECOND>(std::ptr::from_ref(value).cast());
        }
    }
}

/// Other processors are on their own.
#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
fn ask<T>(_: &[T], _: Range<usize>) {}

//! The numeric kernel: A = L U row by row on a static, symmetric pattern, pivots taken from the diagonal
//! in the order given (the ordering is chosen for sparsity alone). Row i is scattered into a dense row,
//! the rows above are taken off it in ascending order, and it is gathered into L and U: the "IKJ" form of
//! Gaussian elimination (Y. Saad, "Iterative Methods for Sparse Linear Systems", 2nd ed., algorithm 10.1,
//! on the full pattern of the factors). Never pivots between rows; see [`super::guarded`].

use super::block::Block;

/// Compressed rows of column numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub start: Vec<u32>,
    pub column: Vec<u32>,
}

impl Rows {
    #[inline]
    pub fn range(&self, row: usize) -> std::ops::Range<usize> {
        self.start[row] as usize..self.start[row + 1] as usize
    }
}

/// The pattern of a matrix in elimination order and of its factors.
#[derive(Clone, Debug)]
pub struct Pattern {
    n: usize,
    /// Entries of the matrix, row after row.
    pub(super) matrix: Rows,
    /// Where each of them stands in the values handed in.
    pub(super) source: Vec<u32>,
    /// Below the diagonal, columns ascending.
    pub(super) lower: Rows,
    /// Above the diagonal, columns ascending.
    pub(super) upper: Rows,
}

impl Pattern {
    /// Of an n x n matrix whose value number `k` stands at `entries[k]` (row, column), both counted in
    /// elimination order. No entry may come twice.
    pub fn new(n: usize, entries: &[(u32, u32)]) -> Self {
        let numbered: Vec<(u32, u32, u32)> =
            entries.iter().enumerate().map(|(k, &(row, column))| (row, column, k as u32)).collect();
        Self::with_sources(n, &numbered)
    }

    /// The same from (row, column, number of the value), for values of which some are not used.
    pub fn with_sources(n: usize, entries: &[(u32, u32, u32)]) -> Self {
        let mut sorted = entries.to_vec();
        let matrix = compress(n, &mut sorted);
        let source = sorted.iter().map(|&(.., k)| k).collect();
        let mut both: Vec<_> = entries.iter().flat_map(|&(i, j, k)| [(i, j, k), (j, i, k)]).collect();
        let symmetric = compress(n, &mut both);
        let lower = lower_rows(n, &symmetric);
        let upper = transpose(n, &lower);
        Self { n, matrix, source, lower, upper }
    }

    /// Rows.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Entries of L and U off the diagonal.
    pub fn fill(&self) -> usize {
        2 * self.lower.column.len()
    }

    /// Block products that a factorisation takes.
    pub fn products(&self) -> usize {
        (0..self.n).map(|k| self.upper.range(k).len().pow(2)).sum()
    }
}

/// Sorts entries by row and column.
fn compress(n: usize, entries: &mut [(u32, u32, u32)]) -> Rows {
    entries.sort_unstable();
    let mut start = vec![0u32; n + 1];
    for &(row, ..) in entries.iter() {
        start[row as usize + 1] += 1;
    }
    for k in 0..n {
        start[k + 1] += start[k];
    }
    Rows { start, column: entries.iter().map(|&(_, column, _)| column).collect() }
}

/// The rows of L of a symmetric pattern: what row i reaches on its way up the elimination tree
/// (J. W. H. Liu, "The role of elimination trees in sparse factorization", 1990).
fn lower_rows(n: usize, symmetric: &Rows) -> Rows {
    const NONE: u32 = u32::MAX;
    let mut parent = vec![NONE; n];
    let mut seen_by = vec![NONE; n];
    let mut lower = Rows { start: vec![0], column: Vec::new() };
    for i in 0..n as u32 {
        let begin = lower.column.len();
        seen_by[i as usize] = i;
        for &column in &symmetric.column[symmetric.range(i as usize)] {
            let mut k = column;
            while k < i && seen_by[k as usize] != i {
                seen_by[k as usize] = i;
                lower.column.push(k);
                if parent[k as usize] == NONE {
                    parent[k as usize] = i;
                }
                k = parent[k as usize];
            }
        }
        lower.column[begin..].sort_unstable();
        lower.start.push(lower.column.len() as u32);
    }
    lower
}

fn transpose(n: usize, rows: &Rows) -> Rows {
    let mut start = vec![0u32; n + 1];
    for &column in &rows.column {
        start[column as usize + 1] += 1;
    }
    for k in 0..n {
        start[k + 1] += start[k];
    }
    let mut next = start.clone();
    let mut column = vec![0u32; rows.column.len()];
    for i in 0..n {
        for &k in &rows.column[rows.range(i)] {
            column[next[k as usize] as usize] = i as u32;
            next[k as usize] += 1;
        }
    }
    Rows { start, column }
}

/// Factors L (ones on its diagonal) and U.
#[derive(Clone, Debug)]
pub struct Factors<B: Block> {
    pub(super) lower: Vec<B>,
    pub(super) upper: Vec<B>,
    /// Inverse of U's diagonal.
    pub(super) inverse: Vec<B>,
    /// A dense row; all zero between uses.
    row: Vec<B>,
}

impl<B: Block> Factors<B> {
    /// Memory for the factors of a pattern.
    pub fn new(pattern: &Pattern) -> Self {
        Self {
            lower: vec![B::ZERO; pattern.lower.column.len()],
            upper: vec![B::ZERO; pattern.upper.column.len()],
            inverse: vec![B::ZERO; pattern.n],
            row: vec![B::ZERO; pattern.n],
        }
    }

    /// Factors the matrix with these values; false when a pivot has no inverse.
    pub fn factor(&mut self, pattern: &Pattern, values: &[B]) -> bool {
        let row = &mut self.row[..pattern.n];
        let mut regular = true;
        for i in 0..pattern.n {
            let entries = pattern.matrix.range(i);
            for (&j, &from) in pattern.matrix.column[entries.clone()].iter().zip(&pattern.source[entries]) {
                row[j as usize] = values[from as usize];
            }
            let entries = pattern.lower.range(i);
            for (&k, out) in pattern.lower.column[entries.clone()].iter().zip(&mut self.lower[entries]) {
                let k = k as usize;
                let l = std::mem::replace(&mut row[k], B::ZERO).times(&self.inverse[k]);
                *out = l;
                let above = pattern.upper.range(k);
                for (&j, u) in pattern.upper.column[above.clone()].iter().zip(&self.upper[above]) {
                    row[j as usize].subtract_product(&l, u);
                }
            }
            self.inverse[i] = std::mem::replace(&mut row[i], B::ZERO).inverse();
            regular &= self.inverse[i].is_finite();
            let entries = pattern.upper.range(i);
            for (&j, out) in pattern.upper.column[entries.clone()].iter().zip(&mut self.upper[entries]) {
                *out = std::mem::replace(&mut row[j as usize], B::ZERO);
            }
        }
        regular
    }

    /// Solves A x = b in place.
    #[inline]
    pub fn solve(&self, pattern: &Pattern, x: &mut [B::Vector]) {
        let x = &mut x[..pattern.n];
        for i in 0..pattern.n {
            let entries = pattern.lower.range(i);
            let mut y = x[i];
            for (&k, l) in pattern.lower.column[entries.clone()].iter().zip(&self.lower[entries]) {
                y = l.residual(y, x[k as usize]);
            }
            x[i] = y;
        }
        for i in (0..pattern.n).rev() {
            let entries = pattern.upper.range(i);
            let mut y = x[i];
            for (&j, u) in pattern.upper.column[entries.clone()].iter().zip(&self.upper[entries]) {
                y = u.residual(y, x[j as usize]);
            }
            x[i] = self.inverse[i].apply(y);
        }
    }
}

//! Solves in which only a few unknowns have a right-hand side and only those are asked for: the rows of
//! the factors that take part (the paths of those unknowns up the elimination tree) are copied into a
//! packed part of L and U, and the others never touched. Exact: what is left out is zero or unread.

use super::block::Block;
use super::factors::{Factors, Pattern, Rows};

/// The part of the factors that some unknowns need.
#[derive(Clone, Debug)]
pub struct Active<B: Block> {
    /// Position in the elimination order of each packed row, ascending.
    rows: Vec<u32>,
    lower: Rows,
    lower_from: Vec<u32>,
    lower_value: Vec<B>,
    upper: Rows,
    upper_value: Vec<B>,
    inverse: Vec<B>,
}

impl<B: Block> Active<B> {
    /// For the unknowns at these positions of the elimination order; also gives the packed row of each.
    pub fn new(pattern: &Pattern, wanted: &[u32]) -> (Self, Vec<u32>) {
        const OUT: u32 = u32::MAX;
        let mut packed = vec![OUT; pattern.n()];
        for &at in wanted {
            // The first entry of a row of U is the parent in the elimination tree.
            let mut at = Some(at);
            while let Some(row) = at.filter(|&row| packed[row as usize] == OUT) {
                packed[row as usize] = 0;
                at = pattern.upper.column[pattern.upper.range(row as usize)].first().copied();
            }
        }
        let rows: Vec<u32> = (0..pattern.n() as u32).filter(|&row| packed[row as usize] != OUT).collect();
        rows.iter().enumerate().for_each(|(k, &row)| packed[row as usize] = k as u32);
        let mut lower = Rows { start: vec![0], column: Vec::new() };
        let mut upper = lower.clone();
        let mut lower_from = Vec::new();
        for &row in &rows {
            for at in pattern.lower.range(row as usize) {
                let column = packed[pattern.lower.column[at] as usize];
                if column != OUT {
                    lower.column.push(column);
                    lower_from.push(at as u32);
                }
            }
            lower.start.push(lower.column.len() as u32);
            // Whatever a row of U names lies on the row's own path up the tree.
            let above = &pattern.upper.column[pattern.upper.range(row as usize)];
            upper.column.extend(above.iter().map(|&j| packed[j as usize]));
            upper.start.push(upper.column.len() as u32);
        }
        let this = Self {
            lower_value: vec![B::ZERO; lower.column.len()],
            upper_value: vec![B::ZERO; upper.column.len()],
            inverse: vec![B::ZERO; rows.len()],
            rows,
            lower,
            lower_from,
            upper,
        };
        let at = wanted.iter().map(|&at| packed[at as usize]).collect();
        (this, at)
    }

    /// Packed rows.
    pub fn n(&self) -> usize {
        self.rows.len()
    }

    /// Takes over the values of new factors.
    pub fn update(&mut self, pattern: &Pattern, factors: &Factors<B>) {
        for (value, &from) in self.lower_value.iter_mut().zip(&self.lower_from) {
            *value = factors.lower[from as usize];
        }
        for (k, &row) in self.rows.iter().enumerate() {
            self.inverse[k] = factors.inverse[row as usize];
            let values = &factors.upper[pattern.upper.range(row as usize)];
            self.upper_value[self.upper.range(k)].copy_from_slice(values);
        }
    }

    /// Solves A x = b in place, both given and asked for at packed rows.
    #[inline]
    pub fn solve(&self, x: &mut [B::Vector]) {
        let x = &mut x[..self.rows.len()];
        for i in 0..x.len() {
            let entries = self.lower.range(i);
            let mut y = x[i];
            for (&k, l) in self.lower.column[entries.clone()].iter().zip(&self.lower_value[entries]) {
                y = l.residual(y, x[k as usize]);
            }
            x[i] = y;
        }
        for i in (0..x.len()).rev() {
            let entries = self.upper.range(i);
            let mut y = x[i];
            for (&j, u) in self.upper.column[entries.clone()].iter().zip(&self.upper_value[entries]) {
                y = u.residual(y, x[j as usize]);
            }
            x[i] = self.inverse[i].apply(y);
        }
    }
}

//! The order in which unknowns are eliminated: approximate minimum degree on the symmetrised pattern
//! (P. R. Amestoy, T. A. Davis, I. S. Duff, "An approximate minimum degree ordering algorithm", 1996),
//! as faer has it. Looks at the pattern only.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::amd;

/// A permutation: position in the elimination order <-> number of the unknown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ordering {
    /// Unknown at each position.
    pub order: Vec<u32>,
    /// Position of each unknown.
    pub position: Vec<u32>,
}

impl Ordering {
    /// Of the pattern given by the entries (row, column) of an n x n matrix.
    pub fn minimum_degree(n: usize, entries: &[(u32, u32)]) -> Self {
        Self::amd(n, entries).unwrap_or_else(|| Self::natural(n))
    }

    /// As numbered.
    pub fn natural(n: usize) -> Self {
        let order: Vec<u32> = (0..n as u32).collect();
        Self { position: order.clone(), order }
    }

    fn amd(n: usize, entries: &[(u32, u32)]) -> Option<Self> {
        let mut columns: Vec<(u32, u32)> = entries.iter().map(|&(i, j)| (j, i)).collect();
        columns.sort_unstable();
        columns.dedup();
        let mut column_starts = vec![0usize; n + 1];
        for &(column, _) in &columns {
            column_starts[column as usize + 1] += 1;
        }
        for k in 0..n {
            column_starts[k + 1] += column_starts[k];
        }
        let rows: Vec<usize> = columns.iter().map(|&(_, row)| row as usize).collect();
        let pattern = SymbolicSparseColMat::new_checked(n, n, column_starts, None, rows);
        let (mut order, mut position) = (vec![0usize; n], vec![0usize; n]);
        let mut memory = MemBuffer::try_new(amd::order_scratch::<usize>(n, columns.len())).ok()?;
        let stack = MemStack::new(&mut memory);
        amd::order(&mut order, &mut position, pattern.as_ref(), amd::Control::default(), stack).ok()?;
        let narrow = |values: Vec<usize>| values.into_iter().map(|k| k as u32).collect();
        Some(Self { order: narrow(order), position: narrow(position) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A star: the middle must be eliminated last or next to last, or everything fills in.
    #[test]
    fn the_middle_of_a_star_comes_late() {
        let n = 50;
        let mut entries: Vec<(u32, u32)> = (0..n).map(|k| (k, k)).collect();
        entries.extend((1..n).flat_map(|k| [(0, k), (k, 0)]));
        let ordering = Ordering::minimum_degree(n as usize, &entries);
        assert!(ordering.position[0] >= n - 2);
        for (at, &k) in ordering.order.iter().enumerate() {
            assert_eq!(ordering.position[k as usize] as usize, at);
        }
    }
}

//! The LU of the network's complex equations: ordered and analysed once, refactored when values change,
//! solved without allocating. The rows' order inside is the elimination's; outside it is the matrix'.
//! Knows nothing of networks.

use super::admittance::SparseMatrix;
use super::error::GridError;
use super::sparse::active::Active;
use super::sparse::factors::Pattern;
use super::sparse::guarded::{self, Guarded};
use super::sparse::ordering::Ordering;
use faer::c64;
use std::sync::Arc;

/// Memory for one solve, so that solves need no allocation.
pub struct Scratch {
    permuted: Vec<c64>,
    guarded: guarded::Scratch<c64>,
}

impl Clone for Scratch {
    fn clone(&self) -> Self {
        Self { permuted: self.permuted.clone(), guarded: guarded::Scratch::default() }
    }
}

/// LU factors of a sparse complex matrix, see [`super::sparse`].
#[derive(Clone)]
pub struct Lu {
    ordering: Arc<Ordering>,
    factors: Guarded<c64>,
    what: &'static str,
}

impl Lu {
    /// Analyses and factors a matrix; `what` names it in errors.
    pub fn new(matrix: &SparseMatrix, what: &'static str) -> Result<Self, GridError> {
        let (starts, rows) = (matrix.symbolic().col_ptr(), matrix.symbolic().row_idx());
        let n = matrix.ncols();
        let entries: Vec<(u32, u32)> = (0..n)
            .flat_map(|j| rows[starts[j]..starts[j + 1]].iter().map(move |&i| (i as u32, j as u32)))
            .collect();
        let ordering = Ordering::minimum_degree(n, &entries);
        let at = |k: u32| ordering.position[k as usize];
        let permuted: Vec<(u32, u32)> = entries.iter().map(|&(i, j)| (at(i), at(j))).collect();
        let factors = Guarded::new(Pattern::new(n, &permuted));
        let mut this = Self { ordering: Arc::new(ordering), factors, what };
        this.refactor(matrix)?;
        Ok(this)
    }

    /// Factors a matrix of the same pattern.
    pub fn refactor(&mut self, matrix: &SparseMatrix) -> Result<(), GridError> {
        if self.factors.factor(matrix.val()) { Ok(()) } else { Err(GridError::Singular { what: self.what }) }
    }

    /// Memory for solves.
    pub fn scratch(&self) -> Scratch {
        Scratch { permuted: vec![c64::ZERO; self.ordering.order.len()], guarded: guarded::Scratch::default() }
    }

    /// Solves for the columns of `rhs`, column after column, in place. `rhs.len()` is a multiple of the
    /// matrix' size.
    pub fn solve(&self, rhs: &mut [c64], scratch: &mut Scratch) {
        let order = &self.ordering.order;
        let inner = &mut scratch.permuted;
        for column in rhs.chunks_exact_mut(order.len()) {
            for (x, &k) in inner.iter_mut().zip(order) {
                *x = column[k as usize];
            }
            self.factors.solve(inner, &mut scratch.guarded);
            for (&x, &k) in inner.iter().zip(order) {
                column[k as usize] = x;
            }
        }
    }

    /// A solve that only these unknowns take part in, and the place of each in it; to be brought up to
    /// date by [`Lu::update_active`].
    pub fn active(&self, unknowns: &[usize]) -> (Active<c64>, Vec<u32>) {
        let wanted: Vec<u32> = unknowns.iter().map(|&k| self.ordering.position[k]).collect();
        Active::new(self.factors.pattern(), &wanted)
    }

    /// Takes the present factors over; false when they have none to give, because they needed pivoting.
    pub fn update_active(&self, active: &mut Active<c64>) -> bool {
        let factors = self.factors.factors();
        if let Some(factors) = factors {
            active.update(self.factors.pattern(), factors);
        }
        factors.is_some()
    }

    /// Whether the last factorisation needed pivoting.
    pub fn has_pivoted(&self) -> bool {
        self.factors.has_pivoted()
    }
}

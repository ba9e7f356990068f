//! A sparse complex LU that is analysed once, refactored when values change and solves without
//! allocating. A thin wrap of faer's; knows nothing of networks.

use super::admittance::SparseMatrix;
use super::error::GridError;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::{Conj, MatMut, Par, c64};
use std::sync::Arc;

/// Memory for one solve, so that solves need no allocation.
pub struct Scratch {
    need: StackReq,
    memory: MemBuffer,
}

impl Scratch {
    fn new(need: StackReq) -> Self {
        Self { need, memory: MemBuffer::new(need) }
    }
}

impl Clone for Scratch {
    fn clone(&self) -> Self {
        Self::new(self.need)
    }
}

/// LU factors of a sparse complex matrix with partial pivoting.
#[derive(Clone)]
pub struct Lu {
    symbolic: Arc<SymbolicLu<usize>>,
    numeric: NumericLu<usize, c64>,
    scratch: Scratch,
    what: &'static str,
}

impl Lu {
    /// Analyses and factors a matrix; `what` names it in errors.
    pub fn new(matrix: &SparseMatrix, what: &'static str) -> Result<Self, GridError> {
        let symbolic = factorize_symbolic_lu(matrix.symbolic(), Default::default())
            .map_err(|_| GridError::Singular { what })?;
        let need = symbolic.factorize_numeric_lu_scratch::<c64>(Par::Seq, Default::default());
        let mut this = Self {
            symbolic: Arc::new(symbolic),
            numeric: NumericLu::new(),
            scratch: Scratch::new(need),
            what,
        };
        this.refactor(matrix)?;
        Ok(this)
    }

    /// Factors a matrix of the same pattern.
    pub fn refactor(&mut self, matrix: &SparseMatrix) -> Result<(), GridError> {
        self.symbolic
            .factorize_numeric_lu(
                &mut self.numeric,
                matrix.as_ref(),
                Par::Seq,
                MemStack::new(&mut self.scratch.memory),
                Default::default(),
            )
            .map(|_| ())
            .map_err(|_| GridError::Singular { what: self.what })
    }

    /// Memory for solves of up to `columns` right-hand sides at once.
    pub fn scratch(&self, columns: usize) -> Scratch {
        Scratch::new(self.symbolic.solve_in_place_scratch::<c64>(columns, Par::Seq))
    }

    /// Solves for the columns of `rhs`, column after column, in place. `rhs.len()` is a multiple of the
    /// matrix' size, `scratch` was made for at least as many columns.
    pub fn solve(&self, rhs: &mut [c64], scratch: &mut Scratch) {
        let n = self.symbolic.nrows();
        let columns = rhs.len() / n;
        LuRef::new_unchecked(&self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(rhs, n, columns),
            Par::Seq,
            MemStack::new(&mut scratch.memory),
        );
    }
}

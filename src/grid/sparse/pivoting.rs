//! faer's sparse LU with partial pivoting, for matrices whose diagonal cannot be trusted. A thin wrap that
//! takes the same blocks as the kernel. Allocates when it is made and when it factors for the first time.

use super::block::Block;
use super::factors::Pattern;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, MatMut, Par};
use std::sync::Arc;

/// LU factors with partial pivoting.
pub struct Pivoting<B: Block> {
    symbolic: Arc<SymbolicLu<usize>>,
    numeric: NumericLu<usize, B::Scalar>,
}

impl<B: Block> Clone for Pivoting<B> {
    fn clone(&self) -> Self {
        Self { symbolic: self.symbolic.clone(), numeric: self.numeric.clone() }
    }
}

/// Memory for one solve with pivoting factors; empty until the first.
pub struct PivotingScratch<B: Block> {
    memory: MemBuffer,
    rhs: Vec<B::Scalar>,
}

impl<B: Block> Default for PivotingScratch<B> {
    fn default() -> Self {
        Self { memory: MemBuffer::new(StackReq::EMPTY), rhs: Vec::new() }
    }
}

impl<B: Block> Pivoting<B> {
    /// Analyses and factors; `None` when the matrix is singular.
    pub fn new(pattern: &Pattern, values: &[B]) -> Option<Self> {
        let matrix = expand(pattern, values)?;
        let symbolic = factorize_symbolic_lu(matrix.symbolic(), Default::default()).ok()?;
        let mut this = Self { symbolic: Arc::new(symbolic), numeric: NumericLu::new() };
        this.factor_expanded(&matrix).then_some(this)
    }

    /// Factors a matrix of the same pattern; false when it is singular.
    pub fn factor(&mut self, pattern: &Pattern, values: &[B]) -> bool {
        expand(pattern, values).is_some_and(|matrix| self.factor_expanded(&matrix))
    }

    fn factor_expanded(&mut self, matrix: &SparseColMat<usize, B::Scalar>) -> bool {
        let need = self.symbolic.factorize_numeric_lu_scratch::<B::Scalar>(Par::Seq, Default::default());
        let mut memory = MemBuffer::new(need);
        let stack = MemStack::new(&mut memory);
        self.symbolic
            .factorize_numeric_lu(&mut self.numeric, matrix.as_ref(), Par::Seq, stack, Default::default())
            .is_ok()
    }

    /// Solves A x = b in place.
    pub fn solve(&self, x: &mut [B::Vector], scratch: &mut PivotingScratch<B>) {
        let size = x.len() * B::SIZE;
        if scratch.rhs.len() != size {
            scratch.rhs = vec![B::ZERO.entry(0, 0); size];
            scratch.memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<B::Scalar>(1, Par::Seq));
        }
        for (&value, scalars) in x.iter().zip(scratch.rhs.chunks_exact_mut(B::SIZE)) {
            B::unpack(value, scalars);
        }
        LuRef::new_unchecked(&self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut scratch.rhs, size, 1),
            Par::Seq,
            MemStack::new(&mut scratch.memory),
        );
        for (value, scalars) in x.iter_mut().zip(scratch.rhs.chunks_exact(B::SIZE)) {
            *value = B::pack(scalars);
        }
    }
}

/// The matrix in scalars.
fn expand<B: Block>(pattern: &Pattern, values: &[B]) -> Option<SparseColMat<usize, B::Scalar>> {
    let mut entries = Vec::with_capacity(pattern.source.len() * B::SIZE * B::SIZE);
    for i in 0..pattern.n() {
        for at in pattern.matrix.range(i) {
            let (j, block) = (pattern.matrix.column[at] as usize, &values[pattern.source[at] as usize]);
            for row in 0..B::SIZE {
                for column in 0..B::SIZE {
                    let value = block.entry(row, column);
                    entries.push(Triplet::new(i * B::SIZE + row, j * B::SIZE + column, value));
                }
            }
        }
    }
    let size = pattern.n() * B::SIZE;
    SparseColMat::try_new_from_triplets(size, size, &entries).ok()
}

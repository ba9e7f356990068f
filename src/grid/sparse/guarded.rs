//! The kernel with a guard: what it computes is checked by a residual, and where the diagonal was no good
//! pivot, faer's pivoting LU takes its place for this matrix. The choice depends on the values alone.

use super::block::{Block, largest};
use super::factors::{Factors, Pattern};
use super::pivoting::{Pivoting, PivotingScratch};
use std::sync::Arc;

/// Largest componentwise backward error of a test solve, `abs(b - A x) / (abs(A) abs(x) + abs(b))`
/// (W. Oettli, W. Prager, 1964), with which factors are accepted. Sound ones stay below 1e-13.
pub const MOST_BACKWARD_ERROR: f64 = 1e-11;
/// Residual over right-hand side with which the solution of one equation is accepted.
pub const MOST_RESIDUAL: f64 = 1e-8;

/// Factors of a matrix, with or without pivoting.
#[derive(Clone)]
pub struct Guarded<B: Block> {
    pattern: Arc<Pattern>,
    factors: Factors<B>,
    pivoting: Option<Pivoting<B>>,
    has_pivoted: bool,
    probe: Vec<B::Vector>,
}

/// Memory for one solve.
pub struct Scratch<B: Block>(PivotingScratch<B>);

impl<B: Block> Default for Scratch<B> {
    fn default() -> Self {
        Self(PivotingScratch::default())
    }
}

impl<B: Block> Guarded<B> {
    /// Memory for a pattern; nothing is factored yet.
    pub fn new(pattern: Pattern) -> Self {
        Self {
            factors: Factors::new(&pattern),
            pivoting: None,
            has_pivoted: false,
            probe: vec![B::ZERO_VECTOR; pattern.n()],
            pattern: Arc::new(pattern),
        }
    }

    /// The pattern.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// The kernel's factors; `None` when the pivoting LU stands in for them.
    pub fn factors(&self) -> Option<&Factors<B>> {
        (!self.has_pivoted).then_some(&self.factors)
    }

    /// Whether the last factorisation needed the pivoting LU.
    pub fn has_pivoted(&self) -> bool {
        self.has_pivoted
    }

    /// Factors the matrix with these values and tries the factors on a right-hand side; false when the
    /// matrix is singular. Allocates only when the pivoting LU is needed.
    pub fn factor(&mut self, values: &[B]) -> bool {
        self.has_pivoted = false;
        if self.factors.factor(&self.pattern, values) && self.passes_the_test(values) {
            return true;
        }
        // faer reports a missing pivot only where the pattern shows it, so that it is tested as well.
        self.pivot(values) && self.passes_the_test(values)
    }

    fn passes_the_test(&mut self, values: &[B]) -> bool {
        let mut probe = std::mem::take(&mut self.probe);
        probe.iter_mut().enumerate().for_each(|(k, b)| *b = B::probe(k));
        self.solve(&mut probe, &mut Scratch::default());
        let error = backward_error(&self.pattern, values, &probe);
        self.probe = probe;
        error <= MOST_BACKWARD_ERROR
    }

    fn pivot(&mut self, values: &[B]) -> bool {
        self.has_pivoted = true;
        match &mut self.pivoting {
            Some(pivoting) => pivoting.factor(&self.pattern, values),
            empty => {
                *empty = Pivoting::new(&self.pattern, values);
                empty.is_some()
            }
        }
    }

    /// Solves A x = b in place with the present factors.
    #[inline]
    pub fn solve(&self, x: &mut [B::Vector], scratch: &mut Scratch<B>) {
        match (&self.pivoting, self.has_pivoted) {
            (Some(pivoting), true) => pivoting.solve(x, &mut scratch.0),
            _ => self.factors.solve(&self.pattern, x),
        }
    }

    /// Factors and solves A x = b once; the check is the residual of this very solution. False when the
    /// matrix is singular.
    pub fn factor_and_solve(&mut self, values: &[B], b: &[B::Vector], x: &mut [B::Vector]) -> bool {
        self.has_pivoted = false;
        x.copy_from_slice(b);
        if self.factors.factor(&self.pattern, values) {
            self.factors.solve(&self.pattern, x);
            if residual(&self.pattern, values, b, x) <= MOST_RESIDUAL {
                return true;
            }
            x.copy_from_slice(b);
        }
        if !self.pivot(values) {
            return false;
        }
        self.solve(x, &mut Scratch::default());
        residual(&self.pattern, values, b, x) <= MOST_RESIDUAL
    }
}

/// Largest residual of A x = b over the largest entry of b; NaN when anything is.
pub fn residual<B: Block>(pattern: &Pattern, values: &[B], b: &[B::Vector], x: &[B::Vector]) -> f64 {
    let (mut most, mut size) = (0.0, 0.0);
    for i in 0..pattern.n() {
        let entries = pattern.matrix.range(i);
        let mut r = b[i];
        for (&j, &from) in pattern.matrix.column[entries.clone()].iter().zip(&pattern.source[entries]) {
            r = values[from as usize].residual(r, x[j as usize]);
        }
        most = largest(B::vector_size(r), most);
        size = largest(B::vector_size(b[i]), size);
    }
    if most == 0.0 { 0.0 } else { most / size }
}

/// Componentwise backward error of A x = b for the b of the test solve; NaN when anything is.
fn backward_error<B: Block>(pattern: &Pattern, values: &[B], x: &[B::Vector]) -> f64 {
    let mut most = 0.0;
    for i in 0..pattern.n() {
        let entries = pattern.matrix.range(i);
        let mut r = B::probe(i);
        let mut size = B::vector_size(r);
        for (&j, &from) in pattern.matrix.column[entries.clone()].iter().zip(&pattern.source[entries]) {
            let (a, x) = (&values[from as usize], x[j as usize]);
            r = a.residual(r, x);
            size += a.size() * B::vector_size(x);
        }
        most = largest(B::vector_size(r) / size, most);
    }
    most
}

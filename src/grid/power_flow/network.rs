//! The bus admittance matrix in elimination order with the pattern of the Jacobian: one 2 x 2 block per
//! entry. Computes injected powers and Jacobians; never solves.

use super::super::admittance::SparseMatrix;
use super::super::sparse::factors::Pattern;
use super::super::sparse::ordering::Ordering;
use super::super::sparse::{Block, Real2};
use super::specified::Unknown;
use faer::c64;

/// Rows of the bus admittance matrix, buses in elimination order.
#[derive(Clone)]
pub(super) struct OrderedNetwork {
    start: Vec<u32>,
    column: Vec<u32>,
    y: Vec<c64>,
    /// 1 where the magnitude is unknown, else 0; in elimination order.
    magnitude: Vec<f64>,
    /// Whether anything is unknown.
    is_free: Vec<bool>,
}

/// The ordering of the buses and the pattern of the Jacobian that goes with it.
pub(super) struct Ordered {
    pub network: OrderedNetwork,
    pub ordering: Ordering,
    pub pattern: Pattern,
}

impl OrderedNetwork {
    /// From the matrix and the unknowns, both in the order of the bus table.
    pub fn ordered(matrix: &SparseMatrix, unknown: &[Unknown]) -> Ordered {
        let n = unknown.len();
        let (starts, rows) = (matrix.symbolic().col_ptr(), matrix.symbolic().row_idx());
        let mut entries: Vec<(u32, u32, c64)> = Vec::with_capacity(rows.len());
        for j in 0..n {
            for at in starts[j]..starts[j + 1] {
                entries.push((rows[at] as u32, j as u32, matrix.val()[at]));
            }
        }
        // A bus where nothing is unknown couples to no other in the Jacobian.
        let is_free = |k: u32| unknown[k as usize] != Unknown::Nothing;
        let couples = |i: u32, j: u32| i == j || (is_free(i) && is_free(j));
        let coupled: Vec<(u32, u32)> =
            entries.iter().map(|&(i, j, _)| (i, j)).filter(|&(i, j)| couples(i, j)).collect();
        let ordering = Ordering::minimum_degree(n, &coupled);
        let position = |k: u32| ordering.position[k as usize];
        for entry in &mut entries {
            *entry = (position(entry.0), position(entry.1), entry.2);
        }
        entries.sort_unstable_by_key(|&(i, j, _)| (i, j));
        let mut start = vec![0u32; n + 1];
        for &(i, ..) in &entries {
            start[i as usize + 1] += 1;
        }
        for k in 0..n {
            start[k + 1] += start[k];
        }
        let at = |i: u32| ordering.order[i as usize];
        let of_jacobian: Vec<(u32, u32, u32)> = entries
            .iter()
            .enumerate()
            .filter(|&(_, &(i, j, _))| couples(at(i), at(j)))
            .map(|(k, &(i, j, _))| (i, j, k as u32))
            .collect();
        let unknown_at = |at: &u32| unknown[*at as usize];
        let network = Self {
            start,
            column: entries.iter().map(|&(_, j, _)| j).collect(),
            y: entries.iter().map(|&(.., y)| y).collect(),
            magnitude: ordering
                .order
                .iter()
                .map(|k| if unknown_at(k) == Unknown::Both { 1.0 } else { 0.0 })
                .collect(),
            is_free: ordering.order.iter().map(|k| unknown_at(k) != Unknown::Nothing).collect(),
        };
        Ordered { pattern: Pattern::with_sources(n, &of_jacobian), network, ordering }
    }

    /// Entries.
    pub fn entries(&self) -> usize {
        self.y.len()
    }

    #[inline]
    fn row(&self, i: usize) -> impl Iterator<Item = (usize, c64)> {
        let entries = self.start[i] as usize..self.start[i + 1] as usize;
        self.column[entries.clone()].iter().zip(&self.y[entries]).map(|(&j, &y)| (j as usize, y))
    }

    /// Complex powers that the buses inject, S = V conj(Y V), pu.
    pub fn injections(&self, v: &[c64], s: &mut [c64]) {
        for (i, s) in s.iter_mut().enumerate() {
            let mut current = c64::ZERO;
            for (j, y) in self.row(i) {
                current += y * v[j];
            }
            *s = v[i] * current.conj();
        }
    }

    /// Specified less injected powers at the unknowns; the largest, NaN if any is.
    pub fn mismatch(&self, specified: &[c64], s: &[c64], mismatch: &mut [[f64; 2]]) -> f64 {
        let mut worst = 0.0;
        for (i, out) in mismatch.iter_mut().enumerate() {
            let d = specified[i] - s[i];
            *out = if self.is_free[i] { [d.re, d.im * self.magnitude[i]] } else { [0.0; 2] };
            worst = super::super::sparse::block::largest(Real2::vector_size(*out), worst);
        }
        worst
    }

    /// The Jacobian d(P, Q) / d(angle, ln magnitude), entry for entry of the matrix. With the logarithm
    /// an off-diagonal block holds nothing but t = V_i conj(Y_ij V_j): dS_i/d angle_j = -j t,
    /// dS_i/d ln magnitude_j = t; the correction of the magnitude is the same as with d/d magnitude.
    pub fn jacobian(&self, v: &[c64], s: &[c64], jacobian: &mut [Real2]) {
        for i in 0..v.len() {
            let entries = self.start[i] as usize..self.start[i + 1] as usize;
            let (vi, own) = (v[i], self.magnitude[i]);
            let columns = &self.column[entries.clone()];
            for ((&j, y), out) in columns.iter().zip(&self.y[entries.clone()]).zip(&mut jacobian[entries]) {
                let j = j as usize;
                let t = vi * (y * v[j]).conj();
                let by = self.magnitude[j];
                *out = Real2([t.im, t.re * by, -t.re * own, t.im * (own * by)]);
                if i == j {
                    *out = if self.is_free[i] {
                        let last = if own == 0.0 { 1.0 } else { t.im + s[i].im };
                        Real2([t.im - s[i].im, (t.re + s[i].re) * own, (s[i].re - t.re) * own, last])
                    } else {
                        Real2([1.0, 0.0, 0.0, 1.0])
                    };
                }
            }
        }
    }
}

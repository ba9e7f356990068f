//! The sparse kernel against faer's dense LU on random matrices, with and without a diagonal to pivot on;
//! solves for some unknowns against the whole. Grids that are solved with it are in `grid_large.rs`.
#![cfg(feature = "grid")]
#![allow(
    non_snake_case,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests: the paper's letters; a failure may panic"
)]

mod grid_support;

use bess_consensus::grid::sparse::active::Active;
use bess_consensus::grid::sparse::factors::Pattern;
use bess_consensus::grid::sparse::guarded::{Scratch, residual};
use bess_consensus::grid::sparse::{Block, Guarded, Ordering, Real2};
use faer::linalg::solvers::Solve;
use faer::{Col, Mat, c64};
use grid_support::Numbers;

/// A random pattern in elimination order with its full diagonal; unsymmetric unless asked otherwise.
fn pattern(n: u32, per_row: usize, symmetric: bool, numbers: &mut Numbers) -> (Vec<(u32, u32)>, Ordering) {
    let mut entries: Vec<(u32, u32)> = (0..n).map(|k| (k, k)).collect();
    for i in 0..n {
        for _ in 0..per_row {
            let j = numbers.below(n);
            entries.push((i, j));
            if symmetric {
                entries.push((j, i));
            }
        }
    }
    entries.sort_unstable();
    entries.dedup();
    let ordering = Ordering::minimum_degree(n as usize, &entries);
    let at = |k: u32| ordering.position[k as usize];
    (entries.iter().map(|&(i, j)| (at(i), at(j))).collect(), ordering)
}

/// The same equations solved dense, with partial pivoting, one scalar after the other.
fn dense(n: usize, entries: &[(u32, u32)], values: &[Real2], b: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut A = Mat::<f64>::zeros(2 * n, 2 * n);
    for (&(i, j), value) in entries.iter().zip(values) {
        for (k, &x) in value.0.iter().enumerate() {
            A[(2 * i as usize + k / 2, 2 * j as usize + k % 2)] = x;
        }
    }
    let x = A.partial_piv_lu().solve(&Col::from_fn(2 * n, |k| b[k / 2][k % 2]));
    (0..n).map(|k| [x[2 * k], x[2 * k + 1]]).collect()
}

fn difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_kernel_agrees_with_a_dense_lu() {
    for seed in 0..20 {
        let mut numbers = Numbers::new(seed);
        let n = 1 + numbers.below(120);
        let (entries, _) = pattern(n, 2, seed % 2 == 0, &mut numbers);
        let values: Vec<Real2> = entries
            .iter()
            .map(|&(i, j)| {
                let own = if i == j { 12.0 } else { 0.0 };
                let mut next = || numbers.around_zero();
                Real2([own + next(), next(), next(), own + next()])
            })
            .collect();
        let b: Vec<[f64; 2]> = (0..n).map(|_| [numbers.around_zero(), numbers.around_zero()]).collect();
        let mut lu = Guarded::new(Pattern::new(n as usize, &entries));
        assert!(lu.factor(&values) && !lu.has_pivoted());
        let mut x = b.clone();
        lu.solve(&mut x, &mut Scratch::default());
        // Diagonally dominant: the condition is below 10.
        assert!(difference(&x, &dense(n as usize, &entries, &values, &b)) < 1e-14);
    }
}

/// A diagonal of zeros, or of noise: no pivot at all, or one that destroys every digit.
#[test]
fn where_the_diagonal_is_no_pivot_the_pivoting_lu_takes_over() {
    for seed in 0..20 {
        for own in [0.0, 1e-17, 1e-13] {
            let mut numbers = Numbers::new(100 + seed);
            let n = 40 + numbers.below(80);
            let mut entries: Vec<(u32, u32)> = (0..n).map(|k| (k, k)).collect();
            // A permutation that leaves no unknown where it is carries the matrix.
            entries.extend((0..n).map(|k| (k, (k + 1) % n)));
            entries.extend((0..n).map(|k| (k, (k + 2 + numbers.below(n - 3)) % n)).filter(|(i, j)| i != j));
            entries.sort_unstable();
            entries.dedup();
            let values: Vec<Real2> = entries
                .iter()
                .map(|&(i, j)| match (j + n - i) % n {
                    0 => Real2([own, 0.0, 0.0, own]),
                    1 => Real2([4.0, 1.0, -1.0, 4.0]),
                    _ => Real2([numbers.around_zero(), 0.0, 0.0, numbers.around_zero()]),
                })
                .collect();
            let b: Vec<[f64; 2]> = (0..n).map(|_| [numbers.around_zero(), numbers.around_zero()]).collect();
            let mut lu = Guarded::new(Pattern::new(n as usize, &entries));
            assert!(lu.factor(&values) && lu.has_pivoted(), "seed {seed}, diagonal {own}");
            let expected = dense(n as usize, &entries, &values, &b);
            let mut x = b.clone();
            lu.solve(&mut x, &mut Scratch::default());
            assert!(difference(&x, &expected) < 1e-13);
            let mut once = b.clone();
            assert!(lu.factor_and_solve(&values, &b, &mut once) && lu.has_pivoted());
            assert!(difference(&once, &expected) < 1e-13);
            // Back to a diagonal that carries: the kernel takes over again.
            let sound: Vec<Real2> = entries
                .iter()
                .zip(&values)
                .map(|(&(i, j), value)| if i == j { Real2([20.0, 0.0, 0.0, 20.0]) } else { *value })
                .collect();
            assert!(lu.factor(&sound) && !lu.has_pivoted());
        }
    }
}

#[test]
fn a_singular_matrix_is_refused() {
    let entries = [(0, 0), (0, 1), (1, 0), (1, 1)];
    let mut lu = Guarded::new(Pattern::new(2, &entries));
    assert!(!lu.factor(&[c64::ZERO; 4]));
    assert!(!lu.factor(&[c64::new(f64::NAN, 0.0); 4]));
    let one = c64::ONE;
    assert!(lu.factor(&[c64::ZERO, one, one, c64::ZERO]) && lu.has_pivoted());
    assert!(lu.factor(&[one, c64::ZERO, c64::ZERO, one]) && !lu.has_pivoted());
}

#[test]
fn a_solve_for_some_unknowns_is_the_whole_solve_there() {
    for seed in 0..20 {
        let mut numbers = Numbers::new(200 + seed);
        let n = 30 + numbers.below(200);
        let (entries, ordering) = pattern(n, 1, true, &mut numbers);
        let values: Vec<c64> = entries
            .iter()
            .map(|&(i, j)| {
                let own = if i == j { 9.0 } else { 0.0 };
                c64::new(own + numbers.around_zero(), numbers.around_zero())
            })
            .collect();
        let mut lu = Guarded::new(Pattern::new(n as usize, &entries));
        assert!(lu.factor(&values));
        let wanted: Vec<u32> = (0..n / 10).map(|k| ordering.position[(7 * k % n) as usize]).collect();
        let (mut active, at) = Active::new(lu.pattern(), &wanted);
        assert!(active.n() < n as usize);
        active.update(lu.pattern(), lu.factors().unwrap());
        let mut whole = vec![c64::ZERO; n as usize];
        let mut part = vec![c64::ZERO; active.n()];
        for (&row, &packed) in wanted.iter().zip(&at) {
            let value = c64::new(numbers.around_zero(), numbers.around_zero());
            (whole[row as usize], part[packed as usize]) = (value, value);
        }
        lu.solve(&mut whole, &mut Scratch::default());
        active.solve(&mut part);
        for (&row, &packed) in wanted.iter().zip(&at) {
            // Bit by bit: what is left out is zero.
            assert_eq!(whole[row as usize], part[packed as usize]);
        }
    }
}

#[test]
fn the_residual_tells_a_wrong_solution() {
    let pattern = Pattern::new(1, &[(0, 0)]);
    let two = [Real2([2.0, 0.0, 0.0, 2.0])];
    assert_eq!(residual(&pattern, &two, &[[2.0, 4.0]], &[[1.0, 2.0]]), 0.0);
    assert_eq!(residual(&pattern, &two, &[[2.0, 4.0]], &[[1.0, 1.0]]), 0.5);
    assert!(residual(&pattern, &two, &[[2.0, 4.0]], &[[f64::NAN, 1.0]]).is_nan());
    assert!(Real2::ZERO.inverse().0[0].is_nan());
}

/// A tridiagonal matrix eliminated from its ends has no fill: L and U hold what the matrix holds.
#[test]
fn the_ordering_keeps_a_chain_without_fill() {
    let n = 500;
    let entries: Vec<(u32, u32)> =
        (0..n).flat_map(|k| [(k, k)].into_iter().chain((k + 1 < n).then_some((k, k + 1)))).collect();
    let ordering = Ordering::minimum_degree(n as usize, &entries);
    let at = |k: u32| ordering.position[k as usize];
    let ordered: Vec<(u32, u32)> = entries.iter().map(|&(i, j)| (at(i), at(j))).collect();
    assert_eq!(Pattern::new(n as usize, &ordered).fill(), 2 * (n as usize - 1));
}

//! The smallest eigenvalue that matters of a weighted Laplacian, with or without pins. Runs when topology,
//! availability, eta or gains change, never inside a step. Dense up to 500 agents; beyond, inverse
//! iteration with conjugate gradients on the edges, and where that takes too long a guaranteed lower bound.

use super::graph::Graph;
use super::scalar::{Dual, Scalar};
use nalgebra::DMatrix;

/// Up to so many agents the eigenvalues are those of the dense matrix.
const DENSE: usize = 500;
/// Edge visits that the iterative method may spend; a second or two.
const BUDGET: usize = 300_000_000;

/// An eigenvalue, and how it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eigenvalue {
    /// The eigenvalue, or a lower bound of it.
    pub value: f64,
    /// How it was found.
    pub method: Method,
}

/// How an eigenvalue was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Dense symmetric eigenvalue decomposition.
    Dense,
    /// Inverse iteration, converged to 1e-10 relative.
    Iterative,
    /// A lower bound from a spanning tree: certificates made of it hold, but are loose.
    Bound,
}

/// A Laplacian on the members of a graph, perhaps with pins on its diagonal.
struct Laplacian {
    edges: Vec<(u32, u32, f64)>,
    diagonal: Vec<f64>,
    pins: Vec<f64>,
    pinned: bool,
}

/// lambda_2 of the Laplacian with weights (g w_ij)^exponent on the `live` agents of `graph`, or with
/// `pinned` the smallest eigenvalue of that Laplacian + diag((g a_0i)^exponent). Zero where the graph is
/// in parts (or a part has no pin), and for an agent alone, whose error is zero anyway.
pub fn smallest(graph: &Graph, live: &[bool], gain: f64, exponent: f64, pinned: bool) -> Eigenvalue {
    let exact = |value| Eigenvalue { value, method: Method::Dense };
    let count = live.iter().filter(|&&l| l).count();
    if count == 0 || (count == 1 && !pinned) {
        return exact(0.0);
    }
    let parts = graph.components(live);
    let tied = if pinned { parts.pinned.iter().all(|&p| p) } else { parts.count() == 1 };
    if !tied || gain == 0.0 {
        return exact(0.0);
    }
    let laplacian = Laplacian::new(graph, live, gain, exponent, pinned);
    if count <= DENSE {
        return exact(laplacian.dense());
    }
    match laplacian.iterative() {
        Some((value, _)) => Eigenvalue { value, method: Method::Iterative },
        None => Eigenvalue { value: laplacian.bound(), method: Method::Bound },
    }
}

/// d [`smallest`] along the gain and the exponent, which change at the rates `d_gain` and `d_exponent`: the
/// quadratic form of the weights' rates in the eigenvector. Where the eigenvalue is multiple, that of one of its
/// eigenvectors; where only a bound is known, the rate of the bound.
pub fn slope(
    graph: &Graph,
    live: &[bool],
    (gain, d_gain): (f64, f64),
    (exponent, d_exponent): (f64, f64),
    pinned: bool,
) -> f64 {
    let found = smallest(graph, live, gain, exponent, pinned);
    if found.value == 0.0 {
        return 0.0;
    }
    // d w^e for the weight w^e = (g a)^e: e dg / g + ln(g a) de, times w^e.
    let relative = |w: f64| exponent * d_gain / gain + w.ln() / exponent * d_exponent;
    let laplacian = Laplacian::new(graph, live, gain, exponent, pinned);
    match found.method {
        Method::Dense => laplacian.rate(&laplacian.dense_vector(), relative),
        Method::Iterative => laplacian.iterative().map_or(0.0, |(_, x)| laplacian.rate(&x, relative)),
        Method::Bound => laplacian.bound_of(|w| (w, w * relative(w))).tangent,
    }
}

impl Laplacian {
    /// sum over edges dw_ij (x_i - x_j)^2 + sum over pins da_i x_i^2.
    fn rate(&self, x: &[f64], relative: impl Fn(f64) -> f64) -> f64 {
        let edges =
            self.edges.iter().map(|&(a, b, w)| w * relative(w) * (x[a as usize] - x[b as usize]).powi(2));
        let pins = self.pins.iter().zip(x).filter(|(a, _)| **a > 0.0);
        edges.sum::<f64>() + pins.map(|(&a, &x)| a * relative(a) * x * x).sum::<f64>()
    }

    fn new(graph: &Graph, live: &[bool], gain: f64, exponent: f64, pinned: bool) -> Self {
        let mut position = vec![0u32; live.len()];
        for (count, (i, _)) in live.iter().enumerate().filter(|&(_, &l)| l).enumerate() {
            position[i] = count as u32;
        }
        let weight = |w: f64| (gain * w).powf(exponent);
        let edges: Vec<_> = graph
            .edges()
            .iter()
            .filter(|e| live[e.a as usize] && live[e.b as usize])
            .map(|e| (position[e.a as usize], position[e.b as usize], weight(e.weight)))
            .collect();
        let pins = graph.pins().iter().zip(live).filter(|&(_, &l)| l);
        let pins: Vec<f64> = pins.map(|(&a, _)| if pinned && a > 0.0 { weight(a) } else { 0.0 }).collect();
        let mut diagonal = pins.clone();
        for &(a, b, w) in &edges {
            diagonal[a as usize] += w;
            diagonal[b as usize] += w;
        }
        Self { edges, diagonal, pins, pinned }
    }

    fn matrix(&self) -> DMatrix<f64> {
        let n = self.diagonal.len();
        let mut matrix = DMatrix::<f64>::zeros(n, n);
        for (i, &d) in self.diagonal.iter().enumerate() {
            matrix[(i, i)] = d;
        }
        for &(a, b, w) in &self.edges {
            matrix[(a as usize, b as usize)] -= w;
            matrix[(b as usize, a as usize)] -= w;
        }
        matrix
    }

    /// The eigenvector of the eigenvalue that [`Self::dense`] finds, of length 1.
    fn dense_vector(&self) -> Vec<f64> {
        let eigen = self.matrix().symmetric_eigen();
        let mut order: Vec<usize> = (0..self.diagonal.len()).collect();
        order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
        let which = order.get(usize::from(!self.pinned)).copied().unwrap_or(0);
        eigen.eigenvectors.column(which).iter().copied().collect()
    }

    fn dense(&self) -> f64 {
        let mut values: Vec<f64> = self.matrix().symmetric_eigenvalues().iter().copied().collect();
        values.sort_by(f64::total_cmp);
        values.get(usize::from(!self.pinned)).map_or(f64::INFINITY, |&x| x.max(0.0))
    }

    fn multiply(&self, x: &[f64], y: &mut [f64]) {
        for (y, (x, pin)) in y.iter_mut().zip(x.iter().zip(&self.pins)) {
            *y = pin * x;
        }
        for &(a, b, w) in &self.edges {
            let f = w * (x[a as usize] - x[b as usize]);
            y[a as usize] += f;
            y[b as usize] -= f;
        }
    }

    /// Takes the part along the constant vector out, which an unpinned Laplacian does not see.
    fn project(&self, x: &mut [f64]) {
        if !self.pinned {
            let mean = x.iter().sum::<f64>() / x.len() as f64;
            x.iter_mut().for_each(|x| *x -= mean);
        }
    }

    /// Inverse iteration: each solution of L y = x lies nearer to the wanted eigenvector.
    fn iterative(&self) -> Option<(f64, Vec<f64>)> {
        let n = self.diagonal.len();
        let mut left = BUDGET;
        // A start that no symmetry of a graph makes orthogonal to the eigenvector.
        let mut x: Vec<f64> =
            (0..n).map(|i| ((i as f64 + 1.0) * 0.618_033_988_749_895).fract() - 0.5).collect();
        self.project(&mut x);
        normalise(&mut x);
        let mut y = vec![0.0; n];
        let mut last = f64::INFINITY;
        for _ in 0..300 {
            y.fill(0.0);
            self.solve(&x, &mut y, &mut left)?;
            self.project(&mut y);
            normalise(&mut y);
            std::mem::swap(&mut x, &mut y);
            self.multiply(&x, &mut y);
            let rayleigh = dot(&x, &y);
            if (last - rayleigh).abs() <= 1e-10 * rayleigh {
                return Some((rayleigh, x));
            }
            last = rayleigh;
        }
        None
    }

    /// Conjugate gradients with the diagonal as preconditioner, to 1e-8 of the right-hand side.
    fn solve(&self, b: &[f64], x: &mut [f64], left: &mut usize) -> Option<()> {
        let n = b.len();
        let precondition = |r: &[f64], z: &mut [f64]| {
            for (z, (r, d)) in z.iter_mut().zip(r.iter().zip(&self.diagonal)) {
                *z = r / d;
            }
            self.project(z);
        };
        let (mut r, mut z, mut q) = (b.to_vec(), vec![0.0; n], vec![0.0; n]);
        precondition(&r, &mut z);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let goal = 1e-8 * dot(b, b).sqrt();
        while dot(&r, &r).sqrt() > goal {
            *left = left.checked_sub(self.edges.len() + 4 * n)?;
            self.multiply(&p, &mut q);
            let alpha = rz / dot(&p, &q);
            for k in 0..n {
                x[k] += alpha * p[k];
                r[k] -= alpha * q[k];
            }
            precondition(&r, &mut z);
            let next = dot(&r, &z);
            for k in 0..n {
                p[k] = z[k] + next / rz * p[k];
            }
            rz = next;
        }
        Some(())
    }

    /// lambda >= 1 / sum_i R_i, R_i the resistance (sum of 1/w) of a path from i to a pin, or to a root
    /// where there are no pins: x_i^2 <= R_i x'Lx by Cauchy-Schwarz along the path.
    fn bound(&self) -> f64 {
        self.bound_of(|w| (w, 0.0)).value
    }

    /// The bound and its rate; `weight` gives a weight and its rate.
    fn bound_of(&self, weight: impl Fn(f64) -> (f64, f64)) -> Dual {
        let one = Dual::constant(1.0);
        let through = |w: f64| {
            let (value, rate) = weight(w);
            one / Dual::new(value, rate)
        };
        let n = self.diagonal.len();
        let edges =
            self.edges.iter().map(|&(a, b, weight)| super::graph::Edge { a, b, weight, delay_ns: None });
        let graph = Graph::new(n, edges.collect(), vec![0.0; n]);
        let mut resistance = vec![Dual::constant(f64::INFINITY); n];
        let mut queue = std::collections::VecDeque::new();
        for (i, &pin) in self.pins.iter().enumerate().filter(|&(_, &pin)| pin > 0.0) {
            resistance[i] = through(pin);
            queue.push_back(i);
        }
        if queue.is_empty() {
            resistance[0] = Dual::default();
            queue.push_back(0);
        }
        while let Some(i) = queue.pop_front() {
            for &j in graph.neighbours(i) {
                if resistance[j as usize].value.is_infinite()
                    && let Some(e) = graph.find(i as u32, j)
                {
                    resistance[j as usize] = resistance[i] + through(graph.edges()[e].weight);
                    queue.push_back(j as usize);
                }
            }
        }
        one / resistance.iter().fold(Dual::default(), |sum, &r| sum + r)
    }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

fn normalise(x: &mut [f64]) {
    let norm = dot(x, x).sqrt();
    x.iter_mut().for_each(|x| *x /= norm);
}

#[cfg(test)]
mod tests {
    use super::super::graph::Edge;
    use super::*;
    use std::f64::consts::PI;

    fn ring(n: usize) -> Graph {
        let mut pins = vec![0.0; n];
        pins[0] = 1.0;
        Graph::new(n, (0..n).map(|i| Edge::new(i, (i + 1) % n, 1.0)).collect(), pins)
    }

    #[test]
    fn rings_have_the_eigenvalues_of_the_textbook() {
        for n in [5, 40, 600, 3000] {
            let found = smallest(&ring(n), &vec![true; n], 1.0, 1.0, false);
            let exact = 2.0 - 2.0 * (2.0 * PI / n as f64).cos();
            assert!((found.value - exact).abs() < 1e-8 * exact, "{n}: {found:?} {exact}");
            assert_eq!(found.method == Method::Dense, n <= DENSE);
        }
    }

    #[test]
    fn a_pinned_path_has_the_eigenvalue_of_the_textbook() {
        // Path pinned at one end with weight 1: 2 - 2 cos(pi / (2n + 1)).
        for n in [4, 700] {
            let mut pins = vec![0.0; n];
            pins[0] = 1.0;
            let path = Graph::new(n, (1..n).map(|i| Edge::new(i - 1, i, 1.0)).collect(), pins);
            let found = smallest(&path, &vec![true; n], 1.0, 1.0, true).value;
            let exact = 2.0 - 2.0 * (PI / (2 * n + 1) as f64).cos();
            assert!((found - exact).abs() < 1e-8 * exact, "{n}: {found} {exact}");
        }
    }

    #[test]
    fn the_bound_is_a_lower_bound() {
        for pinned in [false, true] {
            let laplacian = Laplacian::new(&ring(30), &[true; 30], 2.0, 1.3, pinned);
            let (bound, exact) = (laplacian.bound(), laplacian.dense());
            assert!(bound > 0.0 && bound <= exact, "{bound} {exact}");
        }
    }

    #[test]
    fn graphs_in_parts_have_none() {
        let mut live = vec![true; 6];
        (live[1], live[4]) = (false, false);
        assert_eq!(smallest(&ring(6), &live, 1.0, 1.0, false).value, 0.0);
        assert_eq!(smallest(&ring(6), &live, 1.0, 1.0, true).value, 0.0);
    }

    #[test]
    fn slopes_agree_with_central_differences() {
        // An odd graph, so that no eigenvalue is multiple; above the limit the iteration.
        for n in [7, 640] {
            let edges = (1..n).map(|i| Edge::new(i - 1, i, 0.3 + 0.6 * ((i * i) as f64).sin().abs()));
            let mut pins = vec![0.0; n];
            (pins[1], pins[n - 2]) = (0.7, 0.4);
            let graph = Graph::new(n, edges.collect(), pins);
            let live = vec![true; n];
            for pinned in [false, true] {
                for (d_gain, d_exponent) in [(1.0, 0.0), (0.0, 1.0)] {
                    let at = |s: f64| {
                        smallest(&graph, &live, 1.3 + s * d_gain, 1.4 + s * d_exponent, pinned).value
                    };
                    let h = 1e-3;
                    let central = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                    let found = slope(&graph, &live, (1.3, d_gain), (1.4, d_exponent), pinned);
                    // Inverse iteration is converged to 1e-10 of the eigenvalue, the difference divides by h.
                    let tolerance = if n <= DENSE { 1e-9 } else { 1e-6 };
                    assert!((found - central).abs() < tolerance * at(0.0), "{n} {found} {central}");
                }
            }
            let laplacian = Laplacian::new(&graph, &live, 2.0, 1.0, false);
            let h = 1e-4;
            let bound = |s: f64| laplacian.bound_of(|w| (w * (1.0 + s), 0.0)).value;
            let central = (bound(h) - bound(-h)) / (2.0 * h);
            assert!((laplacian.bound_of(|w| (w, w)).tangent - central).abs() < 1e-7 * bound(0.0));
        }
    }
}

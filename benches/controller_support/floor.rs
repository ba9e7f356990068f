//! What the machine needs for the least that a step can be: the same dispatch, no controller.

use pulp::{Arch, NullaryFnOnce};
use std::hint::black_box;
use std::time::Instant;

/// Values that stay in the first cache.
const NEAR: usize = 1024;
/// Values of each of three arrays that do not stay in any.
const FAR: usize = 16_000_000;
/// Rounds over the near values.
const ROUNDS: usize = 2000;

/// Three measurements.
pub struct Floor {
    eta: f64,
    near: Vec<f64>,
    out: Vec<f64>,
    far: [Vec<f64>; 3],
}

impl Floor {
    /// Arrays, touched.
    pub fn new(eta: f64) -> Self {
        Self {
            eta,
            near: (0..NEAR).map(|i| 1e-4 * (1.0 + i as f64)).collect(),
            out: vec![0.0; NEAR],
            far: [vec![0.0; FAR], vec![1.0; FAR], vec![2.0; FAR]],
        }
    }

    /// Time of one square root in a long row of them, s.
    pub fn root_s(&mut self) -> f64 {
        let begin = Instant::now();
        for _ in 0..ROUNDS {
            let (x, y) = (black_box(&self.near[..]), &mut self.out[..]);
            Arch::new().dispatch(Roots(x, y));
            black_box(&mut self.out);
        }
        begin.elapsed().as_secs_f64() / (ROUNDS * NEAR) as f64
    }

    /// Time of one power, exp2(eta log2 x), in a long row of them, s.
    pub fn power_s(&mut self) -> f64 {
        let begin = Instant::now();
        for _ in 0..ROUNDS / 10 {
            bess_consensus::control::power::powers(black_box(self.eta), black_box(&self.near), &mut self.out);
            black_box(&mut self.out);
        }
        begin.elapsed().as_secs_f64() / (ROUNDS / 10 * NEAR) as f64
    }

    /// Bytes read and written by a triad, per s.
    pub fn triad_bytes_per_s(&mut self) -> f64 {
        let [a, b, c] = &mut self.far;
        let begin = Instant::now();
        Arch::new().dispatch(Triad(a, b, c));
        black_box(&mut self.far);
        (24 * FAR) as f64 / begin.elapsed().as_secs_f64()
    }
}

struct Roots<'a>(&'a [f64], &'a mut [f64]);

impl NullaryFnOnce for Roots<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (y, x) in self.1.iter_mut().zip(self.0) {
            *y = x.sqrt();
        }
    }
}

struct Triad<'a>(&'a mut [f64], &'a [f64], &'a [f64]);

impl NullaryFnOnce for Triad<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for ((a, b), c) in self.0.iter_mut().zip(self.1).zip(self.2) {
            *a = b + 0.5 * c;
        }
    }
}

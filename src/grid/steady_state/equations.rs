//! Newton's equations of the steady state: one real 2 x 2 block per bus (its voltage, rectangular) and per
//! source (angle and magnitude). The bus rows are linear and hold exactly at every iterate, so that this
//! is Newton's method on the sources alone, without their dense reduced network.

use super::super::network::Network;
use super::super::sparse::factors::Pattern;
use super::super::sparse::guarded::Scratch;
use super::super::sparse::{Guarded, Ordering, Real2};
use super::super::state::Parameters;
use faer::c64;

/// The equations of one network. Entries: those of the network's matrix, then per source its own, its
/// bus', and how its bus takes it.
pub(super) struct Equations {
    ordering: Ordering,
    factors: Guarded<Real2>,
    values: Vec<Real2>,
    /// Whether the common frequency is unknown and the first angle held instead.
    islanded: bool,
}

impl Equations {
    /// Analyses the pattern.
    pub fn new(network: &Network, islanded: bool) -> Self {
        let plant = network.plant();
        let n_bus = plant.n_bus();
        let symbolic = network.matrix().symbolic();
        let (starts, rows) = (symbolic.col_ptr(), symbolic.row_idx());
        let mut entries: Vec<(u32, u32)> = (0..n_bus)
            .flat_map(|j| rows[starts[j]..starts[j + 1]].iter().map(move |&i| (i as u32, j as u32)))
            .collect();
        for (i, &bus) in plant.bess_bus.iter().enumerate() {
            let (source, bus) = ((n_bus + i) as u32, bus as u32);
            entries.extend([(source, source), (source, bus), (bus, source)]);
        }
        let size = n_bus + plant.n();
        let ordering = Ordering::minimum_degree(size, &entries);
        for (i, j) in &mut entries {
            (*i, *j) = (ordering.position[*i as usize], ordering.position[*j as usize]);
        }
        Self {
            values: vec![Real2([0.0; 4]); entries.len()],
            factors: Guarded::new(Pattern::new(size, &entries)),
            ordering,
            islanded,
        }
    }

    /// Corrections of (angle, magnitude) per source and of the common frequency, from source voltages,
    /// powers, magnitudes and the residuals of the droop equations; `None` when they are singular.
    pub fn solve(
        &mut self,
        network: &Network,
        E: &[c64],
        S: &[c64],
        V: &[f64],
        parameters: &Parameters,
        residual: &[[f64; 2]],
    ) -> Option<(Vec<[f64; 2]>, f64)> {
        let (n, n_bus) = (E.len(), network.plant().n_bus());
        let own = network.matrix().val();
        for (value, y) in self.values.iter_mut().zip(own) {
            *value = Real2([y.re, -y.im, y.im, y.re]);
        }
        // The first source's active power, which the border takes when islanded.
        let mut border = ([0.0; 2], [0.0; 2]);
        for i in 0..n {
            let y = network.source[i];
            // S = E conj(y (E - v)), E = V exp(j delta), by angle, magnitude, real and imaginary v.
            let t = E[i] * (y * E[i]).conj();
            let by_angle = c64::new(0.0, 1.0) * (S[i] - t);
            let by_magnitude = (S[i] + t) / V[i];
            let by_real = -E[i] * y.conj();
            let by_imaginary = c64::new(0.0, -1.0) * by_real;
            let (K_P, K_Q) = (parameters.K_P[i], parameters.K_Q[i]);
            let mut at_source = Real2([
                K_P * by_angle.re,
                K_P * by_magnitude.re,
                K_Q * by_angle.im,
                K_Q * by_magnitude.im + 1.0,
            ]);
            let mut at_bus =
                Real2([K_P * by_real.re, K_P * by_imaginary.re, K_Q * by_real.im, K_Q * by_imaginary.im]);
            if i == 0 && self.islanded {
                border = ([at_source.0[0], at_source.0[1]], [at_bus.0[0], at_bus.0[1]]);
                (at_source.0[0], at_source.0[1], at_bus.0[0], at_bus.0[1]) = (1.0, 0.0, 0.0, 0.0);
            }
            let (into_angle, into_magnitude) = (c64::new(0.0, -1.0) * y * E[i], -y * E[i] / V[i]);
            let from = Real2([into_angle.re, into_magnitude.re, into_angle.im, into_magnitude.im]);
            let at = own.len() + 3 * i;
            self.values[at..at + 3].copy_from_slice(&[at_source, at_bus, from]);
        }
        if !self.factors.factor(&self.values) {
            return None;
        }
        let place = |k: usize| self.ordering.position[k] as usize;
        let solve = |rhs: &dyn Fn(usize) -> [f64; 2]| {
            let mut x = vec![[0.0; 2]; n_bus + n];
            (0..n).for_each(|i| x[place(n_bus + i)] = rhs(i));
            self.factors.solve(&mut x, &mut Scratch::default());
            x
        };
        if !self.islanded {
            let x = solve(&|i| residual[i]);
            return Some(((0..n).map(|i| x[place(n_bus + i)]).collect(), 0.0));
        }
        let a = solve(&|i| if i == 0 { [0.0, residual[0][1]] } else { residual[i] });
        let b = solve(&|i| if i == 0 { [0.0; 2] } else { [1.0, 0.0] });
        let first_bus = network.plant().bess_bus[0];
        let times = |x: &[[f64; 2]]| {
            let (source, bus) = (x[place(n_bus)], x[place(first_bus)]);
            border.0[0] * source[0] + border.0[1] * source[1] + border.1[0] * bus[0] + border.1[1] * bus[1]
        };
        let omega = (residual[0][0] - times(&a)) / (1.0 - times(&b));
        let step = |i: usize| {
            let (a, b) = (a[place(n_bus + i)], b[place(n_bus + i)]);
            [a[0] - omega * b[0], a[1] - omega * b[1]]
        };
        Some(((0..n).map(step).collect(), omega))
    }
}

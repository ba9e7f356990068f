//! The embedded Runge-Kutta pair of Dormand and Prince, orders 5 and 4 (J. R. Dormand, P. J. Prince,
//! "A family of embedded Runge-Kutta formulae", 1980), with step control after Hairer, Norsett and
//! Wanner, "Solving Ordinary Differential Equations I", section II.4. Knows nothing of grids.

use pulp::{Arch, NullaryFnOnce};

/// A system dy/dt = f(y) whose inputs are held.
pub trait Dynamics {
    /// Writes f(y) into `dy`; false when it cannot be evaluated there.
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) -> bool;

    /// The size against which the relative tolerance of component `k` is measured.
    fn scale(&self, k: usize, value: f64) -> f64;

    /// Whether the state is one that a simulation should go on from.
    fn plausible(&self, y: &[f64]) -> bool;
}

/// Why an integration stopped short.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Failure {
    /// Time integrated, s.
    pub offset_s: f64,
    /// Last internal step tried, s.
    pub step_s: f64,
    /// What happened.
    pub reason: &'static str,
}

/// What an integration cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// Internal steps accepted.
    pub accepted: u32,
    /// Internal steps rejected.
    pub rejected: u32,
}

/// Memory and tolerances of the integration. Holds nothing that a result depends on.
#[derive(Clone, Debug)]
pub struct Integrator {
    relative: f64,
    absolute: f64,
    slopes: [Vec<f64>; 7],
    stage: Vec<f64>,
    y: Vec<f64>,
}

/// Longest internal step, s.
const MAX_STEP_S: f64 = 1.0;
/// Shortest internal step after a rejection, s.
const MIN_STEP_S: f64 = 1e-10;
/// Internal steps may not be shorter than this on average, s; a longer run than that is a hang.
const MIN_MEAN_STEP_S: f64 = 1e-6;
/// Internal steps of one communication step, however long that is: two days of a grid at rest, and seconds of
/// computing. A master that asks for more has lost its clock, and could not end the call.
const MOST_STEPS: f64 = 2e6;
/// Rejections in a row before giving up.
const MAX_REJECTIONS: u32 = 60;

/// Stage weights a_ij, row i = stage i + 2; the last row is also the fifth-order solution.
const A: [&[f64]; 6] = [
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];

/// Fifth- less fourth-order weights.
const ERROR: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

impl Integrator {
    /// For a state of `dimension` components.
    pub fn new(dimension: usize, relative: f64, absolute: f64) -> Self {
        Self {
            relative,
            absolute,
            slopes: std::array::from_fn(|_| vec![0.0; dimension]),
            stage: vec![0.0; dimension],
            y: vec![0.0; dimension],
        }
    }

    /// The tolerances, relative and absolute.
    pub fn tolerances(&self) -> (f64, f64) {
        (self.relative, self.absolute)
    }

    /// Advances `y` by `duration_s`, in code for the processor that it runs on. `step_s` is the size that the next
    /// internal step wants; it outlives the call, so that short communication steps cost no more than they must. On
    /// failure `y` and `step_s` are as before.
    pub fn advance<D: Dynamics>(
        &mut self,
        dynamics: &mut D,
        y: &mut [f64],
        step_s: &mut f64,
        duration_s: f64,
    ) -> Result<Effort, Failure> {
        Arch::new().dispatch(Advance { integrator: self, dynamics, y, step_s, duration_s })
    }

    #[inline(always)]
    fn advance_here<D: Dynamics>(
        &mut self,
        dynamics: &mut D,
        y: &mut [f64],
        step_s: &mut f64,
        duration_s: f64,
    ) -> Result<Effort, Failure> {
        let mut effort = Effort::default();
        if duration_s <= 0.0 {
            return Ok(effort);
        }
        self.y.copy_from_slice(y);
        let (mut t, mut wanted) = (0.0, *step_s);
        let mut error_before = 1e-4;
        let most_steps = (10_000.0 + duration_s / MIN_MEAN_STEP_S).min(MOST_STEPS);
        let mut rejections = 0;
        if !dynamics.derivative(&self.y, &mut self.slopes[0]) {
            return Err(Failure { offset_s: t, step_s: wanted, reason: NO_DERIVATIVE });
        }
        loop {
            if f64::from(effort.accepted) + f64::from(effort.rejected) > most_steps {
                let reason = if most_steps < MOST_STEPS { TOO_MANY } else { TOO_LONG };
                return Err(Failure { offset_s: t, step_s: wanted, reason });
            }
            let remaining = duration_s - t;
            let parts = (remaining / wanted).ceil().max(1.0);
            let h = remaining / parts;
            let error = if self.stages(dynamics, h) { self.error(dynamics, h) } else { f64::NAN };
            if error <= 1.0 {
                effort.accepted += 1;
                self.y.copy_from_slice(&self.stage);
                self.slopes.swap(0, 6);
                if !dynamics.plausible(&self.y) {
                    return Err(Failure { offset_s: t, step_s: h, reason: "the powers grow without bound" });
                }
                // The damping by the error before smooths the step size at the border of stability.
                let growth = (0.9 * error.max(1e-12).powf(-0.17) * f64::powf(error_before, 0.04))
                    .clamp(0.2, if rejections > 0 { 1.0 } else { 5.0 });
                error_before = error.max(1e-4);
                rejections = 0;
                let next = h * growth;
                // A step cut short to meet the communication point says nothing against a longer one.
                wanted = if parts == 1.0 && growth >= 1.0 { wanted.max(next) } else { next }.min(MAX_STEP_S);
                if parts == 1.0 {
                    break;
                }
                t += h;
            } else {
                effort.rejected += 1;
                rejections += 1;
                wanted = h * if error.is_finite() { (0.9 * error.powf(-0.2)).clamp(0.1, 0.9) } else { 0.1 };
                if wanted < MIN_STEP_S || rejections > MAX_REJECTIONS {
                    let reason = if error.is_finite() { NOT_ACCURATE } else { NO_DERIVATIVE };
                    return Err(Failure { offset_s: t, step_s: h, reason });
                }
            }
        }
        y.copy_from_slice(&self.y);
        *step_s = wanted;
        Ok(effort)
    }

    /// Stages 2 to 7 of a step of size `h` from `self.y`; the solution is left in `self.stage`.
    #[inline(always)]
    fn stages<D: Dynamics>(&mut self, dynamics: &mut D, h: f64) -> bool {
        let m = self.y.len();
        let y = &self.y[..m];
        let stage = &mut self.stage[..m];
        for (s, weights) in A.iter().enumerate() {
            let [k1, k2, k3, k4, k5, k6, _] = &self.slopes;
            let (k1, k2, k3, k4, k5, k6) = (&k1[..m], &k2[..m], &k3[..m], &k4[..m], &k5[..m], &k6[..m]);
            // Loops, because a closure is no part of the code for this processor.
            match **weights {
                [a1] => {
                    for k in 0..m {
                        stage[k] = y[k] + h * (a1 * k1[k]);
                    }
                }
                [a1, a2] => {
                    for k in 0..m {
                        stage[k] = y[k] + h * (a1 * k1[k] + a2 * k2[k]);
                    }
                }
                [a1, a2, a3] => {
                    for k in 0..m {
                        stage[k] = y[k] + h * (a1 * k1[k] + a2 * k2[k] + a3 * k3[k]);
                    }
                }
                [a1, a2, a3, a4] => {
                    for k in 0..m {
                        stage[k] = y[k] + h * (a1 * k1[k] + a2 * k2[k] + a3 * k3[k] + a4 * k4[k]);
                    }
                }
                [a1, a2, a3, a4, a5] => {
                    for k in 0..m {
                        stage[k] =
                            y[k] + h * (a1 * k1[k] + a2 * k2[k] + a3 * k3[k] + a4 * k4[k] + a5 * k5[k]);
                    }
                }
                [a1, _, a3, a4, a5, a6] => {
                    for k in 0..m {
                        stage[k] =
                            y[k] + h * (a1 * k1[k] + a3 * k3[k] + a4 * k4[k] + a5 * k5[k] + a6 * k6[k]);
                    }
                }
                _ => {}
            }
            if !dynamics.derivative(stage, &mut self.slopes[s + 1]) {
                return false;
            }
        }
        true
    }

    /// Largest error of the step over its tolerance; NaN when anything is not finite.
    #[inline(always)]
    fn error<D: Dynamics>(&self, dynamics: &D, h: f64) -> f64 {
        let m = self.y.len();
        let [k1, _, k3, k4, k5, k6, k7] = &self.slopes;
        let (k1, k3, k4, k5, k6, k7) = (&k1[..m], &k3[..m], &k4[..m], &k5[..m], &k6[..m], &k7[..m]);
        let mut worst = 0.0;
        for k in 0..m {
            let e = h
                * (ERROR[0] * k1[k]
                    + ERROR[2] * k3[k]
                    + ERROR[3] * k4[k]
                    + ERROR[4] * k5[k]
                    + ERROR[5] * k6[k]
                    + ERROR[6] * k7[k]);
            let size = dynamics.scale(k, self.y[k].abs().max(self.stage[k].abs()));
            let ratio = e.abs() / (self.absolute + self.relative * size);
            if !ratio.is_finite() {
                return f64::NAN;
            }
            if ratio > worst {
                worst = ratio;
            }
        }
        worst
    }
}

/// [`Integrator::advance`], compiled for each kind of processor.
struct Advance<'a, D> {
    integrator: &'a mut Integrator,
    dynamics: &'a mut D,
    y: &'a mut [f64],
    step_s: &'a mut f64,
    duration_s: f64,
}

impl<D: Dynamics> NullaryFnOnce for Advance<'_, D> {
    type Output = Result<Effort, Failure>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        self.integrator.advance_here(self.dynamics, self.y, self.step_s, self.duration_s)
    }
}

const TOO_MANY: &str = "the dynamics need internal steps shorter than a microsecond";
const TOO_LONG: &str =
    "more than 2000000 internal steps are needed; expected a shorter communication step, or slower dynamics";
const NO_DERIVATIVE: &str = "the network equations have no finite solution";
const NOT_ACCURATE: &str = "the error stays above the tolerance";

#[cfg(test)]
mod tests {
    use super::*;

    /// y'' = -y and z' = -50 z: both known, one stiff enough to make the step size work.
    struct Known;

    impl Dynamics for Known {
        fn derivative(&mut self, y: &[f64], dy: &mut [f64]) -> bool {
            (dy[0], dy[1], dy[2]) = (y[1], -y[0], -50.0 * y[2]);
            true
        }

        fn scale(&self, _: usize, value: f64) -> f64 {
            value
        }

        fn plausible(&self, _: &[f64]) -> bool {
            true
        }
    }

    #[test]
    fn a_circle_and_a_decay() {
        for (pieces, bar) in [(1, 1e-7), (7, 1e-7), (1000, 1e-7)] {
            let mut integrator = Integrator::new(3, 1e-9, 1e-11);
            let (mut y, mut h) = ([1.0, 0.0, 1.0], 1e-3);
            for _ in 0..pieces {
                integrator.advance(&mut Known, &mut y, &mut h, 10.0 / f64::from(pieces)).unwrap();
            }
            assert!((y[0] - 10f64.cos()).abs() < bar && (y[1] + 10f64.sin()).abs() < bar, "{y:?}");
            assert!(y[2].abs() < 1e-9);
        }
    }

    /// Halving the tolerance-free step must divide the error by about 2^5.
    #[test]
    fn the_solution_is_of_fifth_order() {
        let error = |steps: u32| {
            let mut integrator = Integrator::new(3, 1.0, 1.0);
            integrator.y.copy_from_slice(&[1.0, 0.0, 0.0]);
            let h = 1.0 / f64::from(steps);
            for _ in 0..steps {
                let start = integrator.y.clone();
                Known.derivative(&start, &mut integrator.slopes[0]);
                integrator.stages(&mut Known, h);
                integrator.y.copy_from_slice(&integrator.stage);
            }
            (integrator.y[0] - 1f64.cos()).hypot(integrator.y[1] + 1f64.sin())
        };
        let order = (error(10) / error(20)).log2();
        assert!((4.7..5.5).contains(&order), "order {order}");
    }

    #[test]
    fn a_blow_up_is_reported_and_changes_nothing() {
        struct Square;
        impl Dynamics for Square {
            fn derivative(&mut self, y: &[f64], dy: &mut [f64]) -> bool {
                dy[0] = y[0] * y[0];
                true
            }
            fn scale(&self, _: usize, value: f64) -> f64 {
                value
            }
            fn plausible(&self, y: &[f64]) -> bool {
                y[0] < 1e9
            }
        }
        let (mut y, mut h) = ([1.0], 1e-3);
        let failure = Integrator::new(1, 1e-9, 1e-11).advance(&mut Square, &mut y, &mut h, 2.0).unwrap_err();
        assert!((failure.offset_s - 1.0).abs() < 1e-6, "{failure:?}");
        assert_eq!((y[0], h), (1.0, 1e-3));
    }
}

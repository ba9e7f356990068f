//! How late measurements are. A master tells the controller what the plant did with the setpoints of 0 to 3
//! steps ago (FMPy's and libcosim's loops 2, Ecos and PyFMI 1, a master that passes outputs on at once 0), and
//! nothing in FMI says which. A law that takes a late measurement for a present one counts its own last moves
//! as not yet made, makes them again, and ends in an oscillation. So each droop finds the lag by itself and
//! allows for it. Knows setpoints and measurements only; never a graph, never a neighbour.
//!
//! What gives the lag away is the droop (3): omega_i(t_k) = omega_set_i(t_{k-L}) - K_P_i (P_i - P_set_i(t_{k-L})),
//! so the frequency at no load that is measured, y_i = omega_i + K_P_i P_i, moves as the one that is set,
//! sigma_i = omega_set_i + K_P_i P_set_i, moved L steps before. The voltage
//! droop alike. Looked at are increments, which a static offset of the plant does not reach.

use super::error::Problems;
use serde::{Deserialize, Serialize};

/// The longest lag looked for, steps.
pub const LONGEST: usize = 3;
/// Number of lags looked for.
const CANDIDATES: usize = LONGEST + 1;
/// What evidence is worth one moving step later.
const FORGETTING: f64 = 0.95;
/// Another lag is believed when it misses the measurements this much less than the present one.
const CLEARLY_LESS: f64 = 0.5;
/// A lag explains the measurements when it misses them by less than this share of what the worst lag does.
const EXPLAINED: f64 = 0.01;
/// Differences between lags below this many roundings of the numbers they come from say nothing.
const ROUNDINGS: f64 = 4096.0;

/// The frequency or voltage that a droop (3) would have at no load, pu: sigma_i of setpoint and power reference,
/// y_i of measured level and power.
pub fn no_load(level: f64, droop: f64, power: f64) -> f64 {
    level + droop * power
}

/// The lag of one droop, common to all agents: it is the master's, and both ends of an edge must see the same
/// boundary layer.
///
/// Until setpoints move it is 0, and the law is DESIGN's to the letter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lag {
    steps: usize,
    /// sigma of the last steps, the newest first.
    past: [Vec<f64>; CANDIDATES],
    /// y of the last step.
    last: Vec<f64>,
    /// How much each lag missed of the measurements, weighted sum of squares, each square a share of the worst.
    missed: [f64; CANDIDATES],
    /// Weighted number of measurements that said something.
    weight: f64,
}

impl Lag {
    /// No lag, from constant sigma in the past.
    pub fn new(sigma: &[f64]) -> Self {
        Self {
            steps: 0,
            past: std::array::from_fn(|_| sigma.to_vec()),
            last: vec![0.0; sigma.len()],
            missed: [0.0; CANDIDATES],
            weight: 0.0,
        }
    }

    /// The lag, steps.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Whether droop and lag account for what is measured. Not so with a plant that has dynamics of its own
    /// between setpoint and measurement: a lag is still found then, as the nearest number of steps.
    fn explains(&self) -> bool {
        self.missed[self.steps] <= EXPLAINED * self.weight
    }

    /// What the measured omega_i (V_i) does not show yet, pu: the moves of the agent's own setpoint that were
    /// made since, `sigma` being the present one. With it omega_i is that of the present setpoint, and lag
    /// costs neither stability nor speed. 0 where the droop does not explain the measurements.
    pub fn unseen(&self, i: usize, sigma: f64) -> f64 {
        if self.steps == 0 || !self.explains() { 0.0 } else { sigma - self.past[self.steps - 1][i] }
    }

    /// By how much the step counts in the boundary layer, theta = max(widening h, theta_min): 1 + lag where the
    /// lag must be sat out, because the moves cannot be told apart from the plant's own dynamics, else 1.
    pub fn widening(&self) -> f64 {
        if self.explains() { 1.0 } else { self.loop_steps() }
    }

    /// 1 + lag: the steps after which an action shows in the measurements, for the energy, which nothing foretells.
    pub fn loop_steps(&self) -> f64 {
        1.0 + self.steps as f64
    }

    /// Learns from the measurements `y` of a step in which sigma was `sigma`; true when the lag is another one
    /// now. `compare` is false when there is no step before to compare with. Allocates nothing.
    pub fn observe(
        &mut self,
        live: &[bool],
        compare: bool,
        y: impl Fn(usize) -> f64,
        sigma: impl Fn(usize) -> f64,
    ) -> bool {
        let (mut missed, mut weight) = ([0.0; CANDIDATES], 0.0);
        for i in 0..live.len() {
            let (y, sigma) = (y(i), sigma(i));
            if compare && live[i] {
                let mut later = sigma;
                let mut errors = [y - self.last[i]; CANDIDATES];
                for (error, past) in errors.iter_mut().zip(&self.past) {
                    *error = (*error - (later - past[i])).abs();
                    later = past[i];
                }
                let worst = errors.iter().copied().fold(0.0, f64::max);
                let best = errors.iter().copied().fold(f64::INFINITY, f64::min);
                // At rest and at constant speed all lags are alike: the one found is held.
                if worst - best > ROUNDINGS * f64::EPSILON * (y.abs() + sigma.abs()) {
                    // As shares, so that one wild measurement weighs no more than another.
                    missed.iter_mut().zip(errors).for_each(|(sum, error)| *sum += (error / worst).powi(2));
                    weight += 1.0;
                }
            }
            self.last[i] = y;
            self.past[LONGEST][i] = sigma;
        }
        self.past.rotate_right(1);
        if weight == 0.0 {
            return false;
        }
        for (sum, now) in self.missed.iter_mut().zip(missed) {
            *sum = FORGETTING * *sum + now;
        }
        self.weight = FORGETTING * self.weight + weight;
        let best =
            (1..CANDIDATES).fold(0, |best, k| if self.missed[k] < self.missed[best] { k } else { best });
        let changes = self.missed[best] < CLEARLY_LESS * self.missed[self.steps];
        if changes {
            self.steps = best;
        }
        changes
    }

    /// Whether this fits `n` agents.
    pub(super) fn check(&self, n: usize, path: &str, problems: &mut Problems) {
        let fits =
            self.past.iter().chain([&self.last]).all(|x| x.len() == n && x.iter().all(|x| x.is_finite()))
                && self.missed.iter().chain([&self.weight]).all(|x| x.is_finite() && *x >= 0.0);
        if !fits || self.steps > LONGEST {
            let found = format!("lag {} and arrays that do not fit", self.steps);
            problems.add(path, found, format!("at most {LONGEST} steps, finite values of {n} agents"));
        }
    }
}

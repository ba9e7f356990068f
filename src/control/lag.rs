//! How late the measurements are. A master tells the controller what the plant made of the setpoints of 0 to 3
//! steps ago (one that passes outputs on at once 0; Ecos and PyFMI 1; FMPy's and libcosim's loops 2), and nothing
//! in FMI says which. A law that takes a late measurement for a present one makes its last moves again, and the
//! more steps late, the wider it oscillates. So each droop finds the lag by itself and allows for it. Knows the
//! agents' own setpoints and measurements; never a graph, never a clock.
//!
//! What gives the lag L away is (3): omega_i(t_k) = omega_set_i(t_{k-L}) - K_P_i (P_i - P_set_i(t_{k-L})). So the
//! measured frequency at no load, y_i = omega_i + K_P_i P_i, moves as the one that was set, sigma_i = omega_set_i +
//! K_P_i P_set_i, moved L steps before. Only the moves are compared: a static offset of the plant is none.
//!
//! Two ways to allow for it. Where (3) explains what is measured, an agent adds the moves of its own setpoint that
//! its measurement does not show yet, and is where it would be without lag, at the speed of no lag. Where it does
//! not, because something with dynamics of its own measures, nobody knows what is still to come; then the boundary
//! layer is made as wide as it takes an action to show. Measured on the 57-bus grid, 28 s after enabling with
//! steps of 100 ms, lag 3: abs(omega - 1) 3e-9 the first way, 1e-5 the second, 0.3 without either.

use super::error::Problems;
use super::lanes::{LANES, Lanes, load_few, store_few};
use serde::{Deserialize, Serialize};

/// The longest lag looked for, steps.
pub const LONGEST: usize = 3;
/// Number of lags looked for.
const CANDIDATES: usize = LONGEST + 1;
/// What evidence is worth one moving step later.
const FORGETTING: f64 = 0.95;
/// Another lag is believed when it misses the measurements this much less than the present one.
const CLEARLY_LESS: f64 = 0.5;
/// A lag explains the measurements when it misses less than this of what the worst one misses, in squares.
const EXPLAINED: f64 = 1e-3;
/// Differences between lags below this many roundings of the numbers they come from say nothing.
const ROUNDINGS: f64 = 4096.0;

/// Agents that give evidence, about. The lag is the master's and so common to all: of more agents, those of some
/// stretches do, spread evenly.
const WITNESSES: usize = 8192;
/// Agents of a stretch.
const STRETCH: usize = 256;

/// Evidence of one step, every eighth agent together.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    missed: [[f64; LANES]; CANDIDATES],
    weight: [f64; LANES],
}

impl Tally {
    /// Agents side by side: which of them count, as 0 and 1, y now and at the last step, sigma now and before.
    #[inline(always)]
    fn take(
        &mut self,
        counted: &Lanes,
        y: &[f64; LANES],
        last: &[f64; LANES],
        sigma: &[[f64; LANES]; CANDIDATES + 1],
    ) {
        for lane in 0..LANES {
            let moved = y[lane] - last[lane];
            let mut errors = [0.0; CANDIDATES];
            for k in 0..CANDIDATES {
                errors[k] = (moved - (sigma[k][lane] - sigma[k + 1][lane])).abs();
            }
            let (mut worst, mut best) = (errors[0], errors[0]);
            for k in 1..CANDIDATES {
                worst = if errors[k] > worst { errors[k] } else { worst };
                best = if errors[k] < best { errors[k] } else { best };
            }
            // At rest and at constant speed all lags are alike: the one found is held.
            let tells = worst - best > ROUNDINGS * f64::EPSILON * (y[lane].abs() + sigma[0][lane].abs());
            let counts = if tells { counted[lane] } else { 0.0 };
            // As shares, so that one wild measurement weighs no more than another.
            let share = counts / if counts > 0.0 { worst } else { 1.0 };
            for k in 0..CANDIDATES {
                self.missed[k][lane] += (errors[k] * share) * (errors[k] * share);
            }
            self.weight[lane] += counts;
        }
    }
}

/// [`no_load`] of agents side by side.
#[inline(always)]
pub(super) fn no_loads(level: &Lanes, droop: &Lanes, power: &Lanes) -> Lanes {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = no_load(level[lane], droop[lane], power[lane]);
    }
    out
}

/// The frequency or voltage that a droop (3) would have at no load, pu: sigma_i of setpoint and power reference,
/// y_i of measured level and power.
#[inline(always)]
pub fn no_load(level: f64, droop: f64, power: f64) -> f64 {
    level + droop * power
}

/// Adds to the levels of some agents what they do not show yet, pu; `shown` is the sigma that they do show.
#[inline(always)]
pub(super) fn reveal(level: &mut [f64], shown: &[f64], (set, droop, power_set): (&[f64], &[f64], &[f64])) {
    let n = level.len();
    let (shown, set, droop, power_set) = (&shown[..n], &set[..n], &droop[..n], &power_set[..n]);
    for i in 0..n {
        level[i] += no_load(set[i], droop[i], power_set[i]) - shown[i];
    }
}

/// sigma of some agents.
#[inline(always)]
fn remember(past: &mut [f64], set: &[f64], droop: &[f64], power_set: &[f64]) {
    for (past, ((&set, &droop), &power_set)) in past.iter_mut().zip(set.iter().zip(droop).zip(power_set)) {
        *past = no_load(set, droop, power_set);
    }
}

/// The lag of one droop, common to all agents: it is the master's, and both ends of an edge must see the same
/// boundary layer. As long as it is 0 the law is DESIGN's to the letter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lag {
    steps: usize,
    /// sigma of the last steps, the newest first.
    pub(super) past: [Vec<f64>; CANDIDATES],
    /// y of the last step, of those who give evidence.
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

    /// Whether (3) with this lag accounts for what is measured.
    fn explains(&self) -> bool {
        self.missed[self.steps] <= EXPLAINED * self.weight
    }

    /// What agent `i`'s measured omega_i (V_i) does not show yet, pu: the moves of its own setpoint since, `sigma`
    /// being the present one. 0 where (3) does not explain the measurements.
    pub fn unseen(&self, i: usize, sigma: f64) -> f64 {
        if self.adds_unseen() { sigma - self.past[self.steps - 1][i] } else { 0.0 }
    }

    /// The sigma of all agents that the measurements show, pu, where [`Self::adds_unseen`].
    pub(super) fn shown(&self) -> Option<&[f64]> {
        self.steps.checked_sub(1).and_then(|k| self.past.get(k)).map(Vec::as_slice)
    }

    /// [`Self::unseen`] of agents side by side, where [`Self::adds_unseen`].
    #[inline(always)]
    pub(super) fn unseen_few(&self, sigma: &Lanes) -> Lanes {
        let past = self.shown().map_or(*sigma, load_few);
        let mut unseen = *sigma;
        for lane in 0..LANES {
            unseen[lane] -= past[lane];
        }
        unseen
    }

    /// Whether [`Self::unseen`] moves with one's own setpoint.
    pub fn adds_unseen(&self) -> bool {
        self.steps > 0 && self.explains()
    }

    /// How many steps the boundary layer spans, theta = max(widening h, theta_min): 1 where what is still to come
    /// is added, else as many as it takes to see it.
    pub fn widening(&self) -> f64 {
        if self.explains() { 1.0 } else { self.loop_steps() }
    }

    /// Steps until an action shows in the measurements, 1 + lag. The energy exchange spans them always: its own
    /// moves do not show in the energy but by and by.
    pub fn loop_steps(&self) -> f64 {
        1.0 + self.steps as f64
    }

    /// Learns from a step whose measurements were `levels.0` beside setpoints `levels.1`, with these droops, and the
    /// powers measured and asked for. `compare` is false when there is no step before to compare with.
    /// Allocates nothing.
    pub fn observe(
        &mut self,
        (live, compare): (&[bool], bool),
        levels: (&[f64], &[f64]),
        powers: (&[f64], &[f64], &[f64]),
    ) {
        let mut tally = Tally::default();
        self.note(&mut tally, (0, live.len()), (live, compare), levels, powers);
        self.conclude(tally);
    }

    /// The same for agents `from..to`, `from` being a multiple of [`STRETCH`], up to the conclusion.
    #[inline(always)]
    pub(super) fn note(
        &mut self,
        tally: &mut Tally,
        (from, to): (usize, usize),
        (live, compare): (&[bool], bool),
        (level, set): (&[f64], &[f64]),
        (droop, power, power_set): (&[f64], &[f64], &[f64]),
    ) {
        let every = live.len().div_ceil(WITNESSES).max(1);
        for first in (from..to).step_by(STRETCH) {
            let r = first..to.min(first + STRETCH);
            if (first / STRETCH).is_multiple_of(every) {
                let (levels, powers) =
                    ((&level[r.clone()], &set[r.clone()]), (&power[r.clone()], &power_set[r.clone()]));
                self.hear(tally, first, (&live[r.clone()], compare), levels, (&droop[r.clone()], powers));
            }
            let [.., past] = &mut self.past;
            remember(&mut past[r.clone()], &set[r.clone()], &droop[r.clone()], &power_set[r]);
        }
    }

    /// The evidence of agents from `first` on.
    #[inline(always)]
    fn hear(
        &mut self,
        tally: &mut Tally,
        first: usize,
        (live, compare): (&[bool], bool),
        (level, set): (&[f64], &[f64]),
        (droop, (power, power_set)): (&[f64], (&[f64], &[f64])),
    ) {
        let count = live.len();
        let past = self.past.each_ref().map(|past| &past[first..first + count]);
        let last = &mut self.last[first..first + count];
        for base in (0..count).step_by(LANES) {
            let at = base..count.min(base + LANES);
            let load = |values: &[f64]| {
                let mut lanes = [0.0; LANES];
                match values[at.clone()].as_array() {
                    Some(whole) => lanes = *whole,
                    None => lanes[..at.len()].copy_from_slice(&values[at.clone()]),
                }
                lanes
            };
            let mut counted = [0.0; LANES];
            for (counted, &live) in counted.iter_mut().zip(&live[at.clone()]) {
                *counted = if compare & live { 1.0 } else { 0.0 };
            }
            let droop = load(droop);
            let (y, sigma) = (
                no_loads(&load(level), &droop, &load(power)),
                no_loads(&load(set), &droop, &load(power_set)),
            );
            let pasts = [sigma, load(past[0]), load(past[1]), load(past[2]), load(past[3])];
            tally.take(&counted, &y, &load(last), &pasts);
            last[at.clone()].copy_from_slice(&y[..at.len()]);
        }
    }

    /// As [`Self::observe`] for as many agents as go side by side; `counted` counts each
    /// once.
    #[inline(always)]
    pub(super) fn observe_few(&mut self, counted: &Lanes, y: &Lanes, sigma: &Lanes) {
        let mut tally = Tally::default();
        let [first, second, third, fourth] = &mut self.past;
        let pasts = [*sigma, load_few(first), load_few(second), load_few(third), load_few(fourth)];
        tally.take(counted, y, &load_few(&self.last), &pasts);
        store_few(y, &mut self.last);
        // Takes less than to let the vectors change places.
        for (past, values) in [first, second, third, fourth].into_iter().zip(&pasts) {
            store_few(values, past);
        }
        self.weigh(tally);
    }

    /// Draws the conclusion when all agents are noted.
    pub(super) fn conclude(&mut self, tally: Tally) {
        // As rotate_right(1), which would be a call.
        for k in (1..CANDIDATES).rev() {
            self.past.swap(k - 1, k);
        }
        self.weigh(tally);
    }

    #[inline(always)]
    fn weigh(&mut self, tally: Tally) {
        let (mut missed, mut weight) = ([0.0; CANDIDATES], 0.0);
        for lane in 0..LANES {
            for k in 0..CANDIDATES {
                missed[k] += tally.missed[k][lane];
            }
            weight += tally.weight[lane];
        }
        if weight == 0.0 {
            return;
        }
        for (sum, now) in self.missed.iter_mut().zip(missed) {
            *sum = FORGETTING * *sum + now;
        }
        self.weight = FORGETTING * self.weight + weight;
        let (mut best, mut least) = (0, self.missed[0]);
        for k in 1..CANDIDATES {
            (best, least) = if self.missed[k] < least { (k, self.missed[k]) } else { (best, least) };
        }
        let clearly = least < CLEARLY_LESS * self.missed[self.steps];
        // What has dynamics of its own looks late by now more, now fewer steps: the most is the safe one.
        if clearly && (best > self.steps || least <= EXPLAINED * self.weight) {
            self.steps = best;
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A setpoint that moves and slows down, as consensus does.
    fn sigma(k: usize) -> f64 {
        1.0 + 1e-3 * 0.8_f64.powi(k as i32)
    }

    /// What is found after measurements `y(k)` of one agent.
    fn after(steps: usize, y: impl Fn(usize) -> f64) -> Lag {
        let mut lag = Lag::new(&[sigma(0)]);
        for k in 0..steps {
            lag.observe((&[true], k > 0), (&[y(k)], &[sigma(k)]), (&[0.0], &[0.0], &[0.0]));
        }
        lag
    }

    #[test]
    fn a_delayed_droop_is_found_within_its_lag_and_the_unseen_moves_are_exact() {
        for late in 0..=LONGEST {
            // An offset of the plant is nobody's lag.
            let lag = after(2 + late, |k| sigma(k.saturating_sub(late)) - 0.01);
            assert_eq!((lag.steps(), lag.widening()), (late, 1.0));
            let next = 2 + late;
            assert!((lag.unseen(0, sigma(next)) - (sigma(next) - sigma(2))).abs() < 1e-16, "{late}");
        }
    }

    #[test]
    fn rest_constant_speed_and_measurements_of_something_else_say_nothing() {
        let mut lag = Lag::new(&[1.0]);
        for k in 0..100 {
            lag.observe((&[true], k > 0), (&[1.0], &[1.0]), (&[0.0], &[0.0], &[0.0]));
        }
        assert_eq!(lag, Lag { last: vec![1.0], ..Lag::new(&[1.0]) });
        let ramp = |k: usize| 1.0 + 0.125 * k as f64;
        let mut lag = Lag { past: std::array::from_fn(|k| vec![1.0 - 0.125 * (k + 1) as f64]), ..lag };
        for k in 0..100 {
            lag.observe((&[true], k > 0), (&[ramp(k)], &[ramp(k)]), (&[0.0], &[0.0], &[0.0]));
        }
        assert_eq!((lag.steps(), lag.weight), (0, 0.0));
        // A frequency that goes its own way, large against the setpoint's moves.
        let lag = after(100, |k| 1.0 + 0.1 * (1.7 * k as f64).sin());
        assert_eq!(lag.steps(), 0);
    }

    #[test]
    fn what_the_droop_does_not_explain_is_sat_out() {
        // A measurement through a filter of two steps: some lag, but no moves to add.
        let filtered = |k: usize| (1..=k).fold(sigma(0), |y, k| y + (1.0 - f64::exp(-0.5)) * (sigma(k) - y));
        let lag = after(20, filtered);
        assert!((1..=3).contains(&lag.steps()), "{}", lag.steps());
        assert_eq!((lag.unseen(0, 7.0), lag.widening()), (0.0, lag.loop_steps()));
    }

    #[test]
    fn a_lag_of_another_process_is_looked_through() {
        let good = after(5, sigma);
        let check = |lag: &Lag, n: usize| {
            let mut problems = Problems::default();
            lag.check(n, "lag", &mut problems);
            problems.into_result().is_ok()
        };
        assert!(check(&good, 1) && !check(&good, 2));
        assert!(!check(&Lag { steps: 4, ..good.clone() }, 1));
        assert!(!check(&Lag { weight: f64::NAN, ..good.clone() }, 1));
        assert!(!check(&Lag { last: vec![f64::INFINITY], ..good }, 1));
    }
}

//! What an agent knows of another: the ring of past values by sample time, looked up at t - tau with
//! linear interpolation. Equation (34). Allocates only in `new`.

use super::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// The quantities that agents tell their neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// omega_i, pu.
    Omega,
    /// p_i = K_P_i (P_i - P_set_i), pu.
    P,
    /// V_i, pu.
    V,
    /// q_i = K_Q_i (Q_i - Q_set_i), pu.
    Q,
    /// E_i / C_i.
    Soc,
    /// The estimate of the mean voltage, pu.
    MeanV,
    /// P_i - P_set_i without the exchange's own moves, pu.
    Share,
}

/// Number of quantities.
pub(super) const QUANTITIES: usize = 7;
/// The slot number of the present values, which are not in the ring yet.
const PRESENT: u32 = u32::MAX;
/// Upper bound of the stored values of all slots together; the number of slots follows from it.
const VALUES: usize = 8_000_000;

/// The present values of all agents, by quantity.
#[derive(Clone, Debug, Default)]
pub struct Signals<S = f64>(pub [Vec<S>; QUANTITIES]);

impl<S: Scalar> Signals<S> {
    /// Zeros for `n` agents.
    pub fn new(n: usize) -> Self {
        Self(std::array::from_fn(|_| vec![S::constant(0.0); n]))
    }

    /// The values of one quantity.
    pub fn of(&self, quantity: Quantity) -> &[S] {
        &self.0[quantity as usize]
    }

    /// The values of one quantity, to be written.
    pub fn of_mut(&mut self, quantity: Quantity) -> &mut [S] {
        &mut self.0[quantity as usize]
    }
}

/// Where between two samples a point in time lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bracket {
    before: u32,
    after: u32,
    fraction: f64,
    /// How fast the fraction falls when the point gets later by a second, 1/s; 0 where a sample is held.
    per_s: f64,
}

impl Bracket {
    /// The present.
    pub const NOW: Self = Self { before: PRESENT, after: PRESENT, fraction: 0.0, per_s: 0.0 };

    /// The same point, but fixed: no delay moves it.
    pub fn fixed(self) -> Self {
        Self { per_s: 0.0, ..self }
    }
}

/// Past samples of all quantities of all agents.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct History {
    n: usize,
    times: Vec<i64>,
    values: Vec<f64>,
    /// The estimator's transfers at these times, edge by edge; empty while nobody asks for past ones.
    transfers: Vec<f64>,
    /// Slot of the oldest sample.
    oldest: usize,
    len: usize,
    /// Samples closer than this are thinned out, so that the ring spans the horizon at any step size.
    spacing_ns: i64,
}

impl History {
    /// A ring for `n` agents that reaches back at least `horizon_ns`; without slots when that is zero.
    pub fn new(n: usize, horizon_ns: i64) -> Self {
        let mut history = Self { n, ..Self::default() };
        history.reach(horizon_ns);
        history
    }

    /// Number of slots of a ring in use for `n` agents: up to 1024, fewer for very many agents.
    fn slots_for(n: usize) -> usize {
        (VALUES / (QUANTITIES * n.max(1))).clamp(16, 1024)
    }

    /// Makes the ring reach back at least `horizon_ns`, keeping the samples there are; it allocates
    /// the first time only.
    pub fn reach(&mut self, horizon_ns: i64) {
        if horizon_ns <= 0 {
            return;
        }
        let slots = Self::slots_for(self.n);
        if self.times.is_empty() {
            self.times = vec![0; slots];
            self.values = vec![0.0; slots * QUANTITIES * self.n];
        }
        self.spacing_ns = Self::spacing(slots, horizon_ns);
    }

    /// Two slots are the ends of the span, one is the newest sample, which thinning may move.
    fn spacing(slots: usize, horizon_ns: i64) -> i64 {
        horizon_ns / (slots as i64 - 3) + 1
    }

    /// Whether [`Self::reach`] and [`Self::keep_transfers`] would change nothing.
    pub fn has_room(&self, horizon_ns: i64, edges: usize) -> bool {
        let reaches = horizon_ns <= 0
            || (self.is_kept() && self.spacing_ns == Self::spacing(self.times.len(), horizon_ns));
        reaches && (edges == 0 || self.transfers.len() == self.times.len() * edges)
    }

    /// Keeps the transfers of `edges` edges from now on, as 0 in the past unless they were kept already; 0 leaves
    /// things as they are.
    pub fn keep_transfers(&mut self, edges: usize) {
        let needed = self.times.len() * edges;
        if edges > 0 && self.transfers.len() != needed {
            self.transfers = vec![0.0; needed];
        }
    }

    /// Lets `carry` take the past transfers over to another graph; it is given the number of values per edge.
    pub fn carry_transfers(&mut self, carry: impl FnOnce(usize, &[f64]) -> Vec<f64>) {
        self.transfers = carry(self.times.len(), &self.transfers);
    }

    /// Whether the transfers kept, if any, are finite and those of `edges` edges.
    pub fn transfers_fit(&self, edges: usize) -> bool {
        (self.transfers.is_empty() || self.transfers.len() == self.times.len() * edges)
            && self.transfers.iter().all(|x| x.is_finite())
    }

    /// Whether the arrays fit `n` agents and each other, and all values are finite.
    pub fn fits(&self, n: usize) -> bool {
        let slots = self.times.len();
        self.n == n
            && (slots == 0 || slots == Self::slots_for(n))
            && self.values.len() == slots * QUANTITIES * n
            && self.len <= slots
            && (self.oldest < slots || (slots == 0 && self.oldest == 0))
            && self.spacing_ns >= 0
            && self.values.iter().all(|x| x.is_finite())
            && (1..self.len).all(|k| self.time(k - 1) < self.time(k))
            && self.len.checked_sub(1).is_none_or(|last| self.time(last).checked_sub(self.time(0)).is_some())
    }

    /// Whether samples are kept at all.
    pub fn is_kept(&self) -> bool {
        !self.times.is_empty()
    }

    /// Number of samples kept.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Time of the newest sample, ns.
    pub fn newest_ns(&self) -> Option<i64> {
        self.len.checked_sub(1).map(|last| self.time(last))
    }

    /// The same point for whom the newest sample is only arriving: it is told with the present.
    pub(super) fn arriving(&self, at: Bracket) -> Bracket {
        let Some(last) = self.len.checked_sub(1) else { return at };
        let newest = self.slot(last) as u32;
        let told = |slot: u32| if slot == newest { PRESENT } else { slot };
        Bracket { before: told(at.before), after: told(at.after), ..at }
    }

    /// Puts what `signals` hold of agent `i` in the place of its newest sample.
    pub(super) fn amend(&mut self, i: usize, signals: &Signals) {
        let Some(last) = self.len.checked_sub(1) else { return };
        let slot = self.slot(last);
        for (q, values) in signals.0.iter().enumerate() {
            self.values[(slot * QUANTITIES + q) * self.n + i] = values[i];
        }
    }

    fn slot(&self, k: usize) -> usize {
        (self.oldest + k) % self.times.len()
    }

    fn time(&self, k: usize) -> i64 {
        self.times[self.slot(k)]
    }

    /// Adds the sample of `t_ns`: the signals, and by edge the transfers where they are kept. A later one that
    /// is there already comes from a run that was rolled back, and goes.
    pub fn push(&mut self, t_ns: i64, signals: &Signals, transfers: &[f64]) {
        if self.times.is_empty() {
            return;
        }
        while self.len > 0 && self.time(self.len - 1) >= t_ns {
            self.len -= 1;
        }
        if self.len >= 2 && self.time(self.len - 1) - self.time(self.len - 2) < self.spacing_ns {
            self.len -= 1;
        }
        if self.len == self.times.len() {
            self.oldest = self.slot(1);
            self.len -= 1;
        }
        let slot = self.slot(self.len);
        self.len += 1;
        self.times[slot] = t_ns;
        for (q, values) in signals.0.iter().enumerate() {
            let start = (slot * QUANTITIES + q) * self.n;
            self.values[start..start + self.n].copy_from_slice(values);
        }
        for (past, &z) in self.transfers.chunks_exact_mut(self.times.len()).zip(transfers) {
            past[slot] = z;
        }
    }

    /// Where time `t_ns` lies, the present being `now_ns`; before the first sample the first is held.
    pub fn bracket(&self, now_ns: i64, t_ns: i64) -> Bracket {
        if t_ns >= now_ns || self.len == 0 {
            return Bracket::NOW;
        }
        let (mut low, mut high) = (0, self.len - 1);
        if t_ns <= self.time(low) {
            let slot = self.slot(low) as u32;
            return Bracket { before: slot, after: slot, fraction: 0.0, per_s: 0.0 };
        }
        let newest = self.time(high);
        if t_ns >= newest {
            let span = now_ns.saturating_sub(newest) as f64;
            let (fraction, per_s) = (t_ns.saturating_sub(newest) as f64 / span, 1e9 / span);
            return Bracket { before: self.slot(high) as u32, after: PRESENT, fraction, per_s };
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            if self.time(middle) <= t_ns { low = middle } else { high = middle }
        }
        let (before, after) = (self.time(low), self.time(high));
        let span = (after - before) as f64;
        let (fraction, per_s) = ((t_ns - before) as f64 / span, 1e9 / span);
        Bracket { before: self.slot(low) as u32, after: self.slot(high) as u32, fraction, per_s }
    }

    fn stored<S: Scalar>(&self, slot: u32, quantity: Quantity, i: usize, present: &[S]) -> S {
        if slot == PRESENT {
            present[i]
        } else {
            S::constant(self.values[(slot as usize * QUANTITIES + quantity as usize) * self.n + i])
        }
    }

    /// Agent `i`'s value at the bracketed time; `present` holds the quantity's present values.
    pub fn value<S: Scalar>(&self, bracket: Bracket, quantity: Quantity, i: usize, present: &[S]) -> S {
        self.value_late(bracket, quantity, i, present, S::constant(0.0))
    }

    /// The same `late` s earlier, within the bracket. At a sample its slope is that of the time after it.
    pub fn value_late<S: Scalar>(
        &self,
        bracket: Bracket,
        quantity: Quantity,
        i: usize,
        present: &[S],
        late: S,
    ) -> S {
        let before = self.stored(bracket.before, quantity, i, present);
        if bracket.fraction == 0.0 && (bracket.per_s == 0.0 || !S::CARRIES_TANGENT) {
            return before;
        }
        let after = self.stored(bracket.after, quantity, i, present);
        let fraction = S::constant(bracket.fraction) - late * S::constant(bracket.per_s);
        before + fraction * (after - before)
    }

    /// The transfer of edge `e` at the bracketed time; `present` are the present ones. Where none are kept
    /// the past is as the present.
    pub fn transfer(&self, bracket: Bracket, e: usize, present: &[f64]) -> f64 {
        let kept = self.transfers.get(e * self.times.len()..).unwrap_or_default();
        let stored = |slot: u32| match kept.get(slot as usize) {
            Some(&z) if slot != PRESENT => z,
            _ => present[e],
        };
        let before = stored(bracket.before);
        before + bracket.fraction * (stored(bracket.after) - before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(history: &History, now_ns: i64, t_ns: i64, present: f64) -> f64 {
        history.value(history.bracket(now_ns, t_ns), Quantity::V, 0, &[present])
    }

    fn signal(v: f64) -> Signals {
        let mut signals = Signals::new(1);
        signals.of_mut(Quantity::V)[0] = v;
        signals
    }

    #[test]
    fn a_straight_line_is_interpolated_exactly_and_held_before_its_start() {
        let mut history = History::new(1, 500);
        assert_eq!(look(&history, 0, -500, 7.0), 7.0);
        for t in (0..5000).step_by(100) {
            history.push(t, &signal(t as f64), &[]);
        }
        assert_eq!(look(&history, 5000, 4500, 5000.0), 4500.0);
        assert_eq!(look(&history, 5000, 4550, 5000.0), 4550.0);
        assert_eq!(look(&history, 5000, 4950, 5000.0), 4950.0, "between the newest sample and the present");
        assert_eq!(look(&history, 5000, -50, 5000.0), 0.0);
    }

    #[test]
    fn steps_far_finer_than_the_ring_still_reach_back_the_whole_delay() {
        let mut history = History::new(1, 500_000_000);
        for t in (0..2_000_000_000).step_by(10_000) {
            history.push(t, &signal(t as f64), &[]);
        }
        assert!(history.len() <= 1024);
        let found = look(&history, 2_000_000_000, 1_500_000_000, 2e9);
        assert!((found - 1.5e9).abs() < 1.0, "{found}");
    }

    #[test]
    fn a_rolled_back_run_leaves_nothing_behind() {
        let mut history = History::new(1, 500);
        for t in [0, 100, 200, 300] {
            history.push(t, &signal(1.0), &[]);
        }
        history.push(200, &signal(5.0), &[]);
        assert_eq!(history.len(), 3);
        assert_eq!(look(&history, 300, 200, 9.0), 5.0);
    }
}

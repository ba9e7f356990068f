//! The communication points: start + k * step, the times of events, the end. Counted in ns, so that
//! no point is missed or doubled, however many there are.

use serde::{Deserialize, Serialize};

/// Where the master stands.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    start_ns: i64,
    stop_ns: i64,
    step_ns: i64,
    /// Regular points up to and including the present time, minus one.
    k: i64,
    now_ns: i64,
}

/// The part of a [`Schedule`] that moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Standing {
    pub now_ns: i64,
    k: i64,
}

impl Schedule {
    pub fn standing(&self) -> Standing {
        Standing { now_ns: self.now_ns, k: self.k }
    }

    /// Moves to where the schedule of an equal run stood.
    pub fn stand_at(&mut self, standing: Standing) {
        Standing { now_ns: self.now_ns, k: self.k } = standing;
    }

    /// Stands at `start_ns`; `step_ns` > 0 and `stop_ns` >= `start_ns` are the caller's business.
    pub fn new(start_ns: i64, stop_ns: i64, step_ns: i64) -> Self {
        Self { start_ns, stop_ns, step_ns, k: 0, now_ns: start_ns }
    }

    pub fn now_ns(&self) -> i64 {
        self.now_ns
    }

    /// The number of this communication point, if it is a regular one.
    pub fn regular(&self) -> Option<u64> {
        (self.now_ns == self.regular_ns(self.k)).then_some(self.k as u64)
    }

    pub fn is_last(&self) -> bool {
        self.now_ns >= self.stop_ns
    }

    fn regular_ns(&self, k: i64) -> i64 {
        self.start_ns.saturating_add(k.saturating_mul(self.step_ns))
    }

    /// The next point, given the time of the next event.
    pub fn next_ns(&self, event_ns: Option<i64>) -> i64 {
        self.regular_ns(self.k + 1).min(event_ns.unwrap_or(i64::MAX)).min(self.stop_ns)
    }

    /// Moves to a point of [`Schedule::next_ns`].
    pub fn advance(&mut self, to_ns: i64) {
        self.now_ns = to_ns;
        if to_ns >= self.regular_ns(self.k + 1) {
            self.k += 1;
        }
    }

    /// Whether this time is start + k * step, so that no step is cut for it.
    pub fn is_regular(&self, at_ns: i64) -> bool {
        (i128::from(at_ns) - i128::from(self.start_ns)) % i128::from(self.step_ns) == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(start: i64, stop: i64, step: i64, events: &[i64]) -> Vec<(i64, Option<u64>)> {
        let mut schedule = Schedule::new(start, stop, step);
        let mut points = vec![(schedule.now_ns(), schedule.regular())];
        while !schedule.is_last() {
            let next = events.iter().copied().find(|at| *at > schedule.now_ns());
            schedule.advance(schedule.next_ns(next));
            points.push((schedule.now_ns(), schedule.regular()));
        }
        points
    }

    #[test]
    fn events_cut_steps_and_the_grid_stays_where_it_was() {
        let expected =
            [(-10, Some(0)), (-3, None), (0, Some(1)), (10, Some(2)), (20, Some(3)), (21, None), (25, None)];
        assert_eq!(walk(-10, 25, 10, &[-10, -3, 10, 21, 40]), expected);
    }

    #[test]
    fn nothing_overflows_at_the_end_of_time() {
        assert_eq!(
            walk(i64::MAX - 25, i64::MAX, 10, &[]).iter().map(|(t, _)| i64::MAX - t).collect::<Vec<_>>(),
            [25, 15, 5, 0]
        );
    }
}

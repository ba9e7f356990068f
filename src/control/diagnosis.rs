//! Spreads, errors and norms of the agents' signals, gathered chunk by chunk of [`CHUNK`] agents, so that it does
//! not matter whether the whole or a part of the agents is looked at together.

use super::wave::{CHUNK, Line};

/// Number of signals: omega, p, V, q, SoC, and what else stands in a line.
const SIGNALS: usize = 8;
/// Places of the signals.
const OMEGA: usize = 0;
const P: usize = 1;
const V: usize = 2;
const Q: usize = 3;
const SOC: usize = 4;

/// One agent.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Whether it is available.
    pub available: bool,
    /// Whether it takes part.
    pub live: bool,
    /// p_i, pu, as told to the neighbours.
    pub told_p: f64,
    /// Its own omega, p, V, q, SoC; the rest is not looked at.
    pub own: Line,
}

/// What is known of the agents seen so far.
#[derive(Clone, Copy, Debug)]
pub struct Diagnosis {
    omega_ref: f64,
    V_ref: f64,
    /// Where p is to go; `None`: to its mean.
    goal: Option<f64>,
    /// Least and largest of each signal of the available agents.
    low: [f64; SIGNALS],
    high: [f64; SIGNALS],
    /// Number of live agents, mean of their p, sum of squares about it or about the goal.
    live: f64,
    mean: f64,
    squares_p: f64,
    squares_omega: f64,
}

impl Diagnosis {
    /// Of nobody.
    pub fn new(omega_ref: f64, V_ref: f64, goal: Option<f64>) -> Self {
        Self {
            omega_ref,
            V_ref,
            goal,
            low: [f64::INFINITY; SIGNALS],
            high: [f64::NEG_INFINITY; SIGNALS],
            live: 0.0,
            mean: 0.0,
            squares_p: 0.0,
            squares_omega: 0.0,
        }
    }

    /// Takes agents `from..to`, `from` being a multiple of [`CHUNK`].
    #[inline(always)]
    pub fn take(&mut self, from: usize, to: usize, of: impl Fn(usize) -> Seen) {
        for from in (from..to).step_by(CHUNK) {
            self.take_chunk(from, to.min(from + CHUNK), &of);
        }
    }

    #[inline(always)]
    fn take_chunk(&mut self, from: usize, to: usize, of: &impl Fn(usize) -> Seen) {
        let (mut live, mut sum) = (0.0, 0.0);
        for i in from..to {
            let seen = of(i);
            if seen.available {
                for k in 0..SIGNALS {
                    self.low[k] = if seen.own[k] < self.low[k] { seen.own[k] } else { self.low[k] };
                    self.high[k] = if seen.own[k] > self.high[k] { seen.own[k] } else { self.high[k] };
                }
            }
            if seen.live {
                live += 1.0;
                sum += seen.told_p;
                self.squares_omega += (seen.own[OMEGA] - self.omega_ref).powi(2);
            }
        }
        if live == 0.0 {
            return;
        }
        let mean = sum / live;
        let about = self.goal.unwrap_or(mean);
        let mut squares = 0.0;
        for i in from..to {
            let seen = of(i);
            if seen.live {
                squares += (seen.told_p - about).powi(2);
            }
        }
        if self.live == 0.0 {
            (self.live, self.mean, self.squares_p) = (live, mean, squares);
            return;
        }
        // Chan, Golub, LeVeque (1983): sums of squares about two means, about their common one.
        let all = self.live + live;
        let apart = mean - self.mean;
        let between = if self.goal.is_none() { apart * apart * (self.live * live / all) } else { 0.0 };
        self.squares_p += squares + between;
        self.mean += apart * (live / all);
        self.live = all;
    }

    /// Largest less smallest p, q and SoC of the available agents.
    pub fn spreads(&self) -> [f64; 3] {
        [P, Q, SOC].map(|k| if self.low[k] <= self.high[k] { self.high[k] - self.low[k] } else { 0.0 })
    }

    /// Largest distance of an available agent's omega and V from their references, pu.
    pub fn errors(&self) -> [f64; 2] {
        [(OMEGA, self.omega_ref), (V, self.V_ref)].map(|(k, reference)| {
            if self.low[k] <= self.high[k] {
                (self.low[k] - reference).abs().max((self.high[k] - reference).abs())
            } else {
                0.0
            }
        })
    }

    /// Euclidean norms of the live agents' p about goal or mean, and omega about its reference, pu.
    pub fn norms(&self) -> [f64; 2] {
        [self.squares_p.sqrt(), self.squares_omega.sqrt()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Agents that scatter, some not there, some there without taking part.
    fn agent(i: usize) -> Seen {
        let x = |k: usize| ((i * 37 + k * 11) as f64).sin();
        let own = [1.0 + 1e-3 * x(0), 0.3 + x(1), 1.0 + 0.1 * x(2), x(3), 0.5 + 0.2 * x(4), 0.0, 0.0, 0.0];
        let available = !i.is_multiple_of(5);
        Seen { available, live: available && !i.is_multiple_of(7), told_p: own[P] + 0.01 * x(5), own }
    }

    #[test]
    fn many_chunks_give_what_the_definitions_give() {
        for n in [1, CHUNK - 1, CHUNK, 3 * CHUNK + 17] {
            let all: Vec<Seen> = (0..n).map(agent).collect();
            let live: Vec<Seen> = all.iter().copied().filter(|seen| seen.live).collect();
            let mean = live.iter().map(|seen| seen.told_p).sum::<f64>() / live.len().max(1) as f64;
            let norm =
                |of: &dyn Fn(&Seen) -> f64| live.iter().map(|seen| of(seen).powi(2)).sum::<f64>().sqrt();
            let of = |k: usize| all.iter().filter(|seen| seen.available).map(move |seen| seen.own[k]);
            let spread =
                |k: usize| (of(k).fold(f64::MIN, f64::max) - of(k).fold(f64::MAX, f64::min)).max(0.0);
            let error = |k: usize, to: f64| of(k).fold(0.0, |w: f64, x| w.max((x - to).abs()));
            for goal in [None, Some(0.2)] {
                let mut found = Diagnosis::new(1.0, 1.01, goal);
                found.take(0, n, agent);
                let about = goal.unwrap_or(mean);
                let expected = [norm(&|seen| seen.told_p - about), norm(&|seen| seen.own[OMEGA] - 1.0)];
                for (found, expected) in found.norms().into_iter().zip(expected) {
                    assert!((found - expected).abs() <= 1e-13 * expected, "{n}: {found} {expected}");
                }
                assert_eq!(found.spreads(), [spread(P), spread(Q), spread(SOC)]);
                assert_eq!(found.errors(), [error(OMEGA, 1.0), error(V, 1.01)]);
            }
        }
    }
}

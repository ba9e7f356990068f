//! Spreads, errors and norms of the agents' signals, gathered chunk by chunk of [`CHUNK`] agents and in lanes, so
//! that it does not matter whether the whole or a part of the agents is looked at together, nor how wide vectors are.

/// Agents that are looked at together.
pub const CHUNK: usize = 256;
/// Agents whose numbers are gathered apart, so that it can be done side by side.
const LANES: usize = 8;
type Lanes = [f64; LANES];

/// Number of signals: omega, p, V, q, SoC.
const SIGNALS: usize = 5;
/// Places of the signals.
const OMEGA: usize = 0;
const P: usize = 1;
const V: usize = 2;
const Q: usize = 3;
const SOC: usize = 4;

/// At most [`CHUNK`] agents that follow each other; all slices are as long.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Who is available.
    pub available: &'a [bool],
    /// Who takes part.
    pub live: &'a [bool],
    /// p_i, pu, as told to the neighbours.
    pub told_p: &'a [f64],
    /// Their own omega, p, V, q, SoC.
    pub own: [&'a [f64]; SIGNALS],
}

/// What is known of the agents seen so far.
#[derive(Clone, Copy, Debug)]
pub struct Diagnosis {
    omega_ref: f64,
    V_ref: f64,
    /// Where p is to go; `None`: to its mean.
    goal: Option<f64>,
    /// Least and largest of each signal of the available agents.
    low: [Lanes; SIGNALS],
    high: [Lanes; SIGNALS],
    /// Number of live agents, mean of their p, sum of squares about it or about the goal.
    live: f64,
    mean: f64,
    squares_p: f64,
    squares_omega: Lanes,
}

impl Diagnosis {
    /// Of nobody.
    pub fn new(omega_ref: f64, V_ref: f64, goal: Option<f64>) -> Self {
        Self {
            omega_ref,
            V_ref,
            goal,
            low: [[f64::INFINITY; LANES]; SIGNALS],
            high: [[f64::NEG_INFINITY; LANES]; SIGNALS],
            live: 0.0,
            mean: 0.0,
            squares_p: 0.0,
            squares_omega: [0.0; LANES],
        }
    }

    /// Takes the next agents, [`CHUNK`] of them but for the last.
    #[inline(always)]
    pub fn take(&mut self, seen: Seen<'_>) {
        let available = Counts::of(seen.available);
        for (k, own) in seen.own.into_iter().enumerate() {
            range(own, available, &mut self.low[k], &mut self.high[k]);
        }
        let counts = Counts::of(seen.live);
        let (mut sum, omega_ref) = ([0.0; LANES], self.omega_ref);
        gather(seen.told_p, counts, &mut sum, |p| p);
        gather(seen.own[OMEGA], counts, &mut self.squares_omega, |omega| {
            (omega - omega_ref) * (omega - omega_ref)
        });
        let live = match counts {
            Counts::All => seen.live.len(),
            Counts::Some(live) => live.iter().filter(|live| **live).count(),
        };
        let live = live as f64;
        if live == 0.0 {
            return;
        }
        let mean = sum.iter().sum::<f64>() / live;
        let about = self.goal.unwrap_or(mean);
        let mut squares = [0.0; LANES];
        gather(seen.told_p, counts, &mut squares, |p| (p - about) * (p - about));
        let squares: f64 = squares.iter().sum();
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

    /// Least and largest of signal `k`; the former is the larger where nobody is available.
    fn ends(&self, k: usize) -> (f64, f64) {
        let low = self.low[k].iter().copied().fold(f64::INFINITY, f64::min);
        (low, self.high[k].iter().copied().fold(f64::NEG_INFINITY, f64::max))
    }

    /// Largest less smallest p, q and SoC of the available agents.
    pub fn spreads(&self) -> [f64; 3] {
        [P, Q, SOC].map(|k| {
            let (low, high) = self.ends(k);
            if low <= high { high - low } else { 0.0 }
        })
    }

    /// Largest distance of an available agent's omega and V from their references, pu.
    pub fn errors(&self) -> [f64; 2] {
        [(OMEGA, self.omega_ref), (V, self.V_ref)].map(|(k, reference)| {
            let (low, high) = self.ends(k);
            if low <= high { (low - reference).abs().max((high - reference).abs()) } else { 0.0 }
        })
    }

    /// Euclidean norms of the live agents' p about goal or mean, and omega about its reference, pu.
    pub fn norms(&self) -> [f64; 2] {
        [self.squares_p.sqrt(), self.squares_omega.iter().sum::<f64>().sqrt()]
    }
}

/// Who of some agents counts.
#[derive(Clone, Copy)]
enum Counts<'a> {
    All,
    Some(&'a [bool]),
}

impl<'a> Counts<'a> {
    #[inline(always)]
    fn of(counts: &'a [bool]) -> Self {
        // Without a branch, so that it is done side by side.
        if counts.iter().fold(true, |all, &counts| all & counts) { Self::All } else { Self::Some(counts) }
    }

    /// Goes through the values, lane by lane.
    #[inline(always)]
    fn in_lanes(self, values: &[f64], mut each: impl FnMut(usize, f64, bool)) {
        let (lanes, left) = values.as_chunks::<LANES>();
        match self {
            Self::All => {
                for values in lanes {
                    for lane in 0..LANES {
                        each(lane, values[lane], true);
                    }
                }
                for (lane, &x) in left.iter().enumerate() {
                    each(lane, x, true);
                }
            }
            Self::Some(counts) => {
                let (counts, counts_left) = counts.as_chunks::<LANES>();
                for (values, counts) in lanes.iter().zip(counts) {
                    for lane in 0..LANES {
                        each(lane, values[lane], counts[lane]);
                    }
                }
                for (lane, (&x, &counts)) in left.iter().zip(counts_left).enumerate() {
                    each(lane, x, counts);
                }
            }
        }
    }
}

/// Widens `low` and `high` by the values of those who count.
#[inline(always)]
fn range(values: &[f64], counts: Counts<'_>, low: &mut Lanes, high: &mut Lanes) {
    let (mut least, mut most) = (*low, *high);
    counts.in_lanes(values, |lane, x, counts| {
        // The comparisons that processors have; who does not count is at the wrong end of both.
        let (down, up) = if counts { (x, x) } else { (f64::INFINITY, f64::NEG_INFINITY) };
        least[lane] = if down < least[lane] { down } else { least[lane] };
        most[lane] = if up > most[lane] { up } else { most[lane] };
    });
    (*low, *high) = (least, most);
}

/// Adds what `of` makes of the values of those who count.
#[inline(always)]
fn gather(values: &[f64], counts: Counts<'_>, sum: &mut Lanes, of: impl Fn(f64) -> f64) {
    let mut sums = *sum;
    counts.in_lanes(values, |lane, x, counts| sums[lane] += if counts { of(x) } else { 0.0 });
    *sum = sums;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy)]
    struct Agent {
        available: bool,
        live: bool,
        told_p: f64,
        own: [f64; SIGNALS],
    }

    /// Agents that scatter, some not there, some there without taking part.
    fn agent(i: usize) -> Agent {
        let x = |k: usize| ((i * 37 + k * 11) as f64).sin();
        let own = [1.0 + 1e-3 * x(0), 0.3 + x(1), 1.0 + 0.1 * x(2), x(3), 0.5 + 0.2 * x(4)];
        let available = !i.is_multiple_of(5);
        Agent { available, live: available && !i.is_multiple_of(7), told_p: own[P] + 0.01 * x(5), own }
    }

    #[test]
    fn many_chunks_give_what_the_definitions_give() {
        for n in [1, CHUNK - 1, CHUNK, 3 * CHUNK + 17] {
            let all: Vec<Agent> = (0..n).map(agent).collect();
            let live: Vec<Agent> = all.iter().copied().filter(|seen| seen.live).collect();
            let mean = live.iter().map(|seen| seen.told_p).sum::<f64>() / live.len().max(1) as f64;
            let norm =
                |of: &dyn Fn(&Agent) -> f64| live.iter().map(|seen| of(seen).powi(2)).sum::<f64>().sqrt();
            let of = |k: usize| all.iter().filter(|seen| seen.available).map(move |seen| seen.own[k]);
            let spread =
                |k: usize| (of(k).fold(f64::MIN, f64::max) - of(k).fold(f64::MAX, f64::min)).max(0.0);
            let error = |k: usize, to: f64| of(k).fold(0.0, |w: f64, x| w.max((x - to).abs()));
            for goal in [None, Some(0.2)] {
                let mut found = Diagnosis::new(1.0, 1.01, goal);
                for agents in all.chunks(CHUNK) {
                    let flags = |of: &dyn Fn(&Agent) -> bool| agents.iter().map(of).collect::<Vec<_>>();
                    let numbers = |of: &dyn Fn(&Agent) -> f64| agents.iter().map(of).collect::<Vec<_>>();
                    let own: [Vec<f64>; SIGNALS] = std::array::from_fn(|k| numbers(&|agent| agent.own[k]));
                    found.take(Seen {
                        available: &flags(&|agent| agent.available),
                        live: &flags(&|agent| agent.live),
                        told_p: &numbers(&|agent| agent.told_p),
                        own: own.each_ref().map(Vec::as_slice),
                    });
                }
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

//! How much of the droop's effect a voltage setpoint has. With the other voltages held, Q moves by
//! dV_set / (K_Q + X), X the reactance that the agent sees; the droop alone would say dV_set / K_Q, on the
//! 57-bus system sixteen times as much. A limit on Q enforced by the droop's gain is that much too slow, and
//! X is nobody's to tell. So an agent at its limit looks how fast the excess really goes, and learns
//! a = K_Q / (K_Q + X) from it. Knows one agent at a time; never how the excess came about.

use super::scalar::Scalar;

/// Learning rate, per time constant in which the excess is to go.
const LEARNING: f64 = 2.0;
/// The share believed at first: so little that it is not slow, so much that a stiff grid does not ring.
const FIRST: f64 = 0.25;
/// The least share believed.
const LEAST: f64 = 0.01;
/// Excesses below this share of the limit say nothing: there the neighbours' moves count as much, and who
/// learnt from them would grow bolder until it rings.
const WORTH: f64 = 0.02;

/// What an agent has learnt, and of the last step what it learns from.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Authority {
    /// a, in [0.01, 1].
    pub share: f64,
    /// Q less the bound that held it back, pu; 0 where none did.
    pub excess: f64,
    /// Whether that was the upper bound.
    upper: bool,
    /// What of the excess was to go in that step, as a share.
    wanted: f64,
}

impl Default for Authority {
    fn default() -> Self {
        Self { share: FIRST, excess: 0.0, upper: true, wanted: 0.0 }
    }
}

impl Authority {
    /// After a step in which `Q` within (low, high), pu, changed the rate by `held` (0: not at all), so that a
    /// share `wanted` of the excess should go.
    pub fn of_step(share: f64, (Q, (low, high)): (f64, (f64, f64)), held: f64, wanted: f64) -> Self {
        let upper = held < 0.0;
        let excess = if held == 0.0 { 0.0 } else { Q - if upper { high } else { low } };
        Self { share, excess, upper, wanted }
    }

    /// The same of an agent that does not act: it keeps its share and has nothing to learn from.
    pub fn at_rest(self) -> Self {
        Self { excess: 0.0, ..self }
    }

    /// The share, now that the step has led to `Q`, pu, within (low, high).
    pub fn learn<S: Scalar>(&self, Q: S, (low, high): (S, S)) -> S {
        let c = S::constant;
        let bound = if self.upper { high } else { low };
        if self.excess.abs() <= WORTH * bound.value().abs() || self.wanted <= 0.0 {
            return c(self.share);
        }
        // 1 where the excess goes as fast as it is to.
        let gone = (c(self.excess) - (Q - bound)) / c(self.excess * self.wanted);
        let surprise =
            if gone.value().is_finite() { (gone - c(1.0)).max(c(-1.0)).min(c(1.0)) } else { c(0.0) };
        (c(self.share) * (c(LEARNING * self.wanted) * surprise).exp()).max(c(LEAST)).min(c(1.0))
    }

    /// Whether this may have been learnt.
    pub(super) fn is_sound(&self) -> bool {
        (LEAST..=1.0).contains(&self.share) && self.excess.is_finite() && (0.0..=1.0).contains(&self.wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RANGE: (f64, f64) = (-1.0, 1.0);

    /// What is learnt from, and left of, an excess of 1 that is held back in 20 time constants of 1 / `wanted`
    /// steps each, where the setpoint has the share `truth` of its droop's effect.
    fn after(truth: f64, wanted: f64, sign: f64) -> (f64, f64) {
        let (mut known, mut excess) = (Authority::default(), 1.0);
        for _ in 0..(20.0 / wanted) as usize {
            let Q = sign * (1.0 + excess);
            let share = known.learn(Q, RANGE);
            known = Authority::of_step(share, (Q, RANGE), -sign, wanted);
            excess *= 1.0 - wanted * truth / share;
        }
        (known.share, excess)
    }

    #[test]
    fn the_true_share_is_learnt_and_the_excess_goes() {
        for truth in [1.0, 0.3, 0.06, 0.02] {
            for wanted in [0.02, 0.125, 0.5] {
                for sign in [1.0, -1.0] {
                    let (share, excess) = after(truth, wanted, sign);
                    assert!((share / truth - 1.0).abs() < 0.2, "{share} for {truth}, {wanted}");
                    assert!(excess.abs() < 1e-3, "{excess} left of 1 for {truth}, {wanted}");
                }
            }
        }
    }

    #[test]
    fn nothing_held_back_teaches_nothing_and_a_wild_measurement_little() {
        let free = Authority::of_step(0.5, (3.0, RANGE), 0.0, 0.5);
        assert_eq!(free.learn(0.3, RANGE), 0.5);
        let held = Authority::of_step(0.5, (1.1, RANGE), -1.0, 0.5);
        assert!(held.learn(f64::MAX, RANGE) > 0.3 && held.learn(-f64::MAX, RANGE) < 0.9);
    }
}

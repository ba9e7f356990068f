//! What a fault makes of one signal: stuck, drifting, noisy, in steps, not a number. Deterministic: noise follows from
//! the seed, the signal and the time alone, whatever is rolled back. Knows no participant.

use super::slave::seconds;
use crate::scenario::fault::{WireFault, Wrong};
use serde::{Deserialize, Serialize};

/// One signal with the faults that it has in the course of a run.
#[derive(Clone, Debug)]
pub(super) struct FaultySignal {
    /// Value reference of the input.
    pub reference: u32,
    /// By which its noise is drawn: the reference that it has in a controller in one part.
    pub key: u32,
    faults: Vec<WireFault>,
    pub memory: Memory,
}

/// What is remembered of a signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory {
    /// The true value, as set last.
    pub truth: Option<f64>,
    /// What was passed on last before the fault that is there now, if any is.
    pub passed: Option<f64>,
    /// When that was, ns.
    pub at_ns: Option<i64>,
}

impl FaultySignal {
    pub fn new(reference: u32, faults: Vec<WireFault>) -> Self {
        Self { reference, key: reference, faults, memory: Memory::default() }
    }

    /// Takes in the truth at `now_ns` and gives what arrives.
    pub fn arrives(&mut self, truth: f64, now_ns: i64) -> f64 {
        (self.memory.truth, self.memory.at_ns) = (Some(truth), Some(now_ns));
        let mut value = truth;
        let mut is_held = false;
        for fault in &self.faults {
            if now_ns < fault.from_ns || fault.until_ns.is_some_and(|until| now_ns >= until) {
                continue;
            }
            value = match fault.wrong {
                Wrong::Stuck(Some(stuck)) => stuck,
                Wrong::Stuck(None) => {
                    is_held = true;
                    self.memory.passed.unwrap_or(value)
                }
                Wrong::Drift(rate_per_s) => value + rate_per_s * seconds(now_ns - fault.from_ns),
                Wrong::Nan => f64::NAN,
                Wrong::Noise { deviation, seed } => {
                    value + deviation * normal(seed, self.key.into(), now_ns as u64)
                }
                Wrong::Quantised(step) => (value / step).round() * step,
            };
        }
        if !is_held || self.memory.passed.is_none() {
            self.memory.passed = Some(value);
        }
        value
    }
}

/// A normal number by the sum of twelve uniform ones: within 6 deviations, and, being sums alone, the same to the
/// last bit on every machine, which logarithms and cosines are not.
fn normal(seed: u64, signal: u64, time: u64) -> f64 {
    let key = scatter(seed ^ scatter(signal ^ scatter(time)));
    let uniform = |k: u64| (scatter(key.wrapping_add(k)) >> 11) as f64 / (1u64 << 53) as f64;
    (0..12).map(uniform).sum::<f64>() - 6.0
}

/// The finaliser of MurmurHash3 (Appleby): a bijection that scatters counters.
fn scatter(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    let x = (x ^ (x >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    x ^ (x >> 33)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn signal(wrong: Wrong) -> FaultySignal {
        let fault = WireFault {
            place: String::new(),
            signal: String::new(),
            wrong,
            from_ns: 100,
            until_ns: Some(200),
        };
        FaultySignal::new(7, vec![fault])
    }

    fn course(wrong: Wrong) -> Vec<f64> {
        let mut signal = signal(wrong);
        [0, 50, 100, 150, 200, 250].map(|t| signal.arrives(t as f64, t)).to_vec()
    }

    #[test]
    fn faults_begin_and_end_when_they_should() {
        assert_eq!(course(Wrong::Stuck(None)), [0.0, 50.0, 50.0, 50.0, 200.0, 250.0]);
        assert_eq!(course(Wrong::Stuck(Some(-1.0))), [0.0, 50.0, -1.0, -1.0, 200.0, 250.0]);
        assert_eq!(course(Wrong::Drift(1e9)), [0.0, 50.0, 100.0, 200.0, 200.0, 250.0]);
        assert_eq!(course(Wrong::Quantised(40.0)), [0.0, 50.0, 120.0, 160.0, 200.0, 250.0]);
        let nan: Vec<bool> = course(Wrong::Nan).iter().map(|x| x.is_nan()).collect();
        assert_eq!(nan, [false, false, true, true, false, false]);
    }

    #[test]
    fn noise_is_normal_and_follows_from_seed_signal_and_time() {
        let n = 100_000u64;
        let drawn: Vec<f64> = (0..n).map(|t| normal(1, 2, t * 10_000_000)).collect();
        let mean = drawn.iter().sum::<f64>() / n as f64;
        let variance = drawn.iter().map(|x| x * x).sum::<f64>() / n as f64;
        let beyond = drawn.iter().filter(|x| x.abs() > 1.96).count() as f64 / n as f64;
        // Five standard errors each.
        assert!(mean.abs() < 5.0 / (n as f64).sqrt(), "{mean}");
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / n as f64).sqrt(), "{variance}");
        assert!((beyond - 0.05).abs() < 5.0 * (0.05 * 0.95 / n as f64).sqrt() + 1e-3, "{beyond}");
        assert_eq!(normal(1, 2, 3), normal(1, 2, 3));
        assert_ne!(normal(1, 2, 3), normal(2, 2, 3));
        assert_ne!(normal(1, 2, 3), normal(1, 3, 3));
    }
}

//! The lossy channel of a link: when messages arrive, from a counter-based generator, so that a rollback finds the
//! same again. Knows times and agent numbers; no values.

use super::config::Channel;
use super::time::nanoseconds;

impl Channel {
    /// Whether messages are anything but punctual.
    pub fn is_lossy(&self) -> bool {
        self.jitter_s > 0.0 || self.loss > 0.0
    }

    /// How far back a value may have to be looked up beyond the delay, ns. After a long loss it is the
    /// oldest sample kept, at least one second old.
    pub fn horizon_ns(&self) -> i64 {
        nanoseconds(self.jitter_s).saturating_add(if self.loss > 0.0 { 1_000_000_000 } else { 0 })
    }

    /// Time of the newest value that `to` has of `from` at sample number `sample`, when a punctual
    /// message would be of `punctual_ns` and the last one received was of `last_ns`.
    pub fn received(&self, from: u32, to: u32, sample: u64, punctual_ns: i64, last_ns: i64) -> i64 {
        let draw = mix(self.seed
            ^ mix(u64::from(from) << 32 | u64::from(to))
            ^ mix(sample.wrapping_mul(2) | 1 << 63));
        if unit(draw) < self.loss {
            return last_ns;
        }
        let late = unit(mix(draw)) * self.jitter_s;
        last_ns.max(punctual_ns.saturating_sub(nanoseconds(late)))
    }
}

/// The finaliser of splitmix64 (Steele, Lea, Flood 2014), a bijection that scatters counters.
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A number in [0, 1) from the upper 53 bits.
fn unit(x: u64) -> f64 {
    (x >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_channel_loses_the_share_that_it_should() {
        let channel = Channel { jitter_s: 0.0, loss: 0.3, seed: 7 };
        let lost = (0..100_000).filter(|&k| channel.received(0, 1, k, 10, -1) == -1).count();
        // Binomial with sigma 145.
        assert!((lost as f64 - 30_000.0).abs() < 5.0 * 145.0, "{lost}");
        let both = (0..100_000)
            .filter(|&k| channel.received(0, 1, k, 10, -1) == -1 && channel.received(1, 0, k, 10, -1) == -1);
        assert!((both.count() as f64 - 9_000.0).abs() < 5.0 * 91.0);
    }
}

//! The scalar law of every flow, and its sampling: s(d), the cap of DESIGN 1.1, the bare explicit flow.
//! Knows one difference at a time; sums over neighbours are in `protocol`.

use super::config::{Discretisation, Law};

/// s(abs(d)): the magnitude of the sign power, its exponent sorted out once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SignPower {
    /// abs(d)^(1/2), the paper's eta, by square root.
    Root,
    /// abs(d): eta = 1, the asymptotic law.
    Linear,
    /// abs(d)^eta.
    Power(f64),
    /// alpha abs(d)^eta + beta abs(d)^(2 - eta).
    FixedTime {
        /// Exponent of the first term.
        eta: f64,
        /// Factor of the first term.
        alpha: f64,
        /// Factor of the second term.
        beta: f64,
    },
}

impl SignPower {
    /// The law for this exponent, in (0, 1].
    pub fn new(law: Law, eta: f64) -> Self {
        match law {
            Law::FixedTime { alpha, beta } => Self::FixedTime { eta, alpha, beta },
            Law::FiniteTime if eta == 0.5 => Self::Root,
            Law::FiniteTime if eta == 1.0 => Self::Linear,
            Law::FiniteTime => Self::Power(eta),
        }
    }

    /// The magnitude of s for the magnitude `m >= 0` of a difference.
    pub fn magnitude(self, m: f64) -> f64 {
        match self {
            Self::Root => m.sqrt(),
            Self::Linear => m,
            Self::Power(eta) => m.powf(eta),
            Self::FixedTime { eta, alpha, beta } => alpha * m.powf(eta) + beta * m.powf(2.0 - eta),
        }
    }
}

/// theta = max(h, theta_min), s: the boundary layer of DESIGN 1.1; 0 where nothing is capped. `h_s` is the time
/// until an action shows: a step, or with late measurements several (see `lag`).
pub fn boundary_layer(discretisation: Discretisation, h_s: f64, theta_min_s: f64) -> f64 {
    match discretisation {
        Discretisation::Capped => h_s.max(theta_min_s),
        Discretisation::Explicit => 0.0,
    }
}

/// The flow law of one quantity during one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    /// s.
    pub power: SignPower,
    /// The gain g of the quantity.
    pub gain: f64,
    /// 1 / theta, 1/s; infinite where nothing is capped.
    pub inverse_theta: f64,
}

impl Flow {
    /// A law with boundary layer `theta_s`; 0 is the bare explicit flow.
    pub fn new(power: SignPower, gain: f64, theta_s: f64) -> Self {
        Self { power, gain, inverse_theta: 1.0 / theta_s }
    }

    /// f = sgn(d) min(g w s(abs(d)), abs(d) share / theta): the flow along an edge of weight `w`, positive
    /// from the end that is higher by `d`, in the unit of d per s; `share` is 1 / (1 + max(deg_i, deg_j)).
    pub fn along(&self, w: f64, d: f64, share: f64) -> f64 {
        if d == 0.0 {
            return 0.0;
        }
        let m = d.abs();
        // `min` returns the law where the cap is infinity times an underflow.
        (self.gain * w * self.power.magnitude(m)).min(m * share * self.inverse_theta).copysign(d)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_law_far_out_and_the_cap_near_consensus() {
        let flow = Flow::new(SignPower::new(Law::FiniteTime, 0.5), 1.0, 0.1);
        assert_eq!(flow.along(1.0, 4.0, 1.0), 2.0);
        assert_eq!(flow.along(1.0, -4.0, 1.0), -2.0);
        // Below d = theta^2 two agents would overshoot: there the cap holds.
        assert!((flow.along(1.0, 1e-4, 0.5) - 1e-4 * 0.5 / 0.1).abs() < 1e-18);
    }

    #[test]
    fn neither_zero_difference_nor_zero_theta_gives_nan() {
        for law in [Law::FiniteTime, Law::FixedTime { alpha: 1.0, beta: 1.0 }] {
            for eta in [0.1, 0.5, 1.0] {
                for theta in [0.0, 0.1] {
                    let flow = Flow::new(SignPower::new(law, eta), 1.0, theta);
                    for d in [0.0, -0.0, 5e-324, -1e-300, 1.0] {
                        assert!(flow.along(0.5, d, 0.25).is_finite());
                    }
                }
            }
        }
    }

    #[test]
    fn the_square_root_is_the_power_one_half() {
        let root = SignPower::new(Law::FiniteTime, 0.5);
        for m in [1e-12, 0.3, 7.0_f64] {
            assert!((root.magnitude(m) - m.powf(0.5)).abs() <= 1e-15 * m.sqrt());
        }
    }
}

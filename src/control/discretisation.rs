//! The scalar law of every flow, and its sampling: s(d), the cap of DESIGN 1.1, the bare explicit flow.
//! Knows one difference at a time; sums over neighbours are in `protocol`.

use super::config::{Discretisation, Law};
use super::scalar::Scalar;

/// s(abs(d)): the magnitude of the sign power, its exponent sorted out once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SignPower<S = f64> {
    /// abs(d)^(1/2), the paper's eta, by square root.
    Root,
    /// abs(d): eta = 1, the asymptotic law.
    Linear,
    /// abs(d)^eta.
    Power(S),
    /// alpha abs(d)^eta + beta abs(d)^(2 - eta).
    FixedTime {
        /// Exponent of the first term.
        eta: S,
        /// Factor of the first term.
        alpha: f64,
        /// Factor of the second term.
        beta: f64,
    },
}

impl<S: Scalar> SignPower<S> {
    /// The law for this exponent, in (0, 1].
    pub fn new(law: Law, eta: S) -> Self {
        // An exponent that varies must be seen to do so.
        let is = |exponent: f64| !S::CARRIES_TANGENT && eta.value() == exponent;
        match law {
            Law::FixedTime { alpha, beta } => Self::FixedTime { eta, alpha, beta },
            Law::FiniteTime if is(0.5) => Self::Root,
            Law::FiniteTime if is(1.0) => Self::Linear,
            Law::FiniteTime => Self::Power(eta),
        }
    }

    /// The magnitude of s for the magnitude `m >= 0` of a difference.
    pub fn magnitude(self, m: S) -> S {
        match self {
            Self::Root => m.sqrt(),
            Self::Linear => m,
            Self::Power(eta) => m.fraction(eta),
            Self::FixedTime { eta, alpha, beta } => {
                let c = S::constant;
                c(alpha) * m.powf(eta) + c(beta) * m.powf(c(2.0) - eta)
            }
        }
    }

    /// Slope of the magnitude at 0: infinite but for eta = 1.
    pub(super) fn slope_at_zero(self) -> f64 {
        match self {
            Self::Linear => 1.0,
            Self::Power(eta) if eta.value() == 1.0 => 1.0,
            Self::FixedTime { eta, alpha, beta } if eta.value() == 1.0 => alpha + beta,
            _ => f64::INFINITY,
        }
    }
}

/// theta = max(h, theta_min), s: the boundary layer of DESIGN 1.1; 0 where nothing is capped. `h_s` is the time
/// until an action shows: a step, or with late measurements several (see `lag`).
pub fn boundary_layer<S: Scalar>(discretisation: Discretisation, h_s: f64, theta_min_s: S) -> S {
    match discretisation {
        Discretisation::Capped => S::constant(h_s).max(theta_min_s),
        Discretisation::Explicit => S::constant(0.0),
    }
}

/// The flow law of one quantity during one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow<S = f64> {
    /// s.
    pub power: SignPower<S>,
    /// The gain g of the quantity.
    pub gain: S,
    /// 1 / theta, 1/s; infinite where nothing is capped.
    pub inverse_theta: S,
}

impl<S: Scalar> Flow<S> {
    /// A law with boundary layer `theta_s`; 0 is the bare explicit flow.
    pub fn new(power: SignPower<S>, gain: S, theta_s: S) -> Self {
        Self { power, gain, inverse_theta: S::constant(1.0) / theta_s }
    }

    /// f = sgn(d) min(g w s(abs(d)), abs(d) share / theta): the flow along an edge of weight `w`, positive
    /// from the end that is higher by `d`, in the unit of d per s; `share` is 1 / (1 + max(deg_i, deg_j)). The
    /// slope at d = 0 is that of the cap, or of the law where that is less; the infinite one of the bare law
    /// counts as 0.
    pub fn along(&self, w: f64, d: S, share: f64) -> S {
        let c = S::constant;
        if d.value() == 0.0 {
            let slope = || {
                let law = self.gain.value() * w;
                let law = if law == 0.0 { 0.0 } else { law * self.power.slope_at_zero() };
                let slope = law.min(share * self.inverse_theta.value());
                if slope.is_finite() { slope } else { 0.0 }
            };
            return d.through_zero(slope);
        }
        let m = d.abs();
        // `min` returns the law where the cap is infinity times an underflow.
        (self.gain * c(w) * self.power.magnitude(m)).min(m * c(share) * self.inverse_theta).copysign(d)
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

//! Certified times to consensus, (27) and (33) corrected, as printed, and the fixed-time bound. They hold
//! for the agent model (5)-(6) in continuous time; on a grid they are estimates, since dP/dt is not u_P.

use super::config::Law;
use super::scalar::Scalar;

/// T = norm(e_0)^(1-eta) / ((1-eta) lambda^((1+eta)/2)), s: (27) with lambda_2 of the Laplacian of the weights
/// (g w_ij)^(2/(1+eta)) and e = p - mean(p); (33) with the smallest eigenvalue of that Laplacian plus
/// diag((g a_0i)^(2/(1+eta))) and e = omega - omega_ref. From V = norm(e)^2 and Lemma 1 with the sum over
/// pairs taken once: dV/dt <= -2 lambda^((1+eta)/2) V^((1+eta)/2); with equality for two agents. Infinite
/// for eta = 1, and where nothing ties the agents together.
pub fn settling_time<S: Scalar>(error_norm: S, lambda: S, eta: S) -> S {
    let c = S::constant;
    if error_norm.value() == 0.0 {
        return c(0.0);
    }
    error_norm.powf(c(1.0) - eta) / ((c(1.0) - eta) * lambda.powf(c(0.5) * (c(1.0) + eta)))
}

/// (27), (33) as printed, s: T = (2 lambda norm(e_0)^2)^((1-eta)/2) / ((1-eta) lambda), which is 2^((1-eta)/2)
/// times [`settling_time`]: valid, but loose.
pub fn settling_time_as_printed(error_norm: f64, lambda: f64, eta: f64) -> f64 {
    if error_norm == 0.0 {
        return 0.0;
    }
    (2.0 * lambda * error_norm * error_norm).powf(0.5 * (1.0 - eta)) / ((1.0 - eta) * lambda)
}

/// What the fixed-time bound needs of a graph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedTime<S = f64> {
    /// alpha and beta of the law.
    pub factors: (f64, f64),
    /// Smallest eigenvalue with the weights (g w)^(2/(1+eta)).
    pub lambda_low: S,
    /// The same with the weights (g w)^(2/(3-eta)).
    pub lambda_high: S,
    /// Number of edges and pins that pull.
    pub links: f64,
}

impl<S: Scalar> FixedTime<S> {
    /// Settling time of s(d) = sgn(d) (alpha abs(d)^eta + beta abs(d)^(2-eta)), s: with r = norm(e),
    /// dr/dt <= -A r^eta - B r^(2-eta), A = alpha lambda_low^((1+eta)/2) by Lemma 1 and
    /// B = beta links^((eta-1)/2) lambda_high^((3-eta)/2) by Jensen, hence
    /// T = atan(sqrt(B/A) r_0^(1-eta)) / ((1-eta) sqrt(A B)).
    pub fn settling_time(&self, error_norm: S, eta: S) -> S {
        let c = S::constant;
        if error_norm.value() == 0.0 {
            return c(0.0);
        }
        let (A, B) = self.rates(eta);
        if !(A.value() > 0.0 && B.value() > 0.0) {
            return c(f64::INFINITY);
        }
        ((B / A).sqrt() * error_norm.powf(c(1.0) - eta)).atan() / ((c(1.0) - eta) * (A * B).sqrt())
    }

    /// The time that no start exceeds, s: pi / (2 (1-eta) sqrt(A B)).
    pub fn bound(&self, eta: S) -> S {
        let c = S::constant;
        let (A, B) = self.rates(eta);
        c(std::f64::consts::FRAC_PI_2) / ((c(1.0) - eta) * (A * B).sqrt())
    }

    fn rates(&self, eta: S) -> (S, S) {
        let c = S::constant;
        let (alpha, beta) = self.factors;
        let A = c(alpha) * self.lambda_low.powf(c(0.5) * (c(1.0) + eta));
        let links = c(self.links).powf(c(0.5) * (eta - c(1.0)));
        let B = c(beta) * links * self.lambda_high.powf(c(0.5) * (c(3.0) - eta));
        (A, B)
    }
}

/// The exponents e of the weights (g w)^e whose eigenvalues the certificates need: below one, above one.
pub fn weight_exponents<S: Scalar>(law: Law, eta: S) -> (S, Option<S>) {
    let c = S::constant;
    let high = match law {
        Law::FiniteTime => None,
        Law::FixedTime { .. } => Some(c(2.0) / (c(3.0) - eta)),
    };
    (c(2.0) / (c(1.0) + eta), high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_form_is_looser_by_the_stated_factor() {
        for eta in [0.1, 0.5, 0.9] {
            let ratio = settling_time_as_printed(0.7, 0.3, eta) / settling_time(0.7, 0.3, eta);
            assert!((ratio - 2f64.powf(0.5 * (1.0 - eta))).abs() < 1e-12);
        }
    }

    #[test]
    fn no_error_no_time_and_the_asymptotic_law_never() {
        assert_eq!(settling_time(0.0, 0.0, 0.5), 0.0);
        assert_eq!(settling_time(1.0, 0.3, 1.0), f64::INFINITY);
        assert_eq!(settling_time(1.0, 0.0, 0.5), f64::INFINITY);
    }

    #[test]
    fn the_fixed_time_bound_solves_its_scalar_equation() {
        // Two agents, one edge: r' = -A r^eta - B r^(2-eta) is exact; integrate it with small steps.
        let (eta, alpha, beta, w) = (0.5, 1.0, 2.0, 0.8);
        let lambda = |e: f64| 2.0 * f64::powf(w, e);
        let bound = FixedTime {
            factors: (alpha, beta),
            lambda_low: lambda(2.0 / (1.0 + eta)),
            lambda_high: lambda(2.0 / (3.0 - eta)),
            links: 1.0,
        };
        let mut d = 5.0_f64;
        let r0 = d / 2f64.sqrt();
        let (h, mut t) = (1e-6, 0.0);
        while d > 1e-9 {
            d -= h * 2.0 * w * (alpha * d.powf(eta) + beta * d.powf(2.0 - eta));
            t += h;
        }
        let certified = bound.settling_time(r0, eta);
        assert!((t - certified).abs() < 1e-3 * certified, "{t} {certified}");
        assert!(certified < bound.bound(eta));
    }
}

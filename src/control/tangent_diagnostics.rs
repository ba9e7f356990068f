//! The rates of spreads, errors, eigenvalues and certified times, and how tangents are set to 0. As
//! `Controller::diagnose`, in dual numbers.

use super::adopt::Tie;
use super::certificates::{FixedTime, settling_time, weight_exponents};
use super::controller::Controller;
use super::delay::Quantity;
use super::scalar::{Dual, Scalar};
use super::spectrum::slope;
use super::tangent::Tangents;

impl Controller {
    pub(super) fn diagnostic_rates(&self, tangents: &mut Tangents) {
        let inputs = &self.state.inputs;
        let available = &self.state.adopted.available;
        let (signals, d) = (&tangents.signals, &tangents.inputs);
        let of_available =
            |q: Quantity| signals.of(q).iter().zip(available).filter(|(_, a)| **a).map(|(&x, _)| x);
        let spread = |q: Quantity| {
            let start = (Dual::constant(f64::INFINITY), Dual::constant(f64::NEG_INFINITY));
            let own = (0..available.len()).filter(|&i| available[i]).map(|i| self.own(signals, q, i));
            let (low, high) = own.fold(start, |(low, high), x| (x.min(low), x.max(high)));
            if low.value <= high.value { (high - low).tangent } else { 0.0 }
        };
        let error = |q: Quantity, reference: Dual| {
            of_available(q).fold(Dual::default(), |e, x| e.max((x - reference).abs())).tangent
        };
        let live = &self.topology.live;
        let of_live = |q: Quantity| signals.of(q).iter().zip(live).filter(|(_, l)| **l).map(|(&x, _)| x);
        let sum = |values: &mut dyn Iterator<Item = Dual>| values.fold(Dual::default(), |sum, x| sum + x);
        let norm = |q: Quantity, about: Dual| sum(&mut of_live(q).map(|x| (x - about) * (x - about))).sqrt();
        let goal_P = if inputs.dispatch {
            Dual::new(inputs.P_ref, d.P_ref)
        } else {
            let count = of_live(Quantity::P).count().max(1);
            sum(&mut of_live(Quantity::P)) / Dual::constant(count as f64)
        };
        let (omega_ref, V_ref) = (Dual::new(inputs.omega_ref, d.omega_ref), Dual::new(inputs.V_ref, d.V_ref));
        let eta = Dual::new(self.state.parameters.eta, tangents.parameters.eta);
        let gain_P = (self.state.parameters.gain_P, tangents.parameters.gain_P);
        let gain_omega = (self.state.parameters.gain_omega, tangents.parameters.gain_omega);
        let T_P = self.time_rate(&self.spectrum.P, gain_P, inputs.dispatch, norm(Quantity::P, goal_P), eta);
        let T_omega =
            self.time_rate(&self.spectrum.omega, gain_omega, true, norm(Quantity::Omega, omega_ref), eta);
        let lambda_2 = self.eigenvalue_rate(gain_P, weight_exponents(self.fixed.law, eta).0, false);
        let errors = (error(Quantity::Omega, omega_ref), error(Quantity::V, V_ref));
        let spreads = (spread(Quantity::P), spread(Quantity::Q), spread(Quantity::Soc));
        let outputs = &mut tangents.outputs;
        (outputs.spread_P, outputs.spread_Q, outputs.spread_E) = spreads;
        (outputs.error_omega, outputs.error_V) = errors;
        (outputs.lambda_2, outputs.T_P, outputs.T_omega) = (lambda_2, T_P, T_omega);
    }

    /// Rate of an eigenvalue; only a varying gain or exponent costs anything (and allocates).
    fn eigenvalue_rate(&self, gain: (f64, f64), exponent: Dual, pinned: bool) -> f64 {
        if (gain.1 == 0.0 && exponent.tangent == 0.0) || self.part().is_some() {
            return 0.0;
        }
        let exponent = (exponent.value, exponent.tangent);
        slope(&self.network.graph, &self.topology.live, gain, exponent, pinned)
    }

    /// Rate of a certified time; 0 where the time is infinite or nothing is left to settle.
    fn time_rate(&self, tie: &Tie, gain: (f64, f64), pinned: bool, error_norm: Dual, eta: Dual) -> f64 {
        let (low, high) = weight_exponents(self.fixed.law, eta);
        let lambda = Dual::new(tie.lambda.value, self.eigenvalue_rate(gain, low, pinned));
        let time = match (&tie.fixed_time, high) {
            (Some(fixed), Some(high)) => FixedTime {
                factors: fixed.factors,
                lambda_low: lambda,
                lambda_high: Dual::new(fixed.lambda_high, self.eigenvalue_rate(gain, high, pinned)),
                links: fixed.links,
            }
            .settling_time(error_norm, eta),
            _ => settling_time(error_norm, lambda, eta),
        };
        if time.value.is_finite() && time.tangent.is_finite() { time.tangent } else { 0.0 }
    }
}

impl Tangents {
    /// Nothing varies.
    pub fn clear(&mut self) {
        let inputs = &mut self.inputs;
        for values in [&mut inputs.P, &mut inputs.Q, &mut inputs.V, &mut inputs.omega, &mut inputs.E] {
            values.fill(0.0);
        }
        inputs.remote.values.iter_mut().for_each(|values| values.fill(0.0));
        (inputs.omega_ref, inputs.V_ref, inputs.P_ref) = (0.0, 0.0, 0.0);
        let parameters = &mut self.parameters;
        for value in [
            &mut parameters.eta,
            &mut parameters.gain_omega,
            &mut parameters.gain_P,
            &mut parameters.gain_E,
            &mut parameters.gain_V,
            &mut parameters.gain_Q,
            &mut parameters.delay,
            &mut parameters.theta_min,
            &mut parameters.theta_E,
        ] {
            *value = 0.0;
        }
        let outputs = &mut self.outputs;
        // Sampled: they rest until the next step, in every direction.
        outputs.local.values.iter_mut().for_each(|values| values.fill(0.0));
        outputs.P_set.fill(0.0);
        outputs.Q_set.fill(0.0);
    }
}

//! What a BESS can and may do: power, apparent power, state of charge, rates and ranges of setpoints.
//! Turns limits into bounds on rates and flows; decides nothing else. Without limits all is infinite.

use super::config::{Limits, SocLimits};
use super::scalar::Scalar;

/// Time constant with which a power beyond its limit is brought back, s: long beside a power filter and
/// an inverter's angle (0.2 s together), so that no loop through them rings.
const RECOVERY_S: f64 = 0.5;
/// The same in steps until an action shows, where those are longer: the neighbours, who answer with the same
/// steps, need a few.
const RECOVERY_LOOPS: f64 = 5.0;
/// Width of the band below a power limit in which an agent's part in the sharing falls to zero,
/// as a share of the limit.
const BAND: f64 = 0.05;

/// The limits of all agents, resolved: infinite where there is none.
#[derive(Clone, Debug)]
pub struct LimitTable {
    /// Whether any limit on power is there.
    pub power: bool,
    P_max: Vec<f64>,
    Q_max: Vec<f64>,
    S_max: Vec<f64>,
    /// Largest rate of omega_set, pu/s.
    pub omega_set_rate: Vec<f64>,
    /// Largest rate of V_set, pu/s.
    pub V_set_rate: Vec<f64>,
    /// Largest rate of P_set, pu/s.
    pub P_set_rate: Vec<f64>,
    /// Least and largest omega_set, pu.
    pub omega_set_range: [f64; 2],
    /// Least and largest V_set, pu.
    pub V_set_range: [f64; 2],
    soc: Option<SocLimits>,
}

impl LimitTable {
    /// Resolves validated limits of `n` agents.
    pub fn new(n: usize, limits: &Limits) -> Self {
        let resolved = |values: &Option<Vec<f64>>| values.clone().unwrap_or_else(|| vec![f64::INFINITY; n]);
        Self {
            power: limits.P_max.is_some() || limits.Q_max.is_some() || limits.S_max.is_some(),
            P_max: resolved(&limits.P_max),
            Q_max: resolved(&limits.Q_max),
            S_max: resolved(&limits.S_max),
            omega_set_rate: resolved(&limits.omega_set_rate),
            V_set_rate: resolved(&limits.V_set_rate),
            P_set_rate: resolved(&limits.P_set_rate),
            omega_set_range: limits.omega_set_range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
            V_set_range: limits.V_set_range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
            soc: limits.SoC,
        }
    }

    /// Least and largest power of agent `i` at this state of charge, pu: the smaller of P_max and S_max,
    /// tapered to zero towards an empty (discharging) and a full (charging) battery.
    pub fn P_range<S: Scalar>(&self, i: usize, soc: S) -> (S, S) {
        let c = S::constant;
        let P_max = c(self.P_max[i].min(self.S_max[i]));
        let Some(window) = self.soc else { return (-P_max, P_max) };
        let discharge = ((soc - c(window.min)) / c(window.taper)).clamp_to_unit();
        let charge = ((c(window.max) - soc) / c(window.taper)).clamp_to_unit();
        (-P_max * charge, P_max * discharge)
    }

    /// Largest abs(Q) of agent `i` beside the active power `P`, pu: active power has priority.
    pub fn Q_limit<S: Scalar>(&self, i: usize, P: S) -> S {
        let c = S::constant;
        let left = (c(self.S_max[i] * self.S_max[i]) - P * P).max(c(0.0)).sqrt();
        c(self.Q_max[i]).min(left)
    }
}

/// How far a power is from its bounds: (room to rise, room to fall), each from 1 to 0 over the band.
pub fn room<S: Scalar>(x: S, (low, high): (S, S)) -> (S, S) {
    let c = S::constant;
    let side = |gap: S, bound: S| {
        if bound.value().is_infinite() {
            c(1.0)
        } else {
            // A bound of zero has no band to speak of: one side of it is free, the other closed.
            (gap / (c(BAND) * bound.abs()).max(c(f64::MIN_POSITIVE))).clamp_to_unit()
        }
    };
    (side(high - x, high), side(x - low, low))
}

/// Time constant with which a power beyond its limit is brought back, s, when an action shows after `loop_s`.
pub fn recovery(loop_s: f64) -> f64 {
    (RECOVERY_LOOPS * loop_s).max(RECOVERY_S)
}

/// Keeps the rate `u` of a setpoint such that the power `x` it drives comes back inside its bounds and
/// does not leave them: anti-windup, because the setpoint stops where the power stops. `per_s` is the rate per
/// power beyond the bound, pu/s per pu: the setpoint's change per power over the time constant.
pub fn hold_back<S: Scalar>(u: S, x: S, (low, high): (S, S), per_s: S) -> S {
    // One after the other, since a clamp would panic on bounds that rounding puts in the wrong order.
    u.min((high - x) * per_s).max((low - x) * per_s)
}

/// Keeps the rate `u` within `rate`, and the setpoint within `range` at the end of the step.
pub fn restrict<S: Scalar>(u: S, rate: f64, setpoint: S, [low, high]: [f64; 2], h_s: f64) -> S {
    let c = S::constant;
    let u = u.min(c(rate)).max(c(-rate));
    if h_s <= 0.0 {
        return u;
    }
    u.min((c(high) - setpoint) / c(h_s)).max((c(low) - setpoint) / c(h_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> LimitTable {
        let limits = Limits {
            P_max: Some(vec![2.0]),
            S_max: Some(vec![2.5]),
            SoC: Some(SocLimits { min: 0.1, max: 0.9, taper: 0.1 }),
            ..Limits::default()
        };
        LimitTable::new(1, &limits)
    }

    #[test]
    fn power_tapers_with_the_state_of_charge_on_the_side_that_matters() {
        for (soc, low, high) in [(0.5, -2.0, 2.0), (0.15, -2.0, 1.0), (0.05, -2.0, 0.0), (0.875, -0.5, 2.0)] {
            let (found_low, found_high) = table().P_range(0, soc);
            assert!((found_low - low).abs() < 1e-12 && (found_high - high).abs() < 1e-12, "{soc}");
        }
    }

    #[test]
    fn reactive_power_has_what_the_circle_leaves() {
        assert!((table().Q_limit(0, 1.5) - 2.0).abs() < 1e-12);
        assert_eq!(table().Q_limit(0, 3.0), 0.0);
    }

    #[test]
    fn a_power_beyond_its_limit_is_driven_back_and_one_at_its_limit_stays() {
        assert_eq!(hold_back(1.0, 2.0, (-2.0, 2.0), 0.5), 0.0);
        assert_eq!(hold_back(1.0, 2.2, (-2.0, 2.0), 0.5), (2.0 - 2.2) * 0.5);
        assert_eq!(hold_back(-1.0, 1.9, (-2.0, 2.0), 0.5), -1.0);
        let free = (f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(hold_back(-7.0, 1.9, free, 0.5), -7.0);
        let (up, down) = room(1.95, (-2.0, 2.0));
        assert!((up - 0.5).abs() < 1e-12 && down == 1.0);
    }

    #[test]
    fn rate_and_range_bound_the_setpoint() {
        assert_eq!(restrict(1.0, 0.5, 1.0, [0.9, 1.1], 0.1), 0.5);
        assert!((1.0 + 0.4 * restrict(1.0, 0.5, 1.0, [0.9, 1.1], 0.4) - 1.1).abs() < 1e-15);
    }
}

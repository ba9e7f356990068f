//! How far a run is from what the controller is for, at every communication point and over each phase
//! between two events. Knows quantities, not files or FMUs.

use serde::Serialize;

/// Below this, pu, the frequency error and the spread of K_P P count as settled.
pub const SETTLED: f64 = 1e-5;

/// Length of the window before the next event over which the worst error of a phase is taken, s.
pub const WINDOW_S: f64 = 5.0;

/// What the errors are measured against; vectors of length n.
#[derive(Clone, Debug)]
pub struct Yardstick {
    /// Active power droop, pu/pu.
    pub k_p: Vec<f64>,
    /// Reactive power droop, pu/pu.
    pub k_q: Vec<f64>,
    /// Energy capacity, pu*h.
    pub capacity: Vec<f64>,
    /// Nominal frequency, pu.
    pub omega_ref: f64,
    /// Nominal voltage, pu.
    pub v_ref: f64,
}

/// One communication point as the agents measure it; slices of length n.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// Active power, pu.
    pub p: &'a [f64],
    /// Reactive power, pu.
    pub q: &'a [f64],
    /// Voltage, pu.
    pub v: &'a [f64],
    /// Frequency, pu.
    pub omega: &'a [f64],
    /// Energy, pu*h.
    pub e: &'a [f64],
    /// Active power reference, pu.
    pub p_set: &'a [f64],
    /// Reactive power reference, pu.
    pub q_set: &'a [f64],
}

/// The errors of one communication point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// max abs(omega_i - omega_ref), pu.
    pub error_omega: f64,
    /// max - min of K_P_i (P_i - P_set_i), pu.
    pub spread_p: f64,
    /// max - min of K_Q_i (Q_i - Q_set_i), pu.
    pub spread_q: f64,
    /// max - min of the state of charge E_i / C_i.
    pub spread_e: f64,
    /// max abs(V_i - V_ref), pu.
    pub error_v: f64,
}

impl Errors {
    /// The errors of what was measured.
    pub fn of(yardstick: &Yardstick, m: Measured<'_>) -> Self {
        let n = yardstick.k_p.len();
        Self {
            error_omega: worst(m.omega.iter().map(|omega| omega - yardstick.omega_ref)),
            spread_p: spread((0..n).map(|i| yardstick.k_p[i] * (m.p[i] - m.p_set[i]))),
            spread_q: spread((0..n).map(|i| yardstick.k_q[i] * (m.q[i] - m.q_set[i]))),
            spread_e: spread((0..n).map(|i| m.e[i] / yardstick.capacity[i])),
            error_v: worst(m.v.iter().map(|v| v - yardstick.v_ref)),
        }
    }

    fn max(self, other: Self) -> Self {
        Self {
            error_omega: self.error_omega.max(other.error_omega),
            spread_p: self.spread_p.max(other.spread_p),
            spread_q: self.spread_q.max(other.spread_q),
            spread_e: self.spread_e.max(other.spread_e),
            error_v: self.error_v.max(other.error_v),
        }
    }

    fn settled(self) -> bool {
        self.error_omega <= SETTLED && self.spread_p <= SETTLED
    }
}

fn worst(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |worst, value| value.abs().max(worst))
}

fn spread(values: impl Iterator<Item = f64>) -> f64 {
    let (min, max) = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), value| (min.min(value), max.max(value)));
    max - min
}

/// The time between two events.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Phase {
    /// What began it.
    pub label: String,
    /// Beginning, s.
    pub start_s: f64,
    /// End, s.
    pub end_s: f64,
    /// The worst errors in the last [`WINDOW_S`] before its end.
    pub worst: Errors,
    /// From its beginning until frequency and power sharing stay within [`SETTLED`], s; `None` when they
    /// do not by its end.
    pub settling_s: Option<f64>,
    /// The largest T_omega that the controller certified during it, s; `None` when the controller has none.
    pub certified_s: Option<f64>,
}

/// Cuts a run into phases. `starts`: (time in s, label), ascending, the first at the start of the run.
/// `time_s`, `errors` and `certified` have one entry per communication point.
pub fn phases(
    starts: &[(f64, String)],
    time_s: &[f64],
    errors: &[Errors],
    certified: Option<&[f64]>,
) -> Vec<Phase> {
    let stop_s = time_s.last().copied().unwrap_or(0.0);
    let mut result = Vec::with_capacity(starts.len());
    for (k, (start_s, label)) in starts.iter().enumerate() {
        let next = starts.get(k + 1).map(|(at, _)| *at);
        let end_s = next.unwrap_or(stop_s);
        // The sample at the time of the next event already carries it.
        let first = time_s.partition_point(|t| *t < *start_s);
        let end = next.map_or(time_s.len(), |at| time_s.partition_point(|t| *t < at));
        let window = time_s.partition_point(|t| *t < end_s - WINDOW_S).clamp(first, end);
        let worst = errors[window..end].iter().fold(Errors::default(), |worst, e| worst.max(*e));
        let unsettled = errors[first..end].iter().rposition(|e| !e.settled());
        let settling_s = match unsettled {
            None => Some(0.0),
            Some(last) if first + last + 1 < end => Some(time_s[first + last + 1] - start_s),
            Some(_) => None,
        };
        let certified_s = certified
            .map(|c| c[first..end].iter().copied().filter(|t| t.is_finite()).fold(0.0, f64::max))
            .filter(|t| *t > 0.0);
        result.push(Phase { label: label.clone(), start_s: *start_s, end_s, worst, settling_s, certified_s });
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error that falls from 1 as exp(-t) settles at t = ln(1e5), and its worst value over the last
    /// 5 s of a 20 s phase is exp(-15).
    #[test]
    fn phases_of_an_exponential_have_the_closed_form_settling_time() {
        let time_s: Vec<f64> = (0..=4000).map(|k| f64::from(k) * 0.01).collect();
        let errors: Vec<Errors> = time_s
            .iter()
            .map(|t| Errors { error_omega: (-(t % 20.0)).exp(), ..Errors::default() })
            .collect();
        let starts = [(0.0, "first".to_owned()), (20.0, "second".to_owned())];
        let phases = phases(&starts, &time_s[..4000], &errors[..4000], None);
        for phase in &phases {
            assert!((phase.settling_s.unwrap() - 1e5_f64.ln()).abs() <= 0.01, "{phase:?}");
            assert!((phase.worst.error_omega - (-15.0_f64).exp()).abs() < 1e-8, "{phase:?}");
        }
    }

    #[test]
    fn a_phase_that_ends_off_target_has_not_settled() {
        let errors = vec![Errors { spread_p: 2.0 * SETTLED, ..Errors::default() }; 11];
        let time_s: Vec<f64> = (0..=10).map(f64::from).collect();
        assert_eq!(phases(&[(0.0, String::new())], &time_s, &errors, None)[0].settling_s, None);
    }

    #[test]
    fn spreads_are_of_the_scaled_powers_and_of_the_state_of_charge() {
        let yardstick = Yardstick {
            k_p: vec![1.0, 2.0],
            k_q: vec![1.0, 1.0],
            capacity: vec![1.0, 2.0],
            omega_ref: 1.0,
            v_ref: 1.0,
        };
        let measured = Measured {
            p: &[4.0, 3.0],
            q: &[0.5, 0.25],
            v: &[1.0, 0.75],
            omega: &[1.0, 1.5],
            e: &[0.5, 1.5],
            p_set: &[0.0, 1.0],
            q_set: &[0.0, 0.0],
        };
        let expected =
            Errors { error_omega: 0.5, spread_p: 0.0, spread_q: 0.25, spread_e: 0.25, error_v: 0.25 };
        assert_eq!(Errors::of(&yardstick, measured), expected);
    }
}

//! The figures of a run, phase by phase: from one event to the next, how far off everything is at the
//! end and how long it took to settle. Reads recorded columns only.

use super::columns::Columns;
use super::error::ReportError;
use super::standard::{Agents, scaled_power};
use super::{Item, Table};
use serde::Serialize;

/// What counts as settled, and since when the controller works.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseOptions {
    /// Frequency has settled when every abs(omega_i - omega_ref) is at most this, pu.
    pub omega_tolerance: f64,
    /// Sharing has settled when every abs(p_i - mean(p)) is at most this, pu.
    pub p_tolerance: f64,
    /// Length of the stretch before the end of a phase over which its remaining errors are taken, s.
    pub window_s: f64,
    /// Instant from which the controller is enabled, s; certified times before it mean nothing.
    pub active_from_s: f64,
}

impl Default for PhaseOptions {
    fn default() -> Self {
        Self { omega_tolerance: 1e-5, p_tolerance: 1e-5, window_s: 5.0, active_from_s: f64::NEG_INFINITY }
    }
}

/// One stretch of a run between two events. Spreads are largest minus smallest over the agents.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Phase {
    /// The event that begins it, or "start".
    pub name: String,
    /// Its begin, s.
    pub from_s: f64,
    /// Its end: the next event, or the last recorded instant, s.
    pub to_s: f64,
    /// Largest abs(omega_i - omega_ref) over the phase, pu.
    pub omega_peak: f64,
    /// Largest abs(omega_i - omega_ref) in the last `window_s` before its end, pu.
    pub omega_error: f64,
    /// Spread of K_P_i (P_i - P_set_i) in the last `window_s` before its end, pu.
    pub p_spread: f64,
    /// Spread of K_Q_i (Q_i - Q_set_i) in the last `window_s` before its end, pu.
    pub q_spread: f64,
    /// Spread of E_i / C_i likewise where capacities are known, else of E_i, pu*h.
    pub e_spread: f64,
    /// Largest abs(V_i - V_ref) in the last `window_s` before its end, pu.
    pub V_error: f64,
    /// Time from its begin after which omega stays within the tolerance, s; none if it does not settle.
    pub omega_settled_s: Option<f64>,
    /// The same for active power sharing.
    pub p_settled_s: Option<f64>,
    /// Largest `controller.T_omega` (33) of the phase, s, where recorded and the controller is enabled.
    pub T_omega: Option<f64>,
    /// Largest `controller.T_P` (27) of the phase, s, likewise.
    pub T_P: Option<f64>,
}

impl Phase {
    /// Whether frequency and sharing have both settled.
    pub fn settled(&self) -> bool {
        self.omega_settled_s.is_some() && self.p_settled_s.is_some()
    }
}

/// Cuts the run at the events (instant in s, label) and sums up each phase.
///
/// A sample at the instant of an event belongs to the phase that begins there. Events outside the run
/// are left out; those at one instant begin one phase.
pub fn phases(
    columns: &Columns<'_>,
    agents: &Agents,
    events: &[(f64, String)],
    options: &PhaseOptions,
) -> Result<Vec<Phase>, ReportError> {
    let n = agents.check()?;
    let time = columns.time_s();
    let (Some(&first), Some(&last)) = (time.first(), time.last()) else {
        return Ok(Vec::new());
    };
    let (p, _) = scaled_power(columns, "P", &agents.K_P)?;
    let (q, _) = scaled_power(columns, "Q", &agents.K_Q)?;
    let data = Data {
        time,
        omega: columns.require_group("grid.omega", n)?,
        V: columns.require_group("grid.V", n)?,
        E: columns.require_group("grid.E", n)?,
        p: p.iter().map(Vec::as_slice).collect(),
        q: q.iter().map(Vec::as_slice).collect(),
        T_omega: columns.get("controller.T_omega"),
        T_P: columns.get("controller.T_P"),
    };
    let mut begins: Vec<(f64, String)> = vec![(first, "start".to_owned())];
    let mut sorted: Vec<&(f64, String)> = events.iter().filter(|(t, _)| *t >= first && *t <= last).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (t, label) in sorted {
        match begins.last_mut() {
            Some(begin) if begin.0 == *t && *t > first => begin.1 = format!("{}, {label}", begin.1),
            Some(begin) if begin.0 == *t => begin.1.clone_from(label),
            _ => begins.push((*t, label.clone())),
        }
    }
    let mut all = Vec::with_capacity(begins.len());
    for (k, (from_s, name)) in begins.iter().enumerate() {
        let next = begins.get(k + 1).map(|b| b.0);
        let begin = time.partition_point(|t| t < from_s);
        let end = next.map_or(time.len(), |t| time.partition_point(|s| *s < t));
        if begin < end {
            all.push(data.phase(name, (*from_s, next.unwrap_or(last)), begin..end, agents, options));
        }
    }
    Ok(all)
}

struct Data<'a> {
    time: &'a [f64],
    omega: Vec<&'a [f64]>,
    V: Vec<&'a [f64]>,
    E: Vec<&'a [f64]>,
    p: Vec<&'a [f64]>,
    q: Vec<&'a [f64]>,
    T_omega: Option<&'a [f64]>,
    T_P: Option<&'a [f64]>,
}

impl Data<'_> {
    fn phase(
        &self,
        name: &str,
        (from_s, to_s): (f64, f64),
        samples: std::ops::Range<usize>,
        agents: &Agents,
        options: &PhaseOptions,
    ) -> Phase {
        let tail = self.time.partition_point(|t| *t < to_s - options.window_s);
        let window = tail.clamp(samples.start, samples.end - 1)..samples.end;
        let omega_at = |k: usize| worst(at(&self.omega, k).map(|v| v - agents.omega_ref));
        let p_at = |k: usize| {
            let mean = at(&self.p, k).sum::<f64>() / self.p.len() as f64;
            worst(at(&self.p, k).map(|v| v - mean))
        };
        let settled = |error: &dyn Fn(usize) -> f64, tolerance: f64| {
            // A gap in the record is no proof of being settled: the comparison is false for NaN.
            let late =
                samples.clone().rev().find(|&k| error(k).partial_cmp(&tolerance).is_none_or(|o| o.is_gt()));
            let from = late.map_or(samples.start, |k| k + 1);
            (from < samples.end).then(|| self.time.get(from).map_or(0.0, |t| t - from_s)).map(|t| t.max(0.0))
        };
        let certified = |column: Option<&[f64]>| {
            let values = column.filter(|_| from_s >= options.active_from_s)?.get(samples.clone())?;
            values.iter().copied().filter(|v| v.is_finite()).reduce(f64::max)
        };
        let energy_at = |k: usize| match agents.capacity.as_slice() {
            [] => spread(at(&self.E, k)),
            capacity => spread(at(&self.E, k).zip(capacity).map(|(e, c)| e / c)),
        };
        Phase {
            name: name.to_owned(),
            from_s,
            to_s,
            omega_peak: worst(samples.clone().map(omega_at)),
            omega_error: worst(window.clone().map(omega_at)),
            p_spread: worst(window.clone().map(|k| spread(at(&self.p, k)))),
            q_spread: worst(window.clone().map(|k| spread(at(&self.q, k)))),
            e_spread: worst(window.clone().map(energy_at)),
            V_error: worst(window.clone().map(|k| worst(at(&self.V, k).map(|v| v - agents.V_ref)))),
            omega_settled_s: settled(&omega_at, options.omega_tolerance),
            p_settled_s: settled(&p_at, options.p_tolerance),
            T_omega: certified(self.T_omega),
            T_P: certified(self.T_P),
        }
    }
}

fn at<'a>(series: &'a [&'a [f64]], k: usize) -> impl Iterator<Item = f64> + 'a {
    series.iter().map(move |s| s.get(k).copied().unwrap_or(f64::NAN))
}

/// Largest magnitude; NaN if any value is, so that a gap is never taken for a small error.
fn worst(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |w, v| if v.is_nan() || w.is_nan() { f64::NAN } else { w.max(v.abs()) })
}

/// Largest minus smallest; NaN if any value is.
fn spread(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        if v.is_nan() || low.is_nan() { (f64::NAN, f64::NAN) } else { (low.min(v), high.max(v)) }
    });
    if low > high { 0.0 } else { high - low }
}

/// The phases as a table, one row each.
pub fn phase_table(phases: &[Phase], agents: &Agents, options: &PhaseOptions) -> Item {
    let energy = if agents.capacity.is_empty() { "E spread (pu\u{b7}h)" } else { "SoC spread" };
    let header = [
        "phase",
        "t (s)",
        "peak \u{3c9} error",
        "\u{3c9} error",
        "K_P P spread",
        "K_Q Q spread",
        energy,
        "V error",
        "\u{3c9} settled (s)",
        "T_\u{3c9} (s)",
        "P settled (s)",
        "T_P (s)",
    ];
    let value = |v: f64| format_value(v, 3);
    let settled = |t: Option<f64>| t.map_or_else(|| "no".to_owned(), |t| format!("{t:.2}"));
    let certified = |t: Option<f64>| t.map_or_else(|| "\u{2013}".to_owned(), |t| format!("{t:.2}"));
    let row = |phase: &Phase| {
        vec![
            phase.name.clone(),
            format!("{}\u{a0}to\u{a0}{}", format_value(phase.from_s, 6), format_value(phase.to_s, 6)),
            value(phase.omega_peak),
            value(phase.omega_error),
            value(phase.p_spread),
            value(phase.q_spread),
            value(phase.e_spread),
            value(phase.V_error),
            settled(phase.omega_settled_s),
            certified(phase.T_omega),
            settled(phase.p_settled_s),
            certified(phase.T_P),
        ]
    };
    Item::Table(Table {
        caption: format!(
            "Worst over all BESS, per unit, over the last {} s of each phase (peak: over all of it). Errors are against the \
             references; spreads are largest minus smallest. Settled: time after the event from which \u{3c9} stays \
             within {} of its reference, and K_P P within {} of its mean. T_\u{3c9}, T_P: certified times, the \
             largest of the phase; on a grid they are estimates.",
            format_value(options.window_s, 3),
            format_value(options.omega_tolerance, 3),
            format_value(options.p_tolerance, 3)
        ),
        header: header.map(str::to_owned).to_vec(),
        rows: phases.iter().map(row).collect(),
    })
}

/// A number for people: `digits` significant digits, with an exponent where it is very small or large,
/// without trailing zeros; a dash where it is not finite.
pub fn format_value(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "\u{2013}".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = digits.clamp(1, 17);
    let rounded = format!("{value:.*e}", digits - 1);
    let Some((mantissa, exponent)) = rounded.split_once('e') else {
        return rounded;
    };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let trimmed = |s: &str| {
        if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.').to_owned() } else { s.to_owned() }
    };
    if (-3..6).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        trimmed(&format!("{value:.decimals$}"))
    } else {
        format!("{}e{exponent}", trimmed(mantissa))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two agents, 0 to 10 s in steps of 1 s. omega is off by 0.01 and closes in from the event at 4 s:
    /// 0.01 (1 - (t - 4) / 3) until 7 s, then 0. P sits at 1 and 2 throughout.
    fn record() -> (Vec<f64>, Vec<(String, Vec<f64>)>) {
        let time: Vec<f64> = (0..=10).map(f64::from).collect();
        let error = |t: f64| 0.01 * (1.0 - (t - 4.0) / 3.0).clamp(0.0, 1.0);
        let mut data = Vec::new();
        for i in [1, 2] {
            let sign = if i == 1 { 1.0 } else { -1.0 };
            data.push((format!("grid.omega[{i}]"), time.iter().map(|&t| 1.0 + sign * error(t)).collect()));
            data.push((format!("grid.P[{i}]"), vec![f64::from(i); 11]));
            data.push((format!("grid.Q[{i}]"), vec![0.5; 11]));
            data.push((format!("grid.V[{i}]"), vec![1.0 + 0.002 * f64::from(i); 11]));
            data.push((
                format!("grid.E[{i}]"),
                time.iter().map(|t| f64::from(i) * (1.0 - 0.01 * t)).collect(),
            ));
        }
        data.push(("controller.T_omega".to_owned(), time.iter().map(|&t| (9.0 - t).max(0.0)).collect()));
        (time, data)
    }

    fn run(events: &[(f64, String)], options: &PhaseOptions, capacity: &[f64]) -> Vec<Phase> {
        let (time, data) = record();
        let columns =
            Columns::new(&time, data.iter().map(|(name, y)| (name.as_str(), y.as_slice()))).unwrap();
        let mut agents = Agents::numbered(&[1.0, 0.5], &[1.0, 3.0]);
        agents.capacity = capacity.to_vec();
        phases(&columns, &agents, events, options).unwrap()
    }

    #[test]
    fn each_phase_has_the_figures_of_the_closed_form() {
        let options = PhaseOptions { active_from_s: 4.0, window_s: 0.0, ..PhaseOptions::default() };
        let all = run(&[(4.0, "on".to_owned())], &options, &[1.0, 2.0]);
        assert_eq!(all.len(), 2);
        let (before, after) = (&all[0], &all[1]);
        assert_eq!((before.name.as_str(), before.from_s, before.to_s), ("start", 0.0, 4.0));
        assert!((before.omega_error - 0.01).abs() < 1e-15 && before.omega_settled_s.is_none());
        assert_eq!((before.T_omega, before.T_P), (None, None));
        assert_eq!((after.name.as_str(), after.from_s, after.to_s), ("on", 4.0, 10.0));
        assert!((after.omega_peak - 0.01).abs() < 1e-15);
        assert_eq!((after.omega_error, after.omega_settled_s), (0.0, Some(3.0)));
        // p = (1, 1); q = (0.5, 1.5); V_2 is off by 0.004; both SoC stand at 0.9.
        assert_eq!((after.p_spread, after.p_settled_s, after.q_spread), (0.0, Some(0.0), 1.0));
        assert!((after.V_error - 0.004).abs() < 1e-15 && after.e_spread.abs() < 1e-15);
        assert_eq!(after.T_omega, Some(5.0));
        assert!(after.settled() && !before.settled());
        // The last 5 s begin at 5 s, where two thirds of the error are left.
        let last_seconds = run(&[(4.0, "on".to_owned())], &PhaseOptions::default(), &[1.0, 2.0]);
        assert!((last_seconds[1].omega_error - 0.02 / 3.0).abs() < 1e-15);
        let energies = run(&[], &options, &[]);
        assert!((energies[0].e_spread - 0.9).abs() < 1e-15);
    }

    #[test]
    fn events_at_one_instant_begin_one_phase_and_those_outside_none() {
        let events: Vec<_> = [(4.0, "b3"), (-1.0, "early"), (4.0, "load"), (0.0, "on"), (99.0, "late")]
            .map(|(t, label)| (t, label.to_owned()))
            .to_vec();
        let all = run(&events, &PhaseOptions::default(), &[]);
        let names: Vec<_> = all.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["on", "b3, load"]);
    }

    #[test]
    fn a_gap_is_never_settled() {
        let (time, mut data) = record();
        data[0].1[10] = f64::NAN;
        let columns =
            Columns::new(&time, data.iter().map(|(name, y)| (name.as_str(), y.as_slice()))).unwrap();
        let agents = Agents::numbered(&[1.0, 0.5], &[1.0, 3.0]);
        let all = phases(&columns, &agents, &[], &PhaseOptions::default()).unwrap();
        assert!(all[0].omega_settled_s.is_none() && all[0].omega_error.is_nan());
    }

    #[test]
    fn numbers_read_well() {
        let cases = [
            (0.0, "0"),
            (0.012_345, "0.0123"),
            (1.0, "1"),
            (-2.5e-7, "-2.5e-7"),
            (9.9996e-4, "0.001"),
            (123_456.0, "123456"),
            (4.44e-16, "4.44e-16"),
            (1e6, "1e6"),
            (f64::NAN, "\u{2013}"),
        ];
        for (value, text) in cases {
            assert_eq!(format_value(value, 3), text, "{value:e}");
        }
        assert_eq!(format_value(80.0, 6), "80");
    }
}

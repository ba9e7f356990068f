//! The table of faults: how far a fault draws a run away, whether limits held, whether setpoints jumped, and how long
//! it takes to converge again. Reads recorded columns, which hold what is true and not what was measured.

use super::columns::Columns;
use super::error::ReportError;
use super::phases::format_value;
use super::standard::{Agents, scaled_power};
use super::{Item, Table};
use serde::Serialize;
use std::ops::Range;

/// What a row is about.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultWindow {
    /// The fault, in words.
    pub label: String,
    /// Its begin, s.
    pub from_s: f64,
    /// Its end, s; none where it does not end.
    pub until_s: Option<f64>,
    /// Agents, from 0, that do not count while it lasts.
    pub affected: Vec<usize>,
    /// Converged is who stays within this, pu: omega of its reference, p_i of the mean.
    pub tolerance: f64,
    /// Why it cannot converge, where it is known that it cannot.
    pub cannot: Option<String>,
}

/// What must be kept at every instant; n values each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeptLimits {
    /// Least and largest frequency setpoint, pu.
    pub omega_set: Option<[f64; 2]>,
    /// Least and largest voltage setpoint, pu.
    pub V_set: Option<[f64; 2]>,
    /// Largest abs(P_set_i), pu.
    pub P_set: Vec<f64>,
    /// Largest abs(P_i), pu.
    pub P: Option<Vec<f64>>,
    /// Largest rates of omega_set, V_set and P_set, pu/s.
    pub rates: [Option<Vec<f64>>; 3],
}

/// One fault in a line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FaultRow {
    /// The fault.
    pub label: String,
    /// Its begin, s.
    pub from_s: f64,
    /// Its end, s.
    pub until_s: Option<f64>,
    /// Largest abs(omega_i - omega_ref) of any agent from its begin on, pu.
    pub omega_worst: f64,
    /// Spread of K_P_i (P_i - P_set_i) of the agents that count, in the last 5 s of the fault, pu.
    pub p_spread_during: f64,
    /// The same of all agents in the last 5 s of the run; of those that count where the fault does not end.
    pub p_spread_after: f64,
    /// Limits that were not kept, in words; empty where all were.
    pub broken: Vec<String>,
    /// Largest step of an omega_set_i between two communication points from the fault on, pu.
    pub omega_set_jump: f64,
    /// Of a V_set_i, pu.
    pub V_set_jump: f64,
    /// Of a P_set_i, pu.
    pub P_set_jump: f64,
    /// Largest abs(sum of P_set) from the fault on, pu.
    pub P_set_sum: f64,
    /// Time after the end of the fault (its begin, where it does not end) from which all stays converged, s.
    pub converged_s: Option<f64>,
    /// Why it cannot, where it cannot.
    pub cannot: Option<String>,
}

/// Length of the stretch over which spreads are taken, s.
const WINDOW_S: f64 = 5.0;
/// What a sum of rounded numbers may be off, pu.
const ROUNDING: f64 = 1e-9;

/// Sums up one run.
pub fn fault_row(
    columns: &Columns<'_>,
    agents: &Agents,
    limits: &KeptLimits,
    window: &FaultWindow,
) -> Result<FaultRow, ReportError> {
    let n = agents.check()?;
    let time = columns.time_s();
    let (p, _) = scaled_power(columns, "P", &agents.K_P)?;
    let omega = columns.require_group("grid.omega", n)?;
    let P = columns.require_group("grid.P", n)?;
    let set = |name: &str| columns.require_group(&format!("controller.{name}"), n);
    let (omega_set, V_set, P_set) = (set("omega_set")?, set("V_set")?, set("P_set")?);
    let sample = |t: f64| time.partition_point(|s| *s < t - 1e-9);
    let end = time.last().copied().unwrap_or(0.0);
    let all: Vec<usize> = (0..n).collect();
    let others: Vec<usize> = (0..n).filter(|i| !window.affected.contains(i)).collect();
    let after = if window.until_s.is_some() { &all } else { &others };

    let from = sample(window.from_s)..time.len();
    let value = |series: &[f64], k: usize| series.get(k).copied().unwrap_or(f64::NAN);
    let of = |counted: &[usize], k: usize| -> Vec<f64> {
        counted.iter().filter_map(|&i| p.get(i)).map(|p| value(p, k)).collect()
    };
    let spread = |counted: &[usize], samples: Range<usize>| {
        worst(samples.map(|k| {
            let values = of(counted, k);
            worst(values.iter().map(|a| worst(values.iter().map(|b| a - b))))
        }))
    };
    let off = |counted: &[usize], k: usize| {
        let values = of(counted, k);
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let omega = counted.iter().filter_map(|&i| omega.get(i)).map(|w| value(w, k) - agents.omega_ref);
        worst(values.iter().map(|p| p - mean).chain(omega))
    };
    let counts_from = window.until_s.unwrap_or(window.from_s);
    let last_off = (sample(counts_from)..time.len())
        .rev()
        .find(|&k| off(after, k).partial_cmp(&window.tolerance).is_none_or(|order| order.is_gt()));
    let converged = last_off.map_or(sample(counts_from), |k| k + 1);
    let during_end = window.until_s.unwrap_or(end);
    let within = |to_s: f64| sample(to_s - WINDOW_S)..sample(to_s).max(sample(to_s - WINDOW_S) + 1);
    let jump = |series: &[&[f64]]| {
        let steps = |s: &&[f64]| {
            let from = from.start.saturating_sub(1);
            worst(s.get(from..).unwrap_or_default().windows(2).map(|w| w[1] - w[0]))
        };
        worst(series.iter().map(steps))
    };
    let sum = |k: usize| P_set.iter().map(|s| value(s, k)).sum::<f64>();
    let course = Course { time, P: &P, set: [&omega_set, &V_set, &P_set] };
    Ok(FaultRow {
        label: window.label.clone(),
        from_s: window.from_s,
        until_s: window.until_s,
        omega_worst: worst(
            from.clone().flat_map(|k| omega.iter().map(move |w| value(w, k) - agents.omega_ref)),
        ),
        p_spread_during: spread(&others, within(during_end)),
        p_spread_after: spread(after, within(end)),
        broken: course.broken(limits, from.clone()),
        omega_set_jump: jump(&omega_set),
        V_set_jump: jump(&V_set),
        P_set_jump: jump(&P_set),
        P_set_sum: worst(from.map(sum)),
        // What has just come within the tolerance may be rocking through it.
        converged_s: (value(time, converged) + WINDOW_S <= end)
            .then(|| (value(time, converged) - counts_from).max(0.0)),
        cannot: window.cannot.clone(),
    })
}

struct Course<'a> {
    time: &'a [f64],
    P: &'a [&'a [f64]],
    set: [&'a [&'a [f64]]; 3],
}

impl Course<'_> {
    /// The limits that were not kept within these samples, in words.
    fn broken(&self, limits: &KeptLimits, samples: Range<usize>) -> Vec<String> {
        let mut broken = Vec::new();
        let [omega_set, V_set, P_set] = self.set;
        let within = |s: &[f64]| s.get(samples.clone()).unwrap_or_default().to_vec();
        for (name, series, range) in
            [("omega_set", omega_set, limits.omega_set), ("V_set", V_set, limits.V_set)]
        {
            let Some([low, high]) = range else { continue };
            for (i, s) in series.iter().enumerate() {
                let beyond = |v: &f64| !(*v >= low - ROUNDING && *v <= high + ROUNDING);
                if let Some(v) = within(s).into_iter().find(beyond) {
                    broken.push(format!("{name}[{}] = {} beyond {low} to {high}", i + 1, format_value(v, 4)));
                }
            }
        }
        for ((i, s), limit) in P_set.iter().enumerate().zip(&limits.P_set) {
            let most = worst(within(s).into_iter());
            if most.is_nan() || most > limit + ROUNDING {
                broken.push(format!("P_set[{}] up to {} beyond {limit}", i + 1, format_value(most, 4)));
            }
        }
        for (name, (series, rates)) in
            ["omega_set", "V_set", "P_set"].into_iter().zip(self.set.into_iter().zip(&limits.rates))
        {
            for ((i, s), rate) in series.iter().enumerate().zip(rates.iter().flatten()) {
                let faster = |k: usize| {
                    let (Some(a), Some(b)) = (s.get(k), s.get(k + 1)) else { return false };
                    let (Some(t), Some(u)) = (self.time.get(k), self.time.get(k + 1)) else { return false };
                    (b - a).abs() > rate * (u - t) + ROUNDING
                };
                if samples.clone().any(faster) {
                    broken.push(format!("rate of {name}[{}] beyond {rate} pu/s", i + 1));
                }
            }
        }
        for ((i, s), limit) in self.P.iter().enumerate().zip(limits.P.iter().flatten()) {
            // What a regulation of a measured power can keep; see docs/faults.md.
            let beyond = within(s).into_iter().filter(|P| P.is_nan() || P.abs() > 1.01 * limit);
            let (count, most) = beyond.fold((0, 0.0_f64), |(count, most), P| (count + 1, most.max(P.abs())));
            if count > 0 {
                let step_s = self.time.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
                let (most, long) = (format_value(most, 3), format_value(f64::from(count) * step_s, 2));
                broken.push(format!("P[{}] up to {most} beyond {limit} for {long} s", i + 1));
            }
        }
        broken
    }
}

/// Largest magnitude; NaN if any value is, so that a gap is never taken for a small error.
fn worst(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |w: f64, v| if v.is_nan() || w.is_nan() { f64::NAN } else { w.max(v.abs()) })
}

const HEADER: [&str; 11] = [
    "fault",
    "from (s)",
    "until (s)",
    "worst \u{3c9} error",
    "K_P P spread meanwhile",
    "K_P P spread after",
    "limits kept",
    "\u{3c9}_set per step",
    "V_set per step",
    "P_set per step",
    "converged again (s)",
];

fn cells(row: &FaultRow) -> Vec<String> {
    let value = |v: f64| format_value(v, 2);
    let converged = match (row.converged_s, &row.cannot) {
        (Some(t), _) => format!("{t:.2}"),
        (None, Some(why)) => format!("cannot: {why}"),
        (None, None) => "no".into(),
    };
    vec![
        row.label.clone(),
        format_value(row.from_s, 6),
        row.until_s.map_or("\u{2013}".into(), |t| format_value(t, 6)),
        value(row.omega_worst),
        value(row.p_spread_during),
        value(row.p_spread_after),
        if row.broken.is_empty() { "yes".into() } else { row.broken.join("; ") },
        value(row.omega_set_jump),
        value(row.V_set_jump),
        value(row.P_set_jump),
        converged,
    ]
}

/// The rows as a table of the report.
pub fn fault_table(rows: &[FaultRow]) -> Item {
    Item::Table(Table {
        caption: "What is true, not what was measured; per unit. Meanwhile: the last 5 s of the fault, of the batteries that it \
                  leaves alone. After: the last 5 s of the run, of all that are whole again. Per step: the largest \
                  move of a setpoint between two communication points from the fault on. Converged: time after the \
                  end of the fault, or after its begin where it does not end."
            .into(),
        header: HEADER.map(str::to_owned).to_vec(),
        rows: rows.iter().map(cells).collect(),
    })
}

/// The rows as lines of cells, the header first.
pub fn fault_lines(rows: &[FaultRow]) -> Vec<Vec<String>> {
    std::iter::once(HEADER.map(str::to_owned).to_vec()).chain(rows.iter().map(cells)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two agents, 0 to 20 s in steps of 1 s. From 5 to 10 s agent 2 is drawn off by 0.4 in P and 0.01 in omega; then
    /// both errors close in linearly until 14 s. The setpoints make one step of 0.003.
    fn row(limits: &KeptLimits, until_s: Option<f64>) -> FaultRow {
        let time: Vec<f64> = (0..=20).map(f64::from).collect();
        let share = |t: f64| if t < 5.0 { 0.0 } else { 1.0 - ((t - 10.0) / 4.0).clamp(0.0, 1.0) };
        let of = |f: &dyn Fn(f64) -> f64| time.iter().map(|&t| f(t)).collect::<Vec<f64>>();
        let data = [
            ("grid.omega[1]", of(&|_| 1.0)),
            ("grid.omega[2]", of(&|t| 1.0 + 0.01 * share(t))),
            ("grid.P[1]", of(&|_| 1.0)),
            ("grid.P[2]", of(&|t| 1.0 + 0.4 * share(t))),
            ("controller.P_set[1]", of(&|_| 0.2)),
            ("controller.P_set[2]", of(&|_| -0.2)),
            ("controller.omega_set[1]", of(&|t| if t < 8.0 { 1.0 } else { 1.003 })),
            ("controller.omega_set[2]", of(&|_| 1.0)),
            ("controller.V_set[1]", of(&|_| 1.0)),
            ("controller.V_set[2]", of(&|_| 1.0)),
        ];
        let columns = Columns::new(&time, data.iter().map(|(name, y)| (*name, y.as_slice()))).unwrap();
        let agents = Agents::numbered(&[0.5, 0.5], &[1.0, 1.0]);
        let window = FaultWindow {
            label: "stuck".into(),
            from_s: 5.0,
            until_s,
            affected: vec![1],
            tolerance: 1e-3,
            cannot: None,
        };
        fault_row(&columns, &agents, limits, &window).unwrap()
    }

    #[test]
    fn a_row_has_the_figures_of_the_closed_form() {
        let row = row(&KeptLimits::default(), Some(10.0));
        assert!((row.omega_worst - 0.01).abs() < 1e-15);
        assert_eq!(row.p_spread_during, 0.0, "one agent alone shares with itself");
        // p = 0.5 (P - P_set): P_set alone keeps them 0.2 apart, so they never converge.
        assert!((row.p_spread_after - 0.2).abs() < 1e-15 && row.converged_s.is_none());
        assert!((row.omega_set_jump - 0.003).abs() < 1e-15 && row.P_set_jump == 0.0);
        assert!(row.broken.is_empty() && row.P_set_sum.abs() < 1e-15);
    }

    #[test]
    fn who_does_not_count_does_not_keep_a_lasting_fault_from_converging() {
        assert_eq!(row(&KeptLimits::default(), None).converged_s, Some(0.0));
    }

    #[test]
    fn every_broken_limit_is_named() {
        let limits = KeptLimits {
            omega_set: Some([0.99, 1.001]),
            V_set: Some([0.9, 1.1]),
            P_set: vec![0.1, 0.3],
            P: Some(vec![1.2, 1.2]),
            rates: [Some(vec![0.002, 0.002]), None, None],
        };
        let broken = row(&limits, Some(10.0)).broken;
        assert_eq!(
            broken,
            [
                "omega_set[1] = 1.003 beyond 0.99 to 1.001",
                "P_set[1] up to 0.2 beyond 0.1",
                "rate of omega_set[1] beyond 0.002 pu/s",
                "P[2] up to 1.4 beyond 1.2 for 7 s",
            ]
        );
    }
}

//! The figures that every run has: the five states over time (as the paper's Figure 6) and the two
//! error systems on a logarithmic axis (as its Figure 7).

use super::columns::Columns;
use super::error::ReportError;
use super::figure::{Dash, Figure, Line};
use super::palette::dash_of;
use std::sync::Arc;

/// What the figures need to know about the agents.
#[derive(Clone, Debug, Default)]
pub struct Agents {
    /// Names in the legends; their number is the number of agents n.
    pub names: Vec<String>,
    /// Droop coefficients of (3), pu/pu, n of them.
    pub K_P: Vec<f64>,
    /// Droop coefficients of (3), pu/pu, n of them.
    pub K_Q: Vec<f64>,
    /// Capacities C_i, pu*h, n of them: states of charge E_i / C_i are then compared in place of E_i.
    /// Empty where unknown.
    pub capacity: Vec<f64>,
    /// Frequency of the virtual leader, pu.
    pub omega_ref: f64,
    /// Voltage of the virtual leader, pu.
    pub V_ref: f64,
}

impl Agents {
    /// Agents named "BESS 1" to "BESS n" with references 1 pu.
    pub fn numbered(K_P: &[f64], K_Q: &[f64]) -> Self {
        Self {
            names: (1..=K_P.len()).map(|i| format!("BESS {i}")).collect(),
            K_P: K_P.to_vec(),
            K_Q: K_Q.to_vec(),
            capacity: Vec::new(),
            omega_ref: 1.0,
            V_ref: 1.0,
        }
    }

    pub(super) fn check(&self) -> Result<usize, ReportError> {
        let n = self.names.len();
        let lengths = [("K_P", self.K_P.len()), ("K_Q", self.K_Q.len()), ("capacity", self.capacity.len())];
        for (place, found) in lengths {
            if found != n && !(place == "capacity" && found == 0) {
                let place = format!("agents, {place}");
                return Err(ReportError::Length { place, found, expected: n, reason: "one per name" });
            }
        }
        Ok(n)
    }
}

/// Errors below this are drawn at it: about the rounding of a number near 1, and a logarithmic axis
/// cannot show 0.
pub const ERROR_FLOOR: f64 = 1e-16;

/// Beyond this number of agents the figures show some of them between the extremes of all.
pub const MAX_LINES: usize = 28;

/// omega, P, E, V and Q of every agent over time, from `grid.omega[1]` and so on.
pub fn five_states(
    columns: &Columns<'_>,
    agents: &Agents,
    events: &[(f64, String)],
) -> Result<Vec<Figure>, ReportError> {
    let n = agents.check()?;
    let states = [
        ("omega", "Frequency", "\u{3c9} (pu)"),
        ("P", "Active power", "P (pu)"),
        ("E", "Energy", "E (pu\u{b7}h)"),
        ("V", "Voltage", "V (pu)"),
        ("Q", "Reactive power", "Q (pu)"),
    ];
    let mut figures = Vec::with_capacity(states.len());
    for (name, title, y_label) in states {
        let series = columns.require_group(&format!("grid.{name}"), n)?;
        let series = series.into_iter().map(<[f64]>::to_vec).collect();
        figures.push(over_time(title, y_label, columns, agents, series, events));
    }
    Ok(figures)
}

/// abs(omega_i - omega_ref) and abs(p_i - mean(p)) over time, p_i = K_P_i (P_i - P_set_i), where
/// `controller.P_set[i]` counts as 0 unless recorded.
pub fn error_systems(
    columns: &Columns<'_>,
    agents: &Agents,
    events: &[(f64, String)],
) -> Result<Vec<Figure>, ReportError> {
    let n = agents.check()?;
    let omega = columns.require_group("grid.omega", n)?;
    let frequency = omega.iter().map(|s| s.iter().map(|v| floored(v - agents.omega_ref)).collect()).collect();
    let (scaled, with_reference) = scaled_power(columns, "P", &agents.K_P)?;
    let samples = columns.time_s().len();
    let mut power: Vec<Vec<f64>> = vec![Vec::with_capacity(samples); n];
    for k in 0..samples {
        let at = |s: &Vec<f64>| s.get(k).copied().unwrap_or(f64::NAN);
        let mean = scaled.iter().map(at).sum::<f64>() / n as f64;
        for (out, s) in power.iter_mut().zip(&scaled) {
            out.push(floored(at(s) - mean));
        }
    }
    let share = if with_reference {
        "|K_P (P \u{2212} P_set) \u{2212} mean| (pu)"
    } else {
        "|K_P P \u{2212} mean| (pu)"
    };
    let mut figures = vec![
        over_time(
            "Frequency error",
            "|\u{3c9} \u{2212} \u{3c9}_ref| (pu)",
            columns,
            agents,
            frequency,
            events,
        ),
        over_time("Active power sharing error", share, columns, agents, power, events),
    ];
    for figure in &mut figures {
        figure.log_y = true;
        figure.note.push_str("Errors below 1e-16 are drawn at 1e-16.");
    }
    Ok(figures)
}

/// K_i (P_i - P_set_i) of every agent (or Q), and whether the references were recorded.
pub(super) fn scaled_power(
    columns: &Columns<'_>,
    quantity: &str,
    gains: &[f64],
) -> Result<(Vec<Vec<f64>>, bool), ReportError> {
    let power = columns.require_group(&format!("grid.{quantity}"), gains.len())?;
    let references = columns.get_group(&format!("controller.{quantity}_set"), gains.len());
    let mut scaled = Vec::with_capacity(gains.len());
    for (i, (series, gain)) in power.iter().zip(gains).enumerate() {
        let reference = references.as_ref().and_then(|r| r.get(i));
        let at = |k: usize| reference.and_then(|r| r.get(k)).copied().unwrap_or(0.0);
        scaled.push(series.iter().enumerate().map(|(k, v)| gain * (v - at(k))).collect());
    }
    Ok((scaled, references.is_some()))
}

fn floored(error: f64) -> f64 {
    if error.is_finite() { error.abs().max(ERROR_FLOOR) } else { f64::NAN }
}

fn over_time(
    title: &str,
    y_label: &str,
    columns: &Columns<'_>,
    agents: &Agents,
    series: Vec<Vec<f64>>,
    events: &[(f64, String)],
) -> Figure {
    let time = columns.time_s();
    let n = series.len();
    let mut lines = Vec::with_capacity(n.min(MAX_LINES) + 2);
    let mut note = String::new();
    if n > MAX_LINES {
        for (name, pick) in
            [("largest of all", f64::max as fn(f64, f64) -> f64), ("smallest of all", f64::min)]
        {
            let y = (0..time.len())
                .map(|k| series.iter().filter_map(|s| s.get(k)).copied().fold(f64::NAN, pick))
                .collect();
            lines.push(Line { name: name.to_owned(), x: time.clone(), y, color: None, dash: Dash::Dot });
        }
        note = format!("{MAX_LINES} of {n} BESS, evenly chosen; grey: the range of all. ");
    }
    let shown = n.min(MAX_LINES);
    for (i, (y, name)) in series.into_iter().zip(&agents.names).enumerate() {
        // The first agent of each of `shown` equal parts.
        if (i * shown) % n < shown {
            let (name, x) = (name.clone(), Arc::clone(time));
            lines.push(Line { name, x, y, color: Some(i), dash: dash_of(i) });
        }
    }
    Figure {
        title: title.to_owned(),
        x_label: "t (s)".to_owned(),
        y_label: y_label.to_owned(),
        log_y: false,
        lines,
        events: events.to_vec(),
        note,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two agents whose errors are known: omega off by 1e-3 and 0, K_P P equal to 1 and 3.
    fn columns<'a>(data: &'a [(String, Vec<f64>)], time: &[f64]) -> Columns<'a> {
        Columns::new(time, data.iter().map(|(name, y)| (name.as_str(), y.as_slice()))).unwrap()
    }

    fn data(n: usize) -> Vec<(String, Vec<f64>)> {
        let mut all = Vec::new();
        for name in ["omega", "P", "E", "V", "Q"] {
            for i in 1..=n {
                let y = match (name, i) {
                    ("omega", 1) => vec![1.001; 3],
                    ("P", i) => vec![i as f64; 3],
                    _ => vec![1.0; 3],
                };
                all.push((format!("grid.{name}[{i}]"), y));
            }
        }
        all
    }

    #[test]
    fn errors_are_those_of_the_definition() {
        let d = data(2);
        let agents = Agents::numbered(&[1.0, 1.5], &[1.0, 1.0]);
        let figures = error_systems(&columns(&d, &[0.0, 1.0, 2.0]), &agents, &[]).unwrap();
        assert!(figures.iter().all(|f| f.log_y));
        assert!((figures[0].lines[0].y[1] - 1e-3).abs() < 1e-15);
        assert_eq!(figures[0].lines[1].y[1], ERROR_FLOOR);
        // p = (1, 3), mean 2.
        assert_eq!((figures[1].lines[0].y[2], figures[1].lines[1].y[2]), (1.0, 1.0));
    }

    #[test]
    fn a_recorded_reference_is_subtracted() {
        let mut d = data(2);
        d.push(("controller.P_set[1]".to_owned(), vec![-1.0; 3]));
        d.push(("controller.P_set[2]".to_owned(), vec![1.0; 3]));
        let agents = Agents::numbered(&[1.0, 4.0], &[1.0, 1.0]);
        let figures = error_systems(&columns(&d, &[0.0, 1.0, 2.0]), &agents, &[]).unwrap();
        // p = (1 * (1 + 1), 4 * (2 - 1)) = (2, 4), mean 3.
        assert_eq!((figures[1].lines[0].y[0], figures[1].lines[1].y[0]), (1.0, 1.0));
        assert!(figures[1].y_label.contains("P_set"));
    }

    #[test]
    fn five_states_show_every_agent_and_name_a_missing_column() {
        let mut d = data(7);
        let agents = Agents::numbered(&[1.0; 7], &[1.0; 7]);
        let figures =
            five_states(&columns(&d, &[0.0, 1.0, 2.0]), &agents, &[(1.0, "on".to_owned())]).unwrap();
        assert_eq!(figures.len(), 5);
        assert!(figures.iter().all(|f| f.lines.len() == 7 && f.events.len() == 1));
        d.retain(|(name, _)| name != "grid.V[5]");
        let message = five_states(&columns(&d, &[0.0, 1.0, 2.0]), &agents, &[]).unwrap_err().to_string();
        assert!(message.starts_with("column `grid.V[5]` is missing"), "{message}");
    }

    #[test]
    fn of_many_agents_some_are_shown_within_the_range_of_all() {
        let n = 1000;
        let d = data(n);
        let agents = Agents::numbered(&vec![1.0; n], &vec![1.0; n]);
        let figures = five_states(&columns(&d, &[0.0, 1.0, 2.0]), &agents, &[]).unwrap();
        let power = &figures[1];
        assert_eq!(power.lines.len(), MAX_LINES + 2);
        assert_eq!((power.lines[0].y[0], power.lines[1].y[0]), (1000.0, 1.0));
        assert!(power.note.contains("of 1000"));
    }
}

//! The certified times over eta, as figures of the report: for every topology the eigenvalues and the times,
//! corrected and as printed. Computes each value as `bounds` does; prints nothing.

use super::Failure;
use super::bounds::Bounds;
use crate::control::Controller;
use crate::control::certificates::{settling_time, settling_time_as_printed};
use crate::report::{Dash, Figure, Line};
use crate::scenario::Resolved;
use miette::IntoDiagnostic;
use std::sync::Arc;

/// What stands above the figures.
pub const TEXT: &str = "What Theorem 1 certifies, from the errors at which the droop alone settles, if only eta were \
                        another. Solid: corrected; dashed: as printed in (27) and (33), 2^((1\u{2212}eta)/2) times as \
                        long. The weights behind the eigenvalues are (g w)^(2/(1+eta)), hence these change with eta too.";

/// Points of each line; with many agents fewer, because each needs its eigenvalues.
const POINTS: usize = 91;
const POINTS_OF_MANY: usize = 10;
const MANY: usize = 100;

/// The eigenvalues of one topology over eta.
struct Over {
    name: String,
    lambda_2: Vec<f64>,
    lambda_omega: Vec<f64>,
}

/// T_P, T_omega and the eigenvalues over eta from 0.05 to 0.95.
pub fn figures(resolved: &Resolved, bounds: &Bounds) -> Result<Vec<Figure>, Failure> {
    let points = if resolved.control.agents() > MANY { POINTS_OF_MANY } else { POINTS };
    let eta: Arc<[f64]> = (0..points).map(|k| 0.05 + 0.9 * k as f64 / (points - 1) as f64).collect();
    let mut controller = Controller::new(resolved.control.clone()).into_diagnostic()?;
    let mut all = Vec::with_capacity(controller.topologies().count());
    for k in 0..controller.topologies().count() {
        controller.inputs_mut().topology = k as i32 + 1;
        let name = resolved.control.communication.topology_name(k).unwrap_or_default().to_owned();
        let mut over = Over { name, lambda_2: Vec::new(), lambda_omega: Vec::new() };
        for eta in &*eta {
            controller.parameters_mut().eta = *eta;
            controller.refresh(&mut |_| {});
            over.lambda_2.push(controller.spectrum().lambda_2);
            over.lambda_omega.push(controller.spectrum().omega.lambda.value);
        }
        all.push(over);
    }
    let times = |title: &str, symbol: &str, error: f64, lambda: fn(&Over) -> &[f64]| {
        let mut lines = Vec::with_capacity(2 * all.len());
        for (k, over) in all.iter().enumerate() {
            let line = |what: &str, dash, time: fn(f64, f64, f64) -> f64| {
                let y = eta.iter().zip(lambda(over)).map(|(eta, lambda)| time(error, *lambda, *eta));
                Line {
                    name: format!("{}{what}", over.name),
                    x: eta.clone(),
                    y: y.collect(),
                    color: Some(k),
                    dash,
                }
            };
            lines.push(line(", corrected", Dash::Solid, settling_time));
            lines.push(line(", as printed", Dash::Dash, settling_time_as_printed));
        }
        figure(title, &format!("{symbol} (s)"), lines, bounds.eta)
    };
    let mut eigenvalues = Vec::with_capacity(2 * all.len());
    for (k, over) in all.iter().enumerate() {
        for (symbol, y, dash) in
            [("\u{3bb}_2", &over.lambda_2, Dash::Solid), ("\u{3bb}_\u{3c9}", &over.lambda_omega, Dash::Dot)]
        {
            let name = format!("{}, {symbol}", over.name);
            eigenvalues.push(Line { name, x: eta.clone(), y: y.clone(), color: Some(k), dash });
        }
    }
    Ok(vec![
        times("Certified time of power sharing over eta", "T_P", bounds.error_p, |o| &o.lambda_2),
        times("Certified time of the frequency over eta", "T_\u{3c9}", bounds.error_omega, |o| {
            &o.lambda_omega
        }),
        figure("Eigenvalues over eta", "\u{3bb}", eigenvalues, bounds.eta),
    ])
}

fn figure(title: &str, y_label: &str, lines: Vec<Line>, eta: f64) -> Figure {
    Figure {
        title: title.to_owned(),
        x_label: "eta".to_owned(),
        y_label: y_label.to_owned(),
        log_y: true,
        lines,
        events: vec![(eta, format!("eta = {eta}"))],
        note: String::new(),
    }
}

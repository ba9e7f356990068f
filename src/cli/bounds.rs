//! `bess bounds`: what the paper's theorem certifies for a scenario.

use super::{Failure, ScenarioArgs, print};
use crate::control::Controller;
use crate::control::certificates::{settling_time, settling_time_as_printed};
use crate::grid::GridModel;
use crate::report::{Table, format_value};
use crate::scenario::Resolved;
use miette::IntoDiagnostic;
use std::fmt::Write as _;

/// lambda_2 and the certified times of every topology, from the errors at which the droop alone settles.
pub struct Bounds {
    /// The scenario's exponent.
    pub(super) eta: f64,
    /// norm(K_P P - mean), pu.
    pub(super) error_p: f64,
    /// norm(omega - 1), pu.
    pub(super) error_omega: f64,
    topologies: Vec<Certified>,
}

/// What holds for one topology.
struct Certified {
    name: String,
    lambda_2: f64,
    lambda_omega: f64,
    /// T_P and T_omega, each corrected and as printed, s.
    T_P: [f64; 2],
    T_omega: [f64; 2],
}

impl Bounds {
    /// Computes them.
    pub fn of(resolved: &Resolved) -> Result<Self, Failure> {
        let none = || Failure {
            report: miette::miette!(
                "grid.case is \"none\": the errors at the start are not known; expected a case"
            ),
            code: 2,
        };
        let config = resolved.grid.as_ref().ok_or_else(none)?;
        let mut grid = GridModel::new(config).into_diagnostic()?;
        grid.initialise().into_diagnostic()?;
        let n = grid.n();
        let p: Vec<f64> = (0..n).map(|i| resolved.control.K_P[i] * grid.P(i)).collect();
        let mean = p.iter().sum::<f64>() / n as f64;
        let error_p = norm(p.iter().map(|p| p - mean));
        let error_omega = norm((0..n).map(|i| grid.omega(i) - 1.0));
        let eta = resolved.control.eta;
        let mut controller = Controller::new(resolved.control.clone()).into_diagnostic()?;
        let mut topologies = Vec::with_capacity(controller.topologies().count());
        for k in 0..controller.topologies().count() {
            controller.inputs_mut().topology = k as i32 + 1;
            controller.refresh(&mut |_| {});
            let spectrum = controller.spectrum();
            let (lambda_2, lambda_omega) = (spectrum.lambda_2, spectrum.omega.lambda.value);
            let both = |error: f64, lambda: f64| {
                [settling_time(error, lambda, eta), settling_time_as_printed(error, lambda, eta)]
            };
            topologies.push(Certified {
                name: resolved.control.communication.topology_name(k).unwrap_or_default().to_owned(),
                lambda_2,
                lambda_omega,
                T_P: both(error_p, lambda_2),
                T_omega: both(error_omega, lambda_omega),
            });
        }
        Ok(Self { eta, error_p, error_omega, topologies })
    }

    /// For the terminal.
    fn text(&self, scenario: &str) -> String {
        let mut text = format!(
            "{scenario}: eta = {}, from the steady state of the droop\n  \
             norm of K_P P - mean     {:.6e} pu\n  norm of omega - 1        {:.6e} pu\n",
            self.eta, self.error_p, self.error_omega
        );
        for (k, t) in self.topologies.iter().enumerate() {
            let _ = write!(
                text,
                "\nTopology {} ({})\n  lambda_2      {:.9}\n  lambda_omega  {:.9}\n  \
                 {:12}  {:>12}  {:>12}\n  {:12}  {:>10.4} s  {:>10.4} s\n  {:12}  {:>10.4} s  {:>10.4} s\n",
                k + 1,
                t.name,
                t.lambda_2,
                t.lambda_omega,
                "",
                "corrected",
                "as printed",
                "T_P",
                t.T_P[0],
                t.T_P[1],
                "T_omega",
                t.T_omega[0],
                t.T_omega[1],
            );
        }
        text.push_str(
            "\nThe times certify the agent model (5)-(6); on a grid they are estimates, because dP/dt is not u_P.\n",
        );
        text
    }

    /// For the report.
    pub fn table(&self) -> Table {
        let row = |t: &Certified| {
            let times = [t.T_P[0], t.T_P[1], t.T_omega[0], t.T_omega[1]];
            let mut cells =
                vec![t.name.clone(), format_value(t.lambda_2, 5), format_value(t.lambda_omega, 5)];
            cells.extend(times.map(|t| format_value(t, 4)));
            cells
        };
        Table {
            caption: format!(
                "Certified times for eta = {}, from the steady state of the droop (norm of K_P P \u{2212} mean: {} pu, of \
                 \u{3c9} \u{2212} 1: {} pu), corrected and as printed in (27) and (33). They certify the agent model \
                 (5)-(6); on a grid they are estimates.",
                self.eta,
                format_value(self.error_p, 4),
                format_value(self.error_omega, 4)
            ),
            header: [
                "topology",
                "\u{3bb}_2",
                "\u{3bb}_\u{3c9}",
                "T_P (s)",
                "T_P printed (s)",
                "T_\u{3c9} (s)",
                "T_\u{3c9} printed (s)",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows: self.topologies.iter().map(row).collect(),
        }
    }
}

/// Prints lambda_2 and the certified times of every topology.
pub fn bounds(args: &ScenarioArgs) -> Result<(), Failure> {
    let resolved = args.resolve()?;
    print(&Bounds::of(&resolved)?.text(&resolved.scenario.name))
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|v| v * v).sum::<f64>().sqrt()
}

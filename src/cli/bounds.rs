//! `bess bounds`: what the paper's theorem certifies for a scenario.

use super::{Failure, ScenarioArgs, print};
use crate::control::Controller;
use crate::control::certificates::{settling_time, settling_time_as_printed};
use crate::grid::GridModel;
use miette::IntoDiagnostic;
use std::fmt::Write as _;

/// Prints lambda_2 and the certified times of every topology, from the errors at which the droop alone settles.
pub fn bounds(args: &ScenarioArgs) -> Result<(), Failure> {
    let resolved = args.resolve()?;
    let mut grid = GridModel::new(&resolved.grid).into_diagnostic()?;
    grid.initialise().into_diagnostic()?;
    let n = grid.n();
    let p: Vec<f64> = (0..n).map(|i| resolved.control.K_P[i] * grid.P(i)).collect();
    let mean = p.iter().sum::<f64>() / n as f64;
    let error_p = norm(p.iter().map(|p| p - mean));
    let error_omega = norm((0..n).map(|i| grid.omega(i) - 1.0));
    let eta = resolved.control.eta;
    let mut text = format!(
        "{}: eta = {eta}, from the steady state of the droop\n  \
         norm of K_P P - mean     {error_p:.6e} pu\n  norm of omega - 1        {error_omega:.6e} pu\n",
        resolved.scenario.name
    );
    let mut controller = Controller::new(resolved.control.clone()).into_diagnostic()?;
    for k in 0..controller.topologies().count() {
        controller.inputs_mut().topology = k as i32 + 1;
        controller.refresh(&mut |_| {});
        let spectrum = controller.spectrum();
        let (lambda_2, lambda_omega) = (spectrum.lambda_2, spectrum.omega.lambda.value);
        let name = resolved.control.communication.topology_name(k).unwrap_or_default();
        let _ = write!(
            text,
            "\nTopology {} ({name})\n  lambda_2      {lambda_2:.9}\n  lambda_omega  {lambda_omega:.9}\n  \
             {:12}  {:>12}  {:>12}\n  {:12}  {:>10.4} s  {:>10.4} s\n  {:12}  {:>10.4} s  {:>10.4} s\n",
            k + 1,
            "",
            "corrected",
            "as printed",
            "T_P",
            settling_time(error_p, lambda_2, eta),
            settling_time_as_printed(error_p, lambda_2, eta),
            "T_omega",
            settling_time(error_omega, lambda_omega, eta),
            settling_time_as_printed(error_omega, lambda_omega, eta),
        );
    }
    text.push_str(
        "\nThe times certify the agent model (5)-(6); on a grid they are estimates, because dP/dt is not u_P.\n",
    );
    print(&text)
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|v| v * v).sum::<f64>().sqrt()
}

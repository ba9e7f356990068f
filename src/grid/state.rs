//! What a simulation changes: inputs, parameters and the differential states, with the checks that a
//! state from outside must pass. Never computes physics.

use super::config::Config;
use super::error::{GridError, finite, not_negative, positive};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Inputs, held during a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// Frequency setpoints, pu; n.
    pub omega_set: Vec<f64>,
    /// Voltage setpoints, pu; n.
    pub V_set: Vec<f64>,
    /// Active power references, pu; n.
    pub P_set: Vec<f64>,
    /// Reactive power references, pu; n.
    pub Q_set: Vec<f64>,
    /// Total change of the active load per bus, pu at 1 pu voltage; n_bus.
    pub dP_load: Vec<f64>,
    /// Total change of the reactive load per bus, pu at 1 pu voltage, positive inductive; n_bus.
    pub dQ_load: Vec<f64>,
    /// Whether the breaker to the main grid is closed; without a tie it must stay false.
    pub tie_closed: bool,
}

/// Parameters, fixed once the model is initialised.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// Energy at the start, pu*h; n.
    pub E_start: Vec<f64>,
    /// Frequency droop, pu/pu; n; (3).
    pub K_P: Vec<f64>,
    /// Voltage droop, pu/pu; n; (3).
    pub K_Q: Vec<f64>,
    /// Reactance between source and bus, pu; n.
    pub X_c: Vec<f64>,
    /// Cutoff of the power filters, rad/s; (1), (2).
    pub omega_c: f64,
}

/// All that a simulation changes: enough to go on from, in this process or another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Inputs.
    pub inputs: Inputs,
    /// Parameters.
    pub parameters: Parameters,
    /// Whether the initial steady state has been found.
    pub initialised: bool,
    /// Source angles, rad, in [-pi, pi], against a frame at nominal frequency; n.
    pub delta: Vec<f64>,
    /// Measured active powers, pu; n; (1).
    pub P: Vec<f64>,
    /// Measured reactive powers, pu, positive inductive; n; (2).
    pub Q: Vec<f64>,
    /// Energies, pu*h; n; (5).
    pub E: Vec<f64>,
    /// Size that the integrator's next internal step wants, s.
    pub internal_step_s: f64,
}

/// Size of the first internal step, s.
pub(super) const FIRST_STEP_S: f64 = 1e-3;

impl State {
    /// Start state of a validated configuration with `n_bus` buses.
    pub fn start(config: &Config, n_bus: usize) -> Self {
        let n = config.bess.len();
        let of = |value: fn(&super::config::Bess) -> f64| config.bess.iter().map(value).collect::<Vec<_>>();
        Self {
            inputs: Inputs {
                omega_set: of(|b| b.omega_set_start),
                V_set: of(|b| b.V_set_start),
                P_set: vec![0.0; n],
                Q_set: vec![0.0; n],
                dP_load: vec![0.0; n_bus],
                dQ_load: vec![0.0; n_bus],
                tie_closed: config.tie_closed_start,
            },
            parameters: Parameters {
                E_start: of(|b| b.E_start),
                K_P: of(|b| b.K_P),
                K_Q: of(|b| b.K_Q),
                X_c: of(|b| b.X_c),
                omega_c: config.omega_c,
            },
            initialised: false,
            delta: vec![0.0; n],
            P: vec![0.0; n],
            Q: vec![0.0; n],
            E: of(|b| b.E_start),
            internal_step_s: FIRST_STEP_S,
        }
    }

    /// Writes the differential states as the integrator has them, [delta | P | Q | E], to the front of `y`.
    pub(super) fn write_to(&self, y: &mut [f64]) {
        let parts = [&self.delta, &self.P, &self.Q, &self.E];
        for (part, values) in y.chunks_exact_mut(self.delta.len()).zip(parts) {
            part.copy_from_slice(values);
        }
    }

    /// Takes them over from there, the angles wrapped.
    pub(super) fn take_from(&mut self, y: &[f64]) {
        let n = self.delta.len();
        let parts = [&mut self.delta, &mut self.P, &mut self.Q, &mut self.E];
        for (part, values) in y.chunks_exact(n).zip(parts) {
            values.copy_from_slice(part);
        }
        self.delta.iter_mut().for_each(|delta| *delta = wrap(*delta));
    }

    /// Checks a state that may come from outside.
    pub fn validate(&self, n: usize, n_bus: usize, has_tie: bool) -> Result<(), GridError> {
        self.inputs.validate(n, n_bus, has_tie)?;
        self.parameters.validate(n)?;
        for (name, values) in [("delta", &self.delta), ("P", &self.P), ("Q", &self.Q), ("E", &self.E)] {
            all_finite(name, values, n)?;
        }
        positive(|| "internal_step_s".into(), self.internal_step_s)
    }
}

impl Inputs {
    /// Checks lengths and values; allocates only for an error.
    pub fn validate(&self, n: usize, n_bus: usize, has_tie: bool) -> Result<(), GridError> {
        let per_bess = [
            ("omega_set", &self.omega_set),
            ("V_set", &self.V_set),
            ("P_set", &self.P_set),
            ("Q_set", &self.Q_set),
        ];
        for (name, values) in per_bess {
            all_finite(name, values, n)?;
        }
        all_finite("dP_load", &self.dP_load, n_bus)?;
        all_finite("dQ_load", &self.dQ_load, n_bus)?;
        if self.tie_closed && !has_tie {
            return Err(GridError::invalid(
                "tie_closed",
                true,
                "false, because the grid has no tie (`tie`: null)",
            ));
        }
        Ok(())
    }
}

impl Parameters {
    /// Checks lengths and values; allocates only for an error.
    pub fn validate(&self, n: usize) -> Result<(), GridError> {
        all_finite("E_start", &self.E_start, n)?;
        type Check = fn(&mut dyn FnMut() -> String, f64) -> Result<(), GridError>;
        let checks: [(&str, &Vec<f64>, Check); 3] = [
            ("K_P", &self.K_P, |path, value| not_negative(path, value)),
            ("K_Q", &self.K_Q, |path, value| not_negative(path, value)),
            ("X_c", &self.X_c, |path, value| positive(path, value)),
        ];
        for (name, values, check) in checks {
            length(name, values, n)?;
            for (i, &value) in values.iter().enumerate() {
                check(&mut || format!("{name}[{}]", i + 1), value)?;
            }
        }
        positive(|| "omega_c".into(), self.omega_c)
    }
}

/// The same angle in [-pi, pi]: angles turn for hours, and small ones are exact.
pub(super) fn wrap(angle: f64) -> f64 {
    if angle.abs() <= PI { angle } else { angle - TAU * (angle / TAU).round() }
}

fn length(name: &str, values: &[f64], n: usize) -> Result<(), GridError> {
    if values.len() == n {
        Ok(())
    } else {
        Err(GridError::invalid(name, format!("{} values", values.len()), format!("{n} values")))
    }
}

fn all_finite(name: &str, values: &[f64], n: usize) -> Result<(), GridError> {
    length(name, values, n)?;
    // Without a way out of the loop it becomes vector instructions: every step comes here.
    if values.iter().fold(true, |all, value| all & value.is_finite()) {
        return Ok(());
    }
    for (i, &value) in values.iter().enumerate() {
        finite(|| format!("{name}[{}]", i + 1), value)?;
    }
    Ok(())
}

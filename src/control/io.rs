//! The controller from outside: inputs, parameters, outputs, by quantity and agent. The names are those
//! of the FMU (DESIGN section 3). Plain data.

use super::config::{Config, Discretisation, VoltagePolicy};
use super::error::{ConfigError, Problems};
use super::messages::Messages;
use super::validate::{Bound, agents, eta, scalar};
use serde::{Deserialize, Serialize};

/// What the controller is told at every communication point. Values must be finite; the lengths are fixed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// Measured active power P_i, pu.
    pub P: Vec<f64>,
    /// Measured reactive power Q_i, pu, positive when inductive.
    pub Q: Vec<f64>,
    /// Measured voltage V_i, pu.
    pub V: Vec<f64>,
    /// Measured frequency omega_i, pu.
    pub omega: Vec<f64>,
    /// Stored energy E_i, pu*h.
    pub E: Vec<f64>,
    /// Frequency of the virtual leader, pu.
    pub omega_ref: f64,
    /// Voltage of the virtual leader, pu.
    pub V_ref: f64,
    /// Scaled power K_P P of the virtual leader, pu; followed with `dispatch`.
    pub P_ref: f64,
    /// Whether the controller acts; disabled it holds its setpoints.
    pub enable: bool,
    /// Whether the pinned agents follow `P_ref`.
    pub dispatch: bool,
    /// Whether agent i takes part; one that does not is cut from the graph and holds its setpoints.
    pub available: Vec<bool>,
    /// Number of the topology, from 1.
    pub topology: i32,
    /// What arrived from other parts of the fleet, by neighbour outside; empty where there is none.
    pub remote: Messages,
}

impl Inputs {
    /// Inputs before the first measurement: rest at nominal voltage and frequency, batteries 70 % full, and the
    /// controller off until it is told to act.
    pub fn start(config: &Config) -> Self {
        let n = config.agents();
        Self {
            P: vec![0.0; n],
            Q: vec![0.0; n],
            V: vec![1.0; n],
            omega: vec![1.0; n],
            E: config.capacity.iter().map(|C| 0.7 * C).collect(),
            omega_ref: 1.0,
            V_ref: 1.0,
            P_ref: 0.0,
            enable: false,
            dispatch: false,
            available: vec![true; n],
            topology: 1,
            remote: Messages::default(),
        }
    }
}

/// The parameters of the FMU. The gains, `eta`, `delay` and the thetas may change between steps, the
/// others only before [`super::Controller::initialise`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// Exponent, in (0, 1].
    pub eta: f64,
    /// Gain of u_omega, >= 0.
    pub gain_omega: f64,
    /// Gain of u_P, >= 0.
    pub gain_P: f64,
    /// Gain of u_E, >= 0.
    pub gain_E: f64,
    /// Gain of u_V, >= 0.
    pub gain_V: f64,
    /// Gain of u_Q, >= 0.
    pub gain_Q: f64,
    /// tau of the edges without a delay of their own, s, >= 0.
    pub delay: f64,
    /// Least boundary layer, s, >= 0.
    pub theta_min: f64,
    /// Boundary layer of the energy exchange, s, >= 0.
    pub theta_E: f64,
    /// What (13) becomes.
    pub voltage_policy: VoltagePolicy,
    /// How the laws are sampled.
    pub discretisation: Discretisation,
    /// Active droop, pu, > 0.
    pub K_P: Vec<f64>,
    /// Reactive droop, pu, > 0.
    pub K_Q: Vec<f64>,
    /// C_i, pu*h, > 0.
    pub capacity: Vec<f64>,
    /// Largest power for the exchange, pu, >= 0.
    pub P_exchange_max: Vec<f64>,
    /// omega_set at the start, pu, > 0.
    pub omega_set_start: Vec<f64>,
    /// V_set at the start, pu, > 0.
    pub V_set_start: Vec<f64>,
}

impl Parameters {
    /// The parameters that a configuration names.
    pub fn start(config: &Config) -> Self {
        Self {
            eta: config.eta,
            gain_omega: config.gains.omega,
            gain_P: config.gains.P,
            gain_E: config.gains.E,
            gain_V: config.gains.V,
            gain_Q: config.gains.Q,
            delay: config.delay_s,
            theta_min: config.theta_min_s,
            theta_E: config.theta_E_s,
            voltage_policy: config.voltage_policy,
            discretisation: config.discretisation,
            K_P: config.K_P.clone(),
            K_Q: config.K_Q.clone(),
            capacity: config.capacity.clone(),
            P_exchange_max: config.P_exchange_max.clone(),
            omega_set_start: config.omega_set_start.clone(),
            V_set_start: config.V_set_start.clone(),
        }
    }

    /// All problems of these parameters for `n` agents, or `Ok`.
    pub fn validate(&self, n: usize) -> Result<(), ConfigError> {
        let mut problems = Problems::default();
        self.check(n, &mut problems);
        problems.into_result()
    }

    pub(super) fn check(&self, n: usize, problems: &mut Problems) {
        eta(problems, "eta", self.eta);
        for (path, x) in [
            ("gain_omega", self.gain_omega),
            ("gain_P", self.gain_P),
            ("gain_E", self.gain_E),
            ("gain_V", self.gain_V),
            ("gain_Q", self.gain_Q),
            ("delay", self.delay),
            ("theta_min", self.theta_min),
            ("theta_E", self.theta_E),
        ] {
            scalar(problems, path, x, Bound::NotNegative);
        }
        for (path, values) in [
            ("K_P", &self.K_P),
            ("K_Q", &self.K_Q),
            ("capacity", &self.capacity),
            ("omega_set_start", &self.omega_set_start),
            ("V_set_start", &self.V_set_start),
        ] {
            agents(problems, path, values, n, Bound::Positive);
        }
        agents(problems, "P_exchange_max", &self.P_exchange_max, n, Bound::NotNegative);
    }
}

/// What the controller answers. The setpoints change in steps only; the five inputs of the paper and the
/// diagnostics follow the inputs at once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outputs {
    /// Frequency setpoint omega_set_i, pu; the paper's omega_i^0.
    pub omega_set: Vec<f64>,
    /// Voltage setpoint V_set_i, pu; the paper's V_i^0.
    pub V_set: Vec<f64>,
    /// Power that the droop leaves out of the sharing, pu: the energy exchange; sums to 0.
    pub P_set: Vec<f64>,
    /// Reactive power that the droop leaves out of the sharing, pu: 0.
    pub Q_set: Vec<f64>,
    /// (12), pu/s, after limits: the rate of omega_set.
    pub u_omega: Vec<f64>,
    /// (9), pu/s.
    pub u_P: Vec<f64>,
    /// (11), rate of SoC, 1/s.
    pub u_E: Vec<f64>,
    /// (13), pu/s, after limits: the rate of V_set.
    pub u_V: Vec<f64>,
    /// (10), pu/s.
    pub u_Q: Vec<f64>,
    /// Largest less smallest K_P (P - P_set) of the available agents, pu.
    pub spread_P: f64,
    /// Largest less smallest K_Q (Q - Q_set) of the available agents, pu.
    pub spread_Q: f64,
    /// Largest less smallest SoC of the available agents.
    pub spread_E: f64,
    /// Largest abs(omega - omega_ref) of the available agents, pu.
    pub error_omega: f64,
    /// Largest abs(V - V_ref) of the available agents, pu.
    pub error_V: f64,
    /// Algebraic connectivity of the weights (g_P w)^(2/(1+eta)) over the live agents; 0 in parts.
    pub lambda_2: f64,
    /// Certified time to go until the powers agree, s; infinite where nothing is certified.
    pub T_P: f64,
    /// Certified time to go until the frequency is at its reference, s; infinite alike.
    pub T_omega: f64,
    /// Cluster of each agent, from 1.
    pub cluster: Vec<i32>,
    /// Whether a limit holds agent i back.
    pub saturated: Vec<bool>,
    /// What is told to other parts of the fleet, by agent with neighbours there.
    pub local: Messages,
}

impl Outputs {
    /// Zeros for `n` agents.
    pub(super) fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Self {
            omega_set: zeros(),
            V_set: zeros(),
            P_set: zeros(),
            Q_set: zeros(),
            u_omega: zeros(),
            u_P: zeros(),
            u_E: zeros(),
            u_V: zeros(),
            u_Q: zeros(),
            spread_P: 0.0,
            spread_Q: 0.0,
            spread_E: 0.0,
            error_omega: 0.0,
            error_V: 0.0,
            lambda_2: 0.0,
            T_P: 0.0,
            T_omega: 0.0,
            cluster: vec![0; n],
            saturated: vec![false; n],
            local: Messages::default(),
        }
    }
}

//! The scenario as the user writes it: one JSON document. Names are the paper's in ASCII; numbers are per
//! unit on the system base unless the name ends in a unit. Agents, buses and topologies count from 1.
//! Only shapes and defaults stand here; what values mean is checked in `resolve`.

use super::connection::Connection;
use super::fault::{Fault, Trial};
use super::units::Bases;
use crate::control::communication::{ExplicitTopology, Inside, StepByStepTopology, Weights};
use crate::control::config::{
    Channel, Discretisation, EXCHANGE_FADE_S, Gains, Law, MeasurementFilter, SocLimits, VoltagePolicy,
};
use crate::grid::{LoadModel, NetworkMethod, Tolerances};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A whole co-simulation: batteries, their controller, the grid, and what happens when.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Where editors find the schema; not read.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Built-in name or JSON file (found beside this one) of the scenario that this one changes: objects are
    /// merged key by key, arrays replaced whole, null takes a key away (JSON merge patch, RFC 7396).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extends: Option<String>,
    /// Short name, used for folders and titles.
    pub name: String,
    /// What the scenario shows, in a sentence or two.
    #[serde(default)]
    pub description: String,
    /// End of the simulation, s.
    pub stop_s: f64,
    /// Communication step of the master, s.
    #[serde(default = "default_step_s")]
    pub step_s: f64,
    /// How the master exchanges values.
    #[serde(default)]
    pub master: Master,
    /// Write every k-th communication step to `trajectory.csv`.
    #[serde(default = "default_record_every")]
    pub record_every: u32,
    /// The batteries, in the order of the agents.
    pub bess: Vec<Bess>,
    /// The secondary controller.
    #[serde(default)]
    pub control: Control,
    /// Who talks to whom.
    #[serde(default)]
    pub communication: Communication,
    /// The network.
    #[serde(default)]
    pub grid: Grid,
    /// Values set before the start: `"controller.enable": true`, and for every battery with a placeholder of
    /// `connections`: `"controller.E[{i}]": 0.35`.
    #[serde(default)]
    pub initial: Map<String, Value>,
    /// What happens when.
    #[serde(default)]
    pub events: Vec<Event>,
    /// What goes wrong, from when until when.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<Fault>,
    /// Connections in addition to those between equal names; a line here takes the place of the
    /// equal-name connection into the same input.
    #[serde(default)]
    pub connections: Vec<Connection>,
    /// What 1 pu is, where a connection names units.
    #[serde(default)]
    pub bases: Bases,
    /// Variants of this scenario that are run beside it and shown in the report.
    #[serde(default)]
    pub compare: Vec<Variant>,
    /// The same with faults, each a row in the report's table of faults.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trials: Vec<Trial>,
}

fn default_step_s() -> f64 {
    0.01
}

fn default_record_every() -> u32 {
    1
}

/// How values travel within a communication step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Master {
    /// All step with the values of the same communication point.
    #[default]
    Jacobi,
    /// The controller steps first, the grid with the setpoints that it has just made.
    GaussSeidel,
}

/// One battery with its inverter.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bess {
    /// Name in pictures; `BESS i` when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Bus number in the case; the battery takes the place of the generator there.
    pub bus: u64,
    /// Active power droop, pu/pu, > 0.
    #[serde(rename = "K_P")]
    pub k_p: f64,
    /// Reactive power droop, pu/pu, > 0.
    #[serde(rename = "K_Q")]
    pub k_q: f64,
    /// Coupling reactance, pu.
    #[serde(rename = "X_c", default = "default_x_c")]
    pub x_c: f64,
    /// Energy capacity C, pu*h; 0.002 / K_P when left out, so that sharing drains every SoC alike.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capacity: Option<f64>,
    /// State of charge at the start, 0 to 1.
    #[serde(default = "default_soc_start")]
    pub soc_start: f64,
    /// Most power that the energy exchange may ask of this battery, pu.
    #[serde(rename = "P_exchange_max", default = "default_p_exchange_max")]
    pub p_exchange_max: f64,
    /// Frequency setpoint at the start, pu.
    #[serde(default = "one")]
    pub omega_set_start: f64,
    /// Voltage setpoint at the start, pu.
    #[serde(rename = "V_set_start", default = "default_v_set_start")]
    pub v_set_start: f64,
    /// Largest abs(P), pu; none, or all batteries have one. So with the next five.
    #[serde(rename = "P_max", default, skip_serializing_if = "Option::is_none")]
    pub p_max: Option<f64>,
    /// Largest abs(Q), pu.
    #[serde(rename = "Q_max", default, skip_serializing_if = "Option::is_none")]
    pub q_max: Option<f64>,
    /// Radius of the apparent-power circle, pu.
    #[serde(rename = "S_max", default, skip_serializing_if = "Option::is_none")]
    pub s_max: Option<f64>,
    /// Largest rate of the frequency setpoint, pu/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub omega_set_rate: Option<f64>,
    /// Largest rate of the voltage setpoint, pu/s.
    #[serde(rename = "V_set_rate", default, skip_serializing_if = "Option::is_none")]
    pub v_set_rate: Option<f64>,
    /// Largest rate of the active power reference, pu/s.
    #[serde(rename = "P_set_rate", default, skip_serializing_if = "Option::is_none")]
    pub p_set_rate: Option<f64>,
    /// Position for Euclidean distances and for the drawing of the graph, any unit. Those of the built-in
    /// scenarios are a plane picture of the electrical distances (classical multidimensional scaling).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 2]>,
}

fn default_x_c() -> f64 {
    0.1
}
fn default_soc_start() -> f64 {
    0.7
}
fn default_p_exchange_max() -> f64 {
    1.0
}
fn default_v_set_start() -> f64 {
    1.02
}
fn one() -> f64 {
    1.0
}

impl Bess {
    /// Capacity C, pu*h: as given, else in proportion to the share of the load (DESIGN, section 1).
    pub fn capacity(&self) -> f64 {
        self.capacity.unwrap_or(0.002 / self.k_p)
    }
}

/// The consensus controller; what is left out has the paper's value.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Control {
    /// FMU of another controller in the place of the built-in one, relative to the scenario file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fmu: Option<String>,
    /// Exponent of the sign power, in (0, 1]; 1 is the asymptotic law.
    pub eta: f64,
    /// Gains of the five inputs.
    pub gains: Gains,
    /// Communication delay tau of every edge without one of its own, s.
    pub delay_s: f64,
    /// Least width of the boundary layer, s: theta = max(step, theta_min).
    pub theta_min_s: f64,
    /// Boundary layer of the energy exchange, s; covers the inverter's own lag.
    #[serde(rename = "theta_E_s")]
    pub theta_e_s: f64,
    /// `paper`: (13) as printed. `average`: equal K_Q Q and the average voltage at V_ref.
    pub voltage_policy: VoltagePolicy,
    /// `capped`: no chatter. `explicit`: explicit Euler of the bare law, to compare.
    pub discretisation: Discretisation,
    /// The paper's finite-time law, or the fixed-time law.
    pub law: Law,
    /// Window of the state of charge; needs P_max or S_max of the batteries.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub soc_limits: Option<SocLimits>,
    /// Least and largest frequency setpoint, pu.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub omega_set_range: Option<[f64; 2]>,
    /// Least and largest voltage setpoint, pu.
    #[serde(rename = "V_set_range", skip_serializing_if = "Option::is_none")]
    pub v_set_range: Option<[f64; 2]>,
    /// First-order filters on the measurements.
    pub measurement_filter: MeasurementFilter,
    /// Never let the energy exchange turn a discharging battery into a charging one.
    pub no_circulation: bool,
    /// Time in which the last exchange over a lost link fades, s; without it, it is held.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_link_fade_s: Option<f64>,
    /// Time in which the energy exchange fades in after enabling, and when links come and go, s.
    pub exchange_fade_s: f64,
    /// Jitter and loss of messages, seeded.
    pub channel: Channel,
    /// Time without a message that makes sense after which a neighbour is left out until it is heard again, s; longer
    /// than delay and jitter. Without it the last message counts for ever.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub silence_s: Option<f64>,
    /// f: each agent leaves out the f largest and f smallest values that its neighbours tell, where it has more than
    /// 2 f neighbours. Against wrong messages; not for the energy exchange.
    pub outlier_filter: u32,
}

impl Default for Control {
    fn default() -> Self {
        Self {
            fmu: None,
            eta: 0.5,
            gains: Gains::default(),
            delay_s: 0.0,
            theta_min_s: 0.0,
            theta_e_s: 1.0,
            voltage_policy: VoltagePolicy::default(),
            discretisation: Discretisation::default(),
            law: Law::default(),
            soc_limits: None,
            omega_set_range: None,
            v_set_range: None,
            measurement_filter: MeasurementFilter::default(),
            no_circulation: false,
            lost_link_fade_s: None,
            exchange_fade_s: EXCHANGE_FADE_S,
            channel: Channel::default(),
            silence_s: None,
            outlier_filter: 0,
        }
    }
}

/// Who talks to whom: step-by-step topologies made from distances, or graphs written out.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Communication {
    /// Where distances come from.
    pub distance: Distance,
    /// How a distance becomes a weight.
    pub weights: Weights,
    /// Step-by-step topologies, chosen by the input `topology` (from 1).
    pub topologies: Vec<StepByStepTopology>,
    /// Graphs written out; they take the place of `topologies`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub graphs: Option<Vec<ExplicitTopology>>,
}

impl Default for Communication {
    fn default() -> Self {
        let topology = |name: &str, inside| StepByStepTopology { name: name.into(), inside };
        Self {
            distance: Distance::default(),
            weights: Weights::default(),
            topologies: vec![topology("a3", Inside::Tree), topology("b3", Inside::Ring)],
            graphs: None,
        }
    }
}

/// Where distances between the batteries come from.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Distance {
    /// abs(Z_ii + Z_jj - 2 Z_ij) of the network with its loads.
    #[default]
    Electrical,
    /// From the positions of the batteries.
    Euclidean,
    /// A symmetric matrix, n x n.
    Given(Vec<Vec<f64>>),
}

/// The network and its loads.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Grid {
    /// FMU of another grid model in the place of the built-in one, relative to the scenario file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fmu: Option<String>,
    /// `case57`, or a MATPOWER case as `.json` or `.m`, relative to the scenario file; `none` where an FMU is the
    /// grid and nothing else is to be known of the network.
    pub case: String,
    /// Cutoff frequency of the power measurement, rad/s.
    pub omega_c: f64,
    /// Nominal frequency, Hz.
    pub f_nominal_hz: f64,
    /// The breaker to the main grid, or null.
    pub tie: Option<Tie>,
    /// How the case's loads follow the voltage.
    pub load_model: LoadModel,
    /// How the network equations are solved.
    pub network: NetworkMethod,
    /// Error control of the integration.
    pub tolerances: Tolerances,
}

impl Default for Grid {
    fn default() -> Self {
        Self {
            fmu: None,
            case: "case57".into(),
            omega_c: 31.415_926_535_897_9,
            f_nominal_hz: 60.0,
            tie: Some(Tie::default()),
            load_model: LoadModel::default(),
            network: NetworkMethod::default(),
            tolerances: Tolerances::default(),
        }
    }
}

/// The main grid: 1 pu at angle 0 and frequency 1 behind a reactance.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Tie {
    /// Bus number where it connects.
    pub bus: u64,
    /// Reactance, pu.
    #[serde(rename = "X")]
    pub x: f64,
}

impl Default for Tie {
    fn default() -> Self {
        Self { bus: 1, x: 0.05 }
    }
}

/// What happens at one time.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// When, s; need not be a multiple of the step.
    pub at_s: f64,
    /// Words for the table and the figures.
    #[serde(default)]
    pub label: String,
    /// Variables and their new values: `"grid.dP_load[12]": -0.5`.
    pub set: Map<String, Value>,
}

/// The same scenario with some keys changed.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Words for the report.
    pub label: String,
    /// Keys of the scenario and their values here: `"control.discretisation": "explicit"`.
    pub set: Map<String, Value>,
}

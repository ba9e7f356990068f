//! What a controller is made from: the resolved configuration that the FMU reads from
//! `resources/controller.json`. Plain data; the checks are in `validate`, defaults of a scenario
//! (Table I, electrical distances) belong to whoever writes the file.

use super::communication::Communication;
use super::part::Part;
use super::told::MessageFault;
use serde::{Deserialize, Serialize};

/// Everything fixed about a controller of n agents; n is the length of `K_P`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Active droop, n values, pu of frequency per pu of power, > 0; equation (3).
    pub K_P: Vec<f64>,
    /// Reactive droop, n values, pu of voltage per pu of power, > 0; equation (3).
    pub K_Q: Vec<f64>,
    /// Energy capacity C_i, n values, pu*h, > 0.
    pub capacity: Vec<f64>,
    /// Largest power that an agent gives to the energy exchange, n values, pu, >= 0; DESIGN (11).
    pub P_exchange_max: Vec<f64>,
    /// omega_set at the start, n values, pu, > 0.
    pub omega_set_start: Vec<f64>,
    /// V_set at the start, n values, pu, > 0.
    pub V_set_start: Vec<f64>,
    /// Exponent of the sign power s(d), in (0, 1]; 1 is the asymptotic law.
    #[serde(default = "default_eta")]
    pub eta: f64,
    /// Gains of the five inputs.
    #[serde(default)]
    pub gains: Gains,
    /// Communication delay tau of every edge without a delay of its own, s, >= 0; equation (34).
    #[serde(default)]
    pub delay_s: f64,
    /// Least width of the boundary layer, s, >= 0: theta = max(h, theta_min); DESIGN 1.1.
    #[serde(default)]
    pub theta_min_s: f64,
    /// Boundary layer of the energy exchange, s, >= 0; covers the inverter's own lag.
    #[serde(default = "default_theta_E")]
    pub theta_E_s: f64,
    /// What (13) becomes on a real network.
    #[serde(default)]
    pub voltage_policy: VoltagePolicy,
    /// How the laws are sampled.
    #[serde(default)]
    pub discretisation: Discretisation,
    /// The sign power, or its fixed-time extension.
    #[serde(default)]
    pub law: Law,
    /// Who talks to whom.
    pub communication: Communication,
    /// Limits of each BESS; without them nothing but `P_exchange_max` limits.
    #[serde(default)]
    pub limits: Limits,
    /// First-order filters on the measurements.
    #[serde(default)]
    pub measurement_filter: MeasurementFilter,
    /// Never let the exchange turn a discharging BESS into a charging one, or the other way round.
    #[serde(default)]
    pub no_circulation: bool,
    /// Time in which both ends of a lost link let its last energy exchange fade, s, > 0; without it
    /// the exchange is held until the link is back.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost_link_fade_s: Option<f64>,
    /// Time in which the exchange fades from what P_set is to what the law asks for, s, >= 0: after enabling,
    /// and when links come and go.
    #[serde(default = "default_exchange_fade")]
    pub exchange_fade_s: f64,
    /// Jitter and loss of messages.
    #[serde(default)]
    pub channel: Channel,
    /// Time without a message that makes sense after which an agent leaves a neighbour out of its sums until one
    /// arrives, s, > 0; without it the last message counts for ever.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub silence_s: Option<f64>,
    /// f: each agent leaves out the f largest and f smallest values of its neighbours where it has more than 2f;
    /// see `outlier`.
    #[serde(default)]
    pub outlier_filter: u32,
    /// Faults of what agents tell their neighbours, for trials.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub message_faults: Vec<MessageFault>,
    /// Where these are only some of the agents of a fleet: who the others are that they hear; see `part`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<Part>,
}

impl Config {
    /// All values that stand by agent, each as long as there are agents: what has to move when agents do.
    pub(super) fn by_agent(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        // Whole, so that no field that comes is forgotten here.
        let Self {
            K_P,
            K_Q,
            capacity,
            P_exchange_max,
            omega_set_start,
            V_set_start,
            eta: _,
            gains: _,
            delay_s: _,
            theta_min_s: _,
            theta_E_s: _,
            voltage_policy: _,
            discretisation: _,
            law: _,
            communication: _,
            limits,
            measurement_filter: _,
            no_circulation: _,
            lost_link_fade_s: _,
            exchange_fade_s: _,
            channel: _,
            silence_s: _,
            outlier_filter: _,
            message_faults: _,
            part: _,
        } = self;
        let Limits {
            P_max,
            Q_max,
            S_max,
            omega_set_rate,
            V_set_rate,
            P_set_rate,
            omega_set_range: _,
            V_set_range: _,
            SoC: _,
        } = limits;
        let given = [P_max, Q_max, S_max, omega_set_rate, V_set_rate, P_set_rate].into_iter().flatten();
        [K_P, K_Q, capacity, P_exchange_max, omega_set_start, V_set_start].into_iter().chain(given)
    }
}

fn default_eta() -> f64 {
    0.5
}

fn default_theta_E() -> f64 {
    1.0
}

/// The fade of the exchange where none is given, s: a P_exchange_max of 1 pu then moves omega by K_P / 2 a second.
pub const EXCHANGE_FADE_S: f64 = 2.0;

fn default_exchange_fade() -> f64 {
    EXCHANGE_FADE_S
}

/// Gains of the five inputs, each >= 0; they multiply the weights w_ij and a_0i.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Gains {
    /// Gain of u_omega (without its u_P part); (12).
    pub omega: f64,
    /// Gain of u_P; (9).
    pub P: f64,
    /// Gain of u_E; (11).
    pub E: f64,
    /// Gain of u_V (without its u_Q part); (13).
    pub V: f64,
    /// Gain of u_Q; (10).
    pub Q: f64,
}

impl Default for Gains {
    fn default() -> Self {
        Self { omega: 1.0, P: 1.0, E: 0.005, V: 1.0, Q: 1.0 }
    }
}

/// What the voltage input does, DESIGN row "(13) on a real network".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum VoltagePolicy {
    /// (13) as printed: a compromise between V = V_ref and equal K_Q Q.
    #[default]
    Paper,
    /// Equal K_Q Q, and the average voltage at V_ref.
    Average,
}

impl VoltagePolicy {
    /// The number of the FMI parameter `voltage_policy`.
    pub fn number(self) -> i32 {
        match self {
            Self::Paper => 0,
            Self::Average => 1,
        }
    }

    /// The policy of that number.
    pub fn from_number(number: i32) -> Option<Self> {
        [Self::Paper, Self::Average].into_iter().find(|p| p.number() == number)
    }
}

/// How the flows are sampled, DESIGN 1.1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Discretisation {
    /// Each flow capped at what would carry its two ends together.
    #[default]
    Capped,
    /// Explicit Euler of the bare law; chatters, for comparison.
    Explicit,
}

impl Discretisation {
    /// The number of the FMI parameter `discretisation`.
    pub fn number(self) -> i32 {
        match self {
            Self::Capped => 0,
            Self::Explicit => 1,
        }
    }

    /// The discretisation of that number.
    pub fn from_number(number: i32) -> Option<Self> {
        [Self::Capped, Self::Explicit].into_iter().find(|d| d.number() == number)
    }
}

/// The scalar law behind every flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Law {
    /// The paper's s(d) = sgn(d) abs(d)^eta.
    #[default]
    FiniteTime,
    /// s(d) = sgn(d) (alpha abs(d)^eta + beta abs(d)^(2 - eta)): a settling time that no start exceeds.
    FixedTime {
        /// Factor of the power below one, > 0.
        alpha: f64,
        /// Factor of the power above one, > 0.
        beta: f64,
    },
}

/// Optional limits, each n values. P and Q are per unit, rates per unit per second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Largest abs(P_i), pu, > 0.
    pub P_max: Option<Vec<f64>>,
    /// Largest abs(Q_i), pu, > 0.
    pub Q_max: Option<Vec<f64>>,
    /// Radius of the apparent-power circle, pu, > 0; active power has priority.
    pub S_max: Option<Vec<f64>>,
    /// Largest rate of omega_set_i, pu/s, > 0.
    pub omega_set_rate: Option<Vec<f64>>,
    /// Largest rate of V_set_i, pu/s, > 0.
    pub V_set_rate: Option<Vec<f64>>,
    /// Largest rate of P_set_i, pu/s, > 0; shared among the edges of i so that sum P_set stays 0.
    pub P_set_rate: Option<Vec<f64>>,
    /// Least and largest omega_set of all agents, pu.
    pub omega_set_range: Option<[f64; 2]>,
    /// Least and largest V_set of all agents, pu.
    pub V_set_range: Option<[f64; 2]>,
    /// State of charge at which discharging ends, and at which charging ends; needs P_max or S_max.
    pub SoC: Option<SocLimits>,
}

/// Window of the state of charge, equal for all agents.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SocLimits {
    /// No discharging at or below, in [0, 1).
    pub min: f64,
    /// No charging at or above, in (min, 1].
    pub max: f64,
    /// Width of the band inside each bound in which the power limit falls to zero, > 0.
    #[serde(default = "default_taper")]
    pub taper: f64,
}

fn default_taper() -> f64 {
    0.05
}

/// Time constants of first-order filters on the measurements, s, >= 0; 0 is no filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct MeasurementFilter {
    /// On omega.
    pub omega_s: f64,
    /// On P - P_set.
    pub P_s: f64,
    /// On E.
    pub E_s: f64,
    /// On V.
    pub V_s: f64,
    /// On Q - Q_set.
    pub Q_s: f64,
}

/// Imperfections of the communication, drawn from a counter-based generator: the same seed gives
/// the same run, whatever is rolled back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Channel {
    /// Largest extra delay of a message, uniform in [0, jitter_s], s, >= 0.
    pub jitter_s: f64,
    /// Probability that a message is lost, in [0, 1); the receiver keeps the last one.
    pub loss: f64,
    /// Seed of the generator.
    pub seed: u64,
}

impl Channel {
    /// Whether receivers keep the times of messages: because they may be late or lost, or because `silence_s`
    /// asks for them.
    pub fn keeps_times(&self, silence_ns: Option<i64>) -> bool {
        self.is_lossy() || silence_ns.is_some()
    }
}

impl Config {
    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.K_P.len()
    }

    /// The paper's agent model for n agents: unit droop, capacity and exchange limit, starts of 1, no fade (its
    /// (11) has none), everything else at its default.
    pub fn unit(n: usize, communication: Communication) -> Self {
        let ones = vec![1.0; n];
        Self {
            K_P: ones.clone(),
            K_Q: ones.clone(),
            capacity: ones.clone(),
            P_exchange_max: ones.clone(),
            omega_set_start: ones.clone(),
            V_set_start: ones,
            eta: default_eta(),
            gains: Gains::default(),
            delay_s: 0.0,
            theta_min_s: 0.0,
            theta_E_s: default_theta_E(),
            voltage_policy: VoltagePolicy::default(),
            discretisation: Discretisation::default(),
            law: Law::default(),
            communication,
            limits: Limits::default(),
            measurement_filter: MeasurementFilter::default(),
            no_circulation: false,
            lost_link_fade_s: None,
            exchange_fade_s: 0.0,
            channel: Channel::default(),
            silence_s: None,
            outlier_filter: 0,
            message_faults: Vec::new(),
            part: None,
        }
    }
}

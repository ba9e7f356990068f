//! Everything that the grid model is made from: what the grid FMU reads from `resources/grid.json`.
//! Never reads files.

use super::case::{Case, ISOLATED};
use super::error::{GridError, finite, not_negative, positive};
use super::load::LoadModel;
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// Configuration of the grid model. Only `case` and `bess` are required.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The network: the name of a built-in case, or the case itself.
    pub case: CaseSource,
    /// The batteries, in the order of the agents.
    pub bess: Vec<Bess>,
    /// Cutoff of the power measurement filters, rad/s; (1), (2).
    #[serde(default = "default_omega_c")]
    pub omega_c: f64,
    /// Nominal frequency, Hz; omega_b = 2 pi times this.
    #[serde(default = "default_f_nominal_hz")]
    pub f_nominal_hz: f64,
    /// Where the main grid can be tied in, or null.
    #[serde(default)]
    pub tie: Option<Tie>,
    /// Start value of the input `tie_closed`.
    #[serde(default)]
    pub tie_closed_start: bool,
    /// How the case's loads follow the voltage.
    #[serde(default)]
    pub load_model: LoadModel,
    /// How the network equations are solved.
    #[serde(default)]
    pub network: NetworkMethod,
    /// Error control of the integration.
    #[serde(default)]
    pub tolerances: Tolerances,
}

/// Where the network comes from.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum CaseSource {
    /// Name of a built-in case, see [`Case::BUILT_IN`].
    BuiltIn(String),
    /// The case itself.
    Inline(Box<Case>),
}

/// One battery behind its droop-controlled inverter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bess {
    /// Id of its bus (the case's bus number, not the position).
    pub bus: u64,
    /// Frequency droop, pu/pu; (3).
    pub K_P: f64,
    /// Voltage droop, pu/pu; (3).
    pub K_Q: f64,
    /// Reactance between the inverter's voltage source and the bus, pu.
    #[serde(default = "default_X_c")]
    pub X_c: f64,
    /// Energy at the start, pu*h.
    pub E_start: f64,
    /// Start value of the input `omega_set`, pu.
    #[serde(default = "one")]
    pub omega_set_start: f64,
    /// Start value of the input `V_set`, pu.
    #[serde(default = "one")]
    pub V_set_start: f64,
}

/// The tie to the main grid: 1 pu at angle 0 and frequency 1 behind X, through a breaker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tie {
    /// Id of its bus (the case's bus number).
    pub bus: u64,
    /// Reactance, pu.
    #[serde(default = "default_X_tie")]
    pub X: f64,
}

/// How the network equations are solved; both ways agree to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum NetworkMethod {
    /// By size.
    #[default]
    Auto,
    /// Dense matrix between the sources (Kron reduction).
    Kron,
    /// Sparse solve of all buses.
    Sparse,
}

/// Error control of the integration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Tolerances {
    /// Relative.
    pub relative: f64,
    /// Absolute, pu, rad, pu*h.
    pub absolute: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self { relative: 1e-9, absolute: 1e-11 }
    }
}

fn default_omega_c() -> f64 {
    31.4159265358979
}

fn default_f_nominal_hz() -> f64 {
    60.0
}

fn default_X_c() -> f64 {
    0.1
}

fn default_X_tie() -> f64 {
    0.05
}

fn one() -> f64 {
    1.0
}

// By hand, because serde's untagged enums swallow the message that names the wrong key.
impl<'de> Deserialize<'de> for CaseSource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrCase;
        impl<'de> Visitor<'de> for NameOrCase {
            type Value = CaseSource;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the name of a built-in case or a case object")
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<CaseSource, E> {
                Ok(CaseSource::BuiltIn(name.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CaseSource, A::Error> {
                Case::deserialize(MapAccessDeserializer::new(map))
                    .map(|case| CaseSource::Inline(Box::new(case)))
            }
        }
        deserializer.deserialize_any(NameOrCase)
    }
}

impl CaseSource {
    /// The case itself.
    pub fn resolve(&self) -> Result<Case, GridError> {
        match self {
            Self::BuiltIn(name) => Case::built_in(name),
            Self::Inline(case) => Ok((**case).clone()),
        }
    }
}

impl Config {
    /// The modified IEEE 57-bus system of the paper: BESS at the generator buses, Table I (as read in
    /// DESIGN section 1), the tie at bus 1 with its breaker open.
    pub fn case57() -> Self {
        let bus = [1, 2, 3, 6, 8, 9, 12];
        let K_P = [1.0, 1.2, 1.25, 0.9, 0.95, 1.02, 1.1];
        let K_Q = [1.0, 1.21, 1.3, 1.23, 0.95, 1.06, 1.13];
        let soc = [0.704, 0.703, 0.702, 0.7, 0.699, 0.698, 0.696];
        let omega_offset = [1.5e-3, -1e-3, 0.5e-3, -1.5e-3, 1e-3, -0.5e-3, 0.0];
        let bess = (0..bus.len())
            .map(|i| Bess {
                bus: bus[i],
                K_P: 0.004 * K_P[i],
                K_Q: 0.02 * K_Q[i],
                X_c: default_X_c(),
                E_start: soc[i] * 0.5 / K_P[i],
                omega_set_start: 1.0 + omega_offset[i],
                V_set_start: 1.02,
            })
            .collect();
        Self {
            case: CaseSource::BuiltIn("case57".into()),
            bess,
            omega_c: default_omega_c(),
            f_nominal_hz: default_f_nominal_hz(),
            tie: Some(Tie { bus: 1, X: default_X_tie() }),
            tie_closed_start: false,
            load_model: LoadModel::Impedance,
            network: NetworkMethod::Auto,
            tolerances: Tolerances::default(),
        }
    }

    /// A configuration from its JSON text, validated.
    pub fn from_json(text: &str) -> Result<Self, GridError> {
        let config: Config = serde_json::from_str(text)
            .map_err(|e| GridError::Syntax { line: e.line(), message: e.to_string() })?;
        config.validate()?;
        Ok(config)
    }

    /// Checks every value, and the case; errors name the path of the key.
    pub fn validate(&self) -> Result<(), GridError> {
        let case = self.case.resolve()?;
        case.validate("case.")?;
        if self.bess.is_empty() {
            return Err(GridError::invalid("bess", "no entry", "at least one BESS"));
        }
        for (i, bess) in self.bess.iter().enumerate() {
            let path = |key: &str| format!("bess[{i}].{key}");
            live_bus(path("bus"), bess.bus, &case)?;
            not_negative(|| path("K_P"), bess.K_P)?;
            not_negative(|| path("K_Q"), bess.K_Q)?;
            positive(|| path("X_c"), bess.X_c)?;
            finite(|| path("E_start"), bess.E_start)?;
            positive(|| path("omega_set_start"), bess.omega_set_start)?;
            positive(|| path("V_set_start"), bess.V_set_start)?;
        }
        positive(|| "omega_c".into(), self.omega_c)?;
        positive(|| "f_nominal_hz".into(), self.f_nominal_hz)?;
        if let Some(tie) = &self.tie {
            live_bus("tie.bus".into(), tie.bus, &case)?;
            positive(|| "tie.X".into(), tie.X)?;
        } else if self.tie_closed_start {
            return Err(GridError::invalid("tie_closed_start", true, "false, because `tie` is null"));
        }
        self.load_model.validate("load_model")?;
        for (key, value) in [("relative", self.tolerances.relative), ("absolute", self.tolerances.absolute)] {
            if !(1e-13..=1e-2).contains(&value) {
                return Err(GridError::invalid(
                    format!("tolerances.{key}"),
                    value,
                    "a number between 1e-13 and 1e-2",
                ));
            }
        }
        Ok(())
    }
}

fn live_bus(path: String, id: u64, case: &Case) -> Result<(), GridError> {
    match case.bus.iter().find(|bus| bus.id == id) {
        None => Err(GridError::invalid(path, id, "the id of a bus in the case's bus table")),
        Some(bus) if bus.kind == ISOLATED => {
            Err(GridError::invalid(path, format!("isolated bus {id}"), "a bus in service (type 1, 2 or 3)"))
        }
        Some(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_file_is_enough() {
        let config = Config::from_json(
            r#"{"case": "case57", "bess": [{"bus": 1, "K_P": 0.004, "K_Q": 0.02, "E_start": 0.5}]}"#,
        )
        .unwrap();
        assert_eq!(config.bess[0].X_c, 0.1);
        assert_eq!(config.f_nominal_hz, 60.0);
        assert_eq!(config.tie, None);
        let text = serde_json::to_string(&Config::case57()).unwrap();
        assert_eq!(Config::from_json(&text).unwrap(), Config::case57());
    }

    #[test]
    fn errors_name_the_path() {
        let broken = |change: fn(&mut Config)| {
            let mut config = Config::case57();
            change(&mut config);
            config.validate().unwrap_err().to_string()
        };
        assert!(broken(|c| c.bess[2].bus = 70).starts_with("bess[2].bus: found 70"));
        assert!(broken(|c| c.bess[1].X_c = 0.0).starts_with("bess[1].X_c: found 0"));
        assert!(broken(|c| c.tie = Some(Tie { bus: 58, X: 0.05 })).starts_with("tie.bus: found 58"));
        assert!(broken(|c| c.case = CaseSource::BuiltIn("case9".into())).contains("case57"));
        assert!(broken(|c| c.load_model = LoadModel::Zip { Z: 0.5, I: 0.5, P: 0.5 }).contains("1.5"));
        let typo = Config::from_json(r#"{"case": "case57", "bes": []}"#).unwrap_err();
        assert!(typo.to_string().contains("`bes`"), "{typo}");
        let inside =
            Config::from_json(r#"{"case": {"base_mva": 100, "buses": []}, "bess": []}"#).unwrap_err();
        assert!(inside.to_string().contains("`buses`"), "{inside}");
    }
}

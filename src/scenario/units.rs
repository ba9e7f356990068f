//! Units that other models speak, and what they are per unit: MW, kV, Hz, MWh, a state of charge. Pure;
//! knows names and factors, no variable.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What one unit is the unit of. Only equal dimensions convert, but per unit and percent fit all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Per unit, whatever the quantity.
    PerUnit,
    /// Active, reactive, apparent power; base in MVA.
    Power,
    /// Voltage, line to line; base in kV.
    Voltage,
    /// Frequency; base in Hz.
    Frequency,
    /// Energy; base MVA times one hour.
    Energy,
    /// State of charge; its base is the capacity of the battery.
    Charge,
    /// Angle; rad are its per unit.
    Angle,
}

/// A unit that a scenario may name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// As written.
    pub name: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// In MVA, kV, Hz, MWh, rad, or per unit.
    scale: f64,
}

const RADIANS_PER_TURN: f64 = 2.0 * std::f64::consts::PI;

use Dimension::{Angle, Charge, Energy, Frequency, PerUnit, Power, Voltage};

const UNITS: [(&str, Dimension, f64); 37] = [
    ("pu", PerUnit, 1.0),
    ("p.u.", PerUnit, 1.0),
    ("pu.h", PerUnit, 1.0),
    ("%", PerUnit, 0.01),
    ("W", Power, 1e-6),
    ("kW", Power, 1e-3),
    ("MW", Power, 1.0),
    ("GW", Power, 1e3),
    ("VA", Power, 1e-6),
    ("kVA", Power, 1e-3),
    ("MVA", Power, 1.0),
    ("GVA", Power, 1e3),
    ("var", Power, 1e-6),
    ("kvar", Power, 1e-3),
    ("Mvar", Power, 1.0),
    ("Gvar", Power, 1e3),
    ("VAr", Power, 1e-6),
    ("kVAr", Power, 1e-3),
    ("MVAr", Power, 1.0),
    ("V", Voltage, 1e-3),
    ("kV", Voltage, 1.0),
    ("mHz", Frequency, 1e-3),
    ("Hz", Frequency, 1.0),
    ("kHz", Frequency, 1e3),
    ("rad/s", Frequency, 1.0 / RADIANS_PER_TURN),
    ("Wh", Energy, 1e-6),
    ("kWh", Energy, 1e-3),
    ("MWh", Energy, 1.0),
    ("GWh", Energy, 1e3),
    ("J", Energy, 1e-6 / 3600.0),
    ("kJ", Energy, 1e-3 / 3600.0),
    ("MJ", Energy, 1.0 / 3600.0),
    ("GJ", Energy, 1e3 / 3600.0),
    ("SoC", Charge, 1.0),
    ("SoC_%", Charge, 0.01),
    ("rad", Angle, 1.0),
    ("deg", Angle, RADIANS_PER_TURN / 360.0),
];

impl Unit {
    /// Per unit.
    pub const PU: Unit = Unit { name: "pu", dimension: PerUnit, scale: 1.0 };

    /// The unit of this name; upper and lower case count, for mW is no MW.
    pub fn parse(name: &str) -> Option<Unit> {
        let found = UNITS.iter().find(|(known, ..)| *known == name)?;
        Some(Unit { name: found.0, dimension: found.1, scale: found.2 })
    }

    /// The names of all units, for messages.
    pub fn names() -> String {
        UNITS.map(|(name, ..)| name).join(", ")
    }

    /// Whether a value in one can be said in the other.
    pub fn converts_to(self, other: Unit) -> bool {
        let family = |unit: Unit| if unit.dimension == Charge { Energy } else { unit.dimension };
        [self, other].iter().any(|unit| unit.dimension == PerUnit) || family(self) == family(other)
    }

    /// Whether both are the same unit under two names; `SoC_%` is declared as `%`.
    pub fn is_like(self, other: Unit) -> bool {
        let of_base = |unit: Unit| matches!(unit.dimension, PerUnit | Charge);
        let kind = self.dimension == other.dimension || (of_base(self) && of_base(other));
        kind && (self.scale / other.scale - 1.0).abs() < 1e-12
    }

    /// One of it, per unit of this base.
    fn per_unit(self, base: &Base) -> Result<f64, &'static str> {
        let of = |base: Option<f64>, key| base.map(|base| self.scale / base).ok_or(key);
        match self.dimension {
            PerUnit | Angle => Ok(self.scale),
            Power | Energy => of(base.mva, "bases.MVA"),
            Voltage => of(base.kv, "bases.kV"),
            Frequency => of(base.hz, "bases.Hz"),
            Charge => base.capacity.map(|capacity| self.scale * capacity).ok_or("a battery"),
        }
    }

    /// How many of `other` one of it is; fails with the base that is missing.
    pub fn factor_to(self, other: Unit, base: &Base) -> Result<f64, &'static str> {
        if self.dimension == other.dimension {
            return Ok(self.scale / other.scale);
        }
        Ok(self.per_unit(base)? / other.per_unit(base)?)
    }
}

/// What 1 pu is at one battery.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Base {
    /// Power, MVA; the energy base is this times one hour.
    pub mva: Option<f64>,
    /// Voltage, kV, line to line.
    pub kv: Option<f64>,
    /// Frequency, Hz.
    pub hz: Option<f64>,
    /// The battery's capacity, pu*h; none where no battery is meant.
    pub capacity: Option<f64>,
}

/// What 1 pu is, where a connection converts units.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Bases {
    /// Power base, MVA; that of `grid.case` when left out. 1 pu*h is this times one hour.
    #[serde(rename = "MVA", skip_serializing_if = "Option::is_none")]
    pub mva: Option<f64>,
    /// Voltage base, kV, line to line: one for all batteries or a list; that of `grid.case` when left out.
    #[serde(rename = "kV", skip_serializing_if = "Option::is_none")]
    pub kv: Option<PerBattery>,
    /// Nominal frequency, Hz; `grid.f_nominal_hz` when left out.
    #[serde(rename = "Hz", skip_serializing_if = "Option::is_none")]
    pub hz: Option<f64>,
}

/// One number for all batteries, or one for each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PerBattery {
    /// For all.
    All(f64),
    /// In the order of the agents.
    Each(Vec<f64>),
}

impl PerBattery {
    /// The number for battery `i` (from 0); none where a list needs a battery and there is none.
    pub fn of(&self, i: Option<usize>) -> Option<f64> {
        match self {
            PerBattery::All(value) => Some(*value),
            PerBattery::Each(values) => values.get(i?).copied(),
        }
    }

    /// Every number in it.
    pub fn values(&self) -> &[f64] {
        match self {
            PerBattery::All(value) => std::slice::from_ref(value),
            PerBattery::Each(values) => values,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: Base = Base { mva: Some(100.0), kv: Some(138.0), hz: Some(60.0), capacity: Some(0.5) };

    fn factor(from: &str, to: &str) -> f64 {
        Unit::parse(from).unwrap().factor_to(Unit::parse(to).unwrap(), &BASE).unwrap()
    }

    #[test]
    fn one_of_each_is_what_a_textbook_says() {
        for (from, to, expected) in [
            ("MW", "pu", 0.01),
            ("kW", "pu", 1e-5),
            ("pu", "MVAr", 100.0),
            ("pu", "kV", 138.0),
            ("V", "pu", 1.0 / 138e3),
            ("Hz", "pu", 1.0 / 60.0),
            ("pu", "rad/s", 376.991118430775),
            ("MWh", "pu", 0.01),
            ("MJ", "MWh", 1.0 / 3600.0),
            ("SoC", "pu.h", 0.5),
            ("SoC_%", "pu", 0.005),
            ("SoC_%", "MWh", 0.5),
            ("deg", "rad", 0.017453292519943295),
            ("%", "pu", 0.01),
            ("MW", "kW", 1000.0),
        ] {
            let found = factor(from, to);
            assert!((found / expected - 1.0).abs() < 1e-14, "{from} to {to}: {found}");
        }
    }

    #[test]
    fn names_are_unique_and_dimensions_do_not_mix() {
        let mut names: Vec<&str> = UNITS.iter().map(|unit| unit.0).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), UNITS.len());
        let unit = |name| Unit::parse(name).unwrap();
        assert!(!unit("MW").converts_to(unit("kV")) && unit("MWh").converts_to(unit("SoC")));
        assert!(unit("MVAr").is_like(unit("Mvar")) && !unit("MW").is_like(unit("kW")));
        assert!(unit("%").is_like(unit("SoC_%")) && !unit("%").is_like(unit("pu")));
        assert_eq!(Unit::parse("mW"), None);
    }

    #[test]
    fn a_missing_base_is_named() {
        let kv = Unit::parse("kV").unwrap();
        assert_eq!(kv.factor_to(Unit::PU, &Base::default()), Err("bases.kV"));
        let to_volts = kv.factor_to(Unit::parse("V").unwrap(), &Base::default());
        assert!((to_volts.unwrap() - 1000.0).abs() < 1e-12);
    }
}

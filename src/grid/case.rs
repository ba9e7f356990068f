//! The network data: buses, branches and generators as in a MATPOWER case, with bus ids of any kind.
//! Positions count in the order of the bus table. Never solves anything.

use super::error::{GridError, finite, positive};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A network as in a MATPOWER case; powers in MW and MVAr, impedances in pu.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Name, for messages.
    #[serde(default)]
    pub name: String,
    /// System base, MVA.
    pub base_mva: f64,
    /// Buses; the position `b` of a bus counts from 1 in this order.
    pub bus: Vec<Bus>,
    /// Lines and transformers.
    pub branch: Vec<Branch>,
    /// Generators.
    pub generator: Vec<Generator>,
}

/// One bus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bus {
    /// Bus number, any positive one, unique.
    pub id: u64,
    /// MATPOWER's BUS_TYPE: 1 PQ, 2 PV, 3 reference, 4 isolated.
    #[serde(rename = "type")]
    pub kind: u8,
    /// Active load, MW.
    #[serde(default)]
    pub pd: f64,
    /// Reactive load, MVAr, positive inductive.
    #[serde(default)]
    pub qd: f64,
    /// Shunt conductance, MW at 1 pu.
    #[serde(default)]
    pub gs: f64,
    /// Shunt susceptance, MVAr injected at 1 pu.
    #[serde(default)]
    pub bs: f64,
    /// Voltage magnitude, pu: start of the power flow, or a stored solution.
    #[serde(default = "one")]
    pub vm: f64,
    /// Voltage angle, degrees.
    #[serde(default)]
    pub va: f64,
    /// Base voltage, kV; for information.
    #[serde(default)]
    pub base_kv: f64,
}

/// One line or transformer: pi model, ideal transformer at the `from` end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Branch {
    /// Id of the bus at the tapped end.
    pub from: u64,
    /// Id of the bus at the other end.
    pub to: u64,
    /// Resistance, pu.
    #[serde(default)]
    pub r: f64,
    /// Reactance, pu.
    pub x: f64,
    /// Total line charging susceptance, pu.
    #[serde(default)]
    pub b: f64,
    /// Off-nominal tap ratio; 0 is a line, read as 1.
    #[serde(default)]
    pub ratio: f64,
    /// Phase shift, degrees, positive delays `to`.
    #[serde(default)]
    pub shift: f64,
    /// 1 in service, 0 out.
    #[serde(default = "in_service")]
    pub status: u8,
}

/// One generator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Generator {
    /// Id of its bus.
    pub bus: u64,
    /// Active power, MW.
    #[serde(default)]
    pub pg: f64,
    /// Reactive power, MVAr.
    #[serde(default)]
    pub qg: f64,
    /// Voltage setpoint, pu.
    #[serde(default = "one")]
    pub vg: f64,
    /// Upper reactive limit, MVAr; for information, the power flow enforces none.
    #[serde(default)]
    pub qmax: f64,
    /// Lower reactive limit, MVAr; for information.
    #[serde(default)]
    pub qmin: f64,
    /// Upper active limit, MW; for information.
    #[serde(default)]
    pub pmax: f64,
    /// Lower active limit, MW; for information.
    #[serde(default)]
    pub pmin: f64,
    /// 1 in service, 0 out.
    #[serde(default = "in_service")]
    pub status: u8,
}

fn one() -> f64 {
    1.0
}

fn in_service() -> u8 {
    1
}

/// MATPOWER's bus types.
pub(crate) const PQ: u8 = 1;
pub(crate) const PV: u8 = 2;
pub(crate) const REFERENCE: u8 = 3;
pub(crate) const ISOLATED: u8 = 4;

impl Case {
    /// Names of the built-in cases.
    pub const BUILT_IN: &'static [&'static str] = &["case57"];

    /// A case from its JSON text, validated.
    pub fn from_json(text: &str) -> Result<Self, GridError> {
        let case: Case = serde_json::from_str(text)
            .map_err(|e| GridError::Syntax { line: e.line(), message: e.to_string() })?;
        case.validate("")?;
        Ok(case)
    }

    /// A built-in case by name: `case57`, the IEEE 57-bus test case.
    pub fn built_in(name: &str) -> Result<Self, GridError> {
        match name {
            "case57" => Self::from_json(include_str!("cases/case57.json")),
            _ => Err(GridError::invalid(
                "case",
                format!("\"{name}\""),
                format!("one of the built-in cases {}, or a case object", Self::BUILT_IN.join(", ")),
            )),
        }
    }

    /// Position of the bus with this id, counted from 0.
    pub fn position(&self, id: u64) -> Option<usize> {
        self.bus.iter().position(|bus| bus.id == id)
    }

    /// Bus id -> position counted from 0.
    pub(crate) fn positions(&self) -> BTreeMap<u64, usize> {
        self.bus.iter().enumerate().map(|(k, bus)| (bus.id, k)).collect()
    }

    /// Checks everything that the rest of the room relies on; `prefix` goes before each path.
    pub fn validate(&self, prefix: &str) -> Result<(), GridError> {
        positive(|| format!("{prefix}base_mva"), self.base_mva)?;
        if self.bus.is_empty() {
            return Err(GridError::invalid(format!("{prefix}bus"), "no bus", "at least one bus"));
        }
        let positions = self.positions();
        self.validate_buses(prefix, &positions)?;
        self.validate_branches(prefix, &positions)?;
        self.validate_generators(prefix, &positions)?;
        if !self.bus.iter().any(|bus| bus.kind == REFERENCE) {
            return Err(GridError::invalid(
                format!("{prefix}bus"),
                "no bus of type 3",
                "at least one reference bus (type 3) for the power flow",
            ));
        }
        Ok(())
    }

    fn validate_buses(&self, prefix: &str, positions: &BTreeMap<u64, usize>) -> Result<(), GridError> {
        for (k, bus) in self.bus.iter().enumerate() {
            let path = |key: &str| format!("{prefix}bus[{k}].{key}");
            if bus.id == 0 {
                return Err(GridError::invalid(path("id"), 0, "a positive bus number"));
            }
            if positions.get(&bus.id) != Some(&k) {
                return Err(GridError::invalid(path("id"), bus.id, "a number that no other bus has"));
            }
            if !(PQ..=ISOLATED).contains(&bus.kind) {
                return Err(GridError::invalid(
                    path("type"),
                    bus.kind,
                    "1 (PQ), 2 (PV), 3 (reference) or 4 (isolated)",
                ));
            }
            let values = [("pd", bus.pd), ("qd", bus.qd), ("gs", bus.gs), ("bs", bus.bs), ("va", bus.va)];
            for (key, value) in values {
                finite(|| path(key), value)?;
            }
            finite(|| path("base_kv"), bus.base_kv)?;
            if bus.kind != ISOLATED {
                positive(|| path("vm"), bus.vm)?;
            }
        }
        Ok(())
    }

    fn validate_branches(&self, prefix: &str, positions: &BTreeMap<u64, usize>) -> Result<(), GridError> {
        for (k, branch) in self.branch.iter().enumerate() {
            let path = |key: &str| format!("{prefix}branch[{k}].{key}");
            known_bus(path("from"), branch.from, positions)?;
            known_bus(path("to"), branch.to, positions)?;
            status(path("status"), branch.status)?;
            let values = [("r", branch.r), ("x", branch.x), ("b", branch.b), ("shift", branch.shift)];
            for (key, value) in values {
                finite(|| path(key), value)?;
            }
            if !branch.ratio.is_finite() || branch.ratio < 0.0 {
                return Err(GridError::invalid(
                    path("ratio"),
                    branch.ratio,
                    "0 for a line, or a positive ratio",
                ));
            }
            if branch.status == 1 && branch.r == 0.0 && branch.x == 0.0 {
                return Err(GridError::invalid(
                    path("x"),
                    "r = x = 0",
                    "an impedance other than 0; join the two buses instead",
                ));
            }
            if branch.status == 1 && branch.from == branch.to {
                return Err(GridError::invalid(path("to"), branch.to, "another bus than `from`"));
            }
        }
        Ok(())
    }

    fn validate_generators(&self, prefix: &str, positions: &BTreeMap<u64, usize>) -> Result<(), GridError> {
        for (k, generator) in self.generator.iter().enumerate() {
            let path = |key: &str| format!("{prefix}generator[{k}].{key}");
            known_bus(path("bus"), generator.bus, positions)?;
            status(path("status"), generator.status)?;
            finite(|| path("pg"), generator.pg)?;
            finite(|| path("qg"), generator.qg)?;
            let holds_voltage = positions
                .get(&generator.bus)
                .is_some_and(|&at| self.bus[at].kind == PV || self.bus[at].kind == REFERENCE);
            if generator.status == 1 && holds_voltage {
                positive(|| path("vg"), generator.vg)?;
            }
        }
        Ok(())
    }
}

fn known_bus(path: String, id: u64, positions: &BTreeMap<u64, usize>) -> Result<(), GridError> {
    if positions.contains_key(&id) {
        Ok(())
    } else {
        Err(GridError::invalid(path, id, "the id of a bus in the bus table"))
    }
}

fn status(path: String, value: u8) -> Result<(), GridError> {
    if value <= 1 { Ok(()) } else { Err(GridError::invalid(path, value, "1 (in service) or 0 (out)")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_case_is_the_57_bus_system() {
        let case = Case::built_in("case57").unwrap();
        assert_eq!((case.bus.len(), case.branch.len(), case.generator.len()), (57, 80, 7));
        // Total load of the IEEE case: 1250.8 MW, 336.4 MVAr.
        let pd: f64 = case.bus.iter().map(|b| b.pd).sum();
        let qd: f64 = case.bus.iter().map(|b| b.qd).sum();
        assert!((pd - 1250.8).abs() < 1e-9 && (qd - 336.4).abs() < 1e-9);
    }

    #[test]
    fn errors_name_the_path() {
        let case = Case::built_in("case57").unwrap();
        let broken = |change: fn(&mut Case)| {
            let mut case = case.clone();
            change(&mut case);
            case.validate("case.").unwrap_err().to_string()
        };
        assert!(broken(|c| c.branch[3].to = 99).starts_with("case.branch[3].to: found 99"));
        assert!(broken(|c| c.bus[8].id = 3).starts_with("case.bus[2].id: found 3"));
        assert!(broken(|c| c.bus[0].kind = 1).starts_with("case.bus: found no bus of type 3"));
        assert!(broken(|c| c.base_mva = 0.0).starts_with("case.base_mva: found 0"));
        assert!(Case::from_json("{\n\"base_mva\": oops").unwrap_err().to_string().starts_with("line 2"));
    }
}

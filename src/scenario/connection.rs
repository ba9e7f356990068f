//! The connection table as the user writes it, and as single wires with one factor each: placeholders for the
//! batteries filled in, units turned into factors. Knows no FMU; names are checked when it is there.

use super::document::Scenario;
use super::error::ScenarioError;
use super::units::{Base, PerBattery, Unit};
use crate::grid;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Wires from outputs to inputs: `input = factor * output + offset`, in the units of the input. In both names
/// `{i}` stands for every battery's number from 1, `{i0}` from 0, `{bus}` for its bus, `{name}` for its name; a
/// line with a placeholder is one wire for each battery. Without one in `from`, one output feeds all.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Connection {
    /// `grid.NAME` or `controller.NAME`, an output: `grid.Bess{i}.P_MW`.
    pub from: String,
    /// `grid.NAME` or `controller.NAME`, an input: `controller.P[{i}]`.
    pub to: String,
    /// Unit of the output, such as MW, Mvar, kV, Hz, rad/s, MWh, SoC_%; pu when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_unit: Option<String>,
    /// Unit of the input; pu when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_unit: Option<String>,
    /// Factor after the conversion of units, 1 when left out; one number, or a list with one for each battery.
    #[serde(default = "one")]
    pub factor: PerBattery,
    /// Added after the factor, in the unit of the input; one number, or a list with one for each battery.
    #[serde(default = "zero")]
    pub offset: PerBattery,
}

fn one() -> PerBattery {
    PerBattery::All(1.0)
}

fn zero() -> PerBattery {
    PerBattery::All(0.0)
}

/// One wire: `to = factor * from + offset`, with the change of unit in the factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Wire {
    /// An output, `participant.variable`.
    pub from: String,
    /// An input, `participant.variable`.
    pub to: String,
    /// Units of `to` per unit of `from`.
    pub factor: f64,
    /// In units of `to`.
    pub offset: f64,
    /// Unit of the output, where the table names it.
    pub from_unit: Option<Unit>,
    /// Unit of the input, where the table names it.
    pub to_unit: Option<Unit>,
    /// Line of the table, from 0: `connections[k]`.
    pub line: usize,
}

/// The wires of the whole table, in its order, battery by battery.
pub(super) fn wires(
    scenario: &Scenario,
    grid: Option<&grid::Config>,
    origin: &str,
) -> Result<Vec<Wire>, ScenarioError> {
    let names = Batteries::new(scenario);
    let bases = BaseOf::new(scenario, grid, origin)?;
    let mut wires = Vec::new();
    for (k, line) in scenario.connections.iter().enumerate() {
        let at = |key: &str| format!("connections[{k}].{key}");
        let wrong = |key: &str, found: String, expected: String| ScenarioError::Value {
            origin: origin.into(),
            path: at(key),
            found,
            expected,
        };
        let unit = |key: &str, name: &Option<String>| {
            name.as_deref().map_or(Ok(None), |name| {
                let unknown = || wrong(key, format!("{name:?}"), format!("one of {}", Unit::names()));
                Unit::parse(name).map(Some).ok_or_else(unknown)
            })
        };
        let (from_unit, to_unit) = (unit("from_unit", &line.from_unit)?, unit("to_unit", &line.to_unit)?);
        let (source, target) = (from_unit.unwrap_or(Unit::PU), to_unit.unwrap_or(Unit::PU));
        if !source.converts_to(target) {
            let expected = format!("a unit that {} can become", source.name);
            return Err(wrong("to_unit", format!("{:?}", target.name), expected));
        }
        for (key, value) in [("factor", &line.factor), ("offset", &line.offset)] {
            check(value, names.count(), origin, &at(key))?;
        }
        let froms = names.expand(&line.from, &at("from"), origin)?;
        let tos = names.expand(&line.to, &at("to"), origin)?;
        if froms.len() > 1 && tos.len() == 1 {
            let expected = "a placeholder such as {i} in both, or none in `from`".into();
            return Err(wrong("to", format!("{:?}", line.to), expected));
        }
        for (place, to) in tos.iter().enumerate() {
            let from = froms.get(place).or(froms.first()).cloned().unwrap_or_default();
            let battery =
                if tos.len() > 1 { Some(place) } else { index(to).or(index(&from)).or(names.only()) };
            let value = |key: &str, values: &PerBattery| {
                let expected = "one number, for no battery is meant here".to_owned();
                values.of(battery).ok_or_else(|| wrong(key, "a list".into(), expected))
            };
            let conversion = source.factor_to(target, &bases.of(battery)).map_err(|missing| {
                let key = if from_unit.is_some() { "from_unit" } else { "to_unit" };
                let found = format!("{} to {}", source.name, target.name);
                wrong(key, found, format!("{missing} to be given, for this conversion needs it"))
            })?;
            wires.push(Wire {
                from,
                to: to.clone(),
                factor: value("factor", &line.factor)? * conversion,
                offset: value("offset", &line.offset)?,
                from_unit,
                to_unit,
                line: k,
            });
        }
    }
    Ok(wires)
}

/// A finite number, or one for each battery.
fn check(values: &PerBattery, n: usize, origin: &str, path: &str) -> Result<(), ScenarioError> {
    let wrong = |found: String, expected: String| {
        Err(ScenarioError::Value { origin: origin.into(), path: path.into(), found, expected })
    };
    if let PerBattery::Each(list) = values
        && list.len() != n
    {
        return wrong(format!("{} numbers", list.len()), format!("one number, or {n}: one for each battery"));
    }
    match values.values().iter().find(|value| !value.is_finite()) {
        Some(value) => wrong(value.to_string(), "a finite number".into()),
        None => Ok(()),
    }
}

/// Battery 2 (from 0) of `controller.P[3]`.
fn index(name: &str) -> Option<usize> {
    let (variable, number) = name.strip_suffix(']')?.rsplit_once('[')?;
    if !variable.starts_with("controller.") {
        return None;
    }
    number.parse::<usize>().ok()?.checked_sub(1)
}

/// What the placeholders stand for.
pub struct Batteries(Vec<[(&'static str, String); 4]>);

impl Batteries {
    /// Of this scenario.
    pub fn new(scenario: &Scenario) -> Self {
        let words = |(i, bess): (usize, &super::document::Bess)| {
            let name = bess.name.clone().unwrap_or_else(|| format!("BESS {}", i + 1));
            [
                ("{i}", (i + 1).to_string()),
                ("{i0}", i.to_string()),
                ("{bus}", bess.bus.to_string()),
                ("{name}", name),
            ]
        };
        Self(scenario.bess.iter().enumerate().map(words).collect())
    }

    fn count(&self) -> usize {
        self.0.len()
    }

    fn only(&self) -> Option<usize> {
        (self.count() == 1).then_some(0)
    }

    /// The name itself, or with a placeholder one name for each battery.
    pub fn expand(&self, pattern: &str, path: &str, origin: &str) -> Result<Vec<String>, ScenarioError> {
        let fill = |words: &[(&str, String); 4]| {
            words.iter().fold(pattern.to_owned(), |name, (word, value)| name.replace(word, value))
        };
        let filled: Vec<String> = self.0.iter().map(fill).collect();
        let unknown = filled.first().is_some_and(|name| name.contains(['{', '}']));
        if unknown {
            return Err(ScenarioError::Value {
                origin: origin.into(),
                path: path.into(),
                found: format!("{pattern:?}"),
                expected: "no braces but in the placeholders {i}, {i0}, {bus}, {name}".into(),
            });
        }
        if !pattern.contains('{') {
            return Ok(vec![pattern.to_owned()]);
        }
        let different: BTreeSet<&String> = filled.iter().collect();
        if different.len() < filled.len() {
            return Err(ScenarioError::Value {
                origin: origin.into(),
                path: path.into(),
                found: format!("{pattern:?}, which is the same name for several batteries"),
                expected: "a placeholder that tells them apart, such as {i}".into(),
            });
        }
        Ok(filled)
    }
}

/// What 1 pu is, battery by battery.
struct BaseOf<'a> {
    scenario: &'a Scenario,
    mva: Option<f64>,
    kv: Vec<Option<f64>>,
}

impl<'a> BaseOf<'a> {
    fn new(scenario: &'a Scenario, grid: Option<&grid::Config>, origin: &str) -> Result<Self, ScenarioError> {
        let bases = &scenario.bases;
        let n = scenario.bess.len();
        let numbers = [("MVA", bases.mva), ("Hz", bases.hz)];
        let singles = numbers.iter().flat_map(|(key, value)| value.map(|value| (*key, value)));
        let kv = bases.kv.iter().flat_map(|kv| kv.values().iter().map(|value| ("kV", *value)));
        if let Some((key, value)) = singles.chain(kv).find(|(_, value)| !(*value > 0.0 && value.is_finite()))
        {
            return Err(ScenarioError::Value {
                origin: origin.into(),
                path: format!("bases.{key}"),
                found: value.to_string(),
                expected: "a number greater than 0".into(),
            });
        }
        if let Some(kv) = &bases.kv {
            check(kv, n, origin, "bases.kV")?;
        }
        let case = grid.and_then(|grid| grid.case.resolve().ok());
        let of_bus = |id: u64| {
            let buses = &case.as_ref()?.bus;
            buses.iter().find(|bus| bus.id == id).map(|bus| bus.base_kv).filter(|kv| *kv > 0.0)
        };
        let kv = |(i, bess): (usize, &super::document::Bess)| match &bases.kv {
            Some(kv) => kv.of(Some(i)),
            None => of_bus(bess.bus),
        };
        Ok(Self {
            scenario,
            mva: bases.mva.or(case.as_ref().map(|case| case.base_mva)),
            kv: scenario.bess.iter().enumerate().map(kv).collect(),
        })
    }

    fn of(&self, battery: Option<usize>) -> Base {
        let shared = self.scenario.bases.kv.as_ref().and_then(|kv| kv.of(None));
        Base {
            mva: self.mva,
            kv: battery.and_then(|i| self.kv.get(i).copied().flatten()).or(shared),
            hz: Some(self.scenario.bases.hz.unwrap_or(self.scenario.grid.f_nominal_hz)),
            capacity: battery.and_then(|i| self.scenario.bess.get(i)).map(|bess| bess.capacity()),
        }
    }
}

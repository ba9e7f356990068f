//! From the scenario to the configurations of controller and grid, checked whole before anything is written.

use super::connection::{self, Batteries, Wire};
use super::document::{Distance, Grid, Scenario};
use super::error::ScenarioError;
use super::fault::{self, WireFault};
use super::load::{Source, find, read};
use super::{resolve_control, resolve_grid};
use crate::{control, grid};
use serde_json::{Map, Value};
use std::path::PathBuf;

/// A scenario that can be run: everything in it was checked.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// The document.
    pub scenario: Scenario,
    /// Where it came from.
    pub source: Source,
    /// The controller.
    pub control: control::Config,
    /// The built-in grid model; none where `grid.case` is "none", for an FMU takes its place.
    pub grid: Option<grid::Config>,
    /// The connection table, wire by wire.
    pub wires: Vec<Wire>,
    /// Faults of the wires; those of messages are in `control`.
    pub faults: Vec<WireFault>,
}

impl Resolved {
    /// Finds, reads and checks a scenario, with the keys in `set` in place of its own.
    pub fn load(name: &str, set: &Map<String, Value>) -> Result<Self, ScenarioError> {
        Self::of(&find(name)?, set)
    }

    /// Reads and checks a scenario that was found.
    pub fn of(source: &Source, set: &Map<String, Value>) -> Result<Self, ScenarioError> {
        let mut scenario = read(source, set)?;
        check_frame(&scenario, &source.origin)?;
        name_every_battery(&mut scenario, &source.origin)?;
        let grid = resolve_grid::grid(&scenario, source)?;
        let (faults, messages) = fault::resolve(&scenario, &source.origin)?;
        let control = resolve_control::control(&scenario, messages, &source.origin, || {
            resolve_grid::electrical_distances(grid.as_ref(), &source.origin)
        })?;
        let wires = connection::wires(&scenario, grid.as_ref(), &source.origin)?;
        Ok(Self { scenario, source: source.clone(), control, grid, wires, faults })
    }

    /// The FMU that the scenario puts in the controller's place.
    pub fn controller_fmu(&self) -> Option<PathBuf> {
        self.scenario.control.fmu.as_ref().map(|file| self.source.folder.join(file))
    }

    /// The FMU that the scenario puts in the grid's place.
    pub fn grid_fmu(&self) -> Option<PathBuf> {
        self.scenario.grid.fmu.as_ref().map(|file| self.source.folder.join(file))
    }

    /// The communication step, ns.
    pub fn step_ns(&self) -> i64 {
        nanoseconds(self.scenario.step_s)
    }

    /// The end of the simulation, ns.
    pub fn stop_ns(&self) -> i64 {
        nanoseconds(self.scenario.stop_s)
    }

    /// Name of battery `i` (from 0) in pictures.
    pub fn bess_name(&self, i: usize) -> String {
        let given = self.scenario.bess.get(i).and_then(|b| b.name.clone());
        given.unwrap_or_else(|| format!("BESS {}", i + 1))
    }
}

/// A checked time as a count of nanoseconds.
pub fn nanoseconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

/// Longest time that is counted in nanoseconds, s: about 100 years.
const LONGEST_S: f64 = 3e9;

/// What belongs to neither model: times, events, variants.
fn check_frame(scenario: &Scenario, origin: &str) -> Result<(), ScenarioError> {
    let wrong = |path: String, found: String, expected: &str| {
        Err(ScenarioError::Value { origin: origin.into(), path, found, expected: expected.into() })
    };
    let length = |t: f64| (1e-9..=LONGEST_S).contains(&t);
    if !length(scenario.stop_s) {
        return wrong("stop_s".into(), scenario.stop_s.to_string(), "a time greater than 0, s");
    }
    if !length(scenario.step_s) || scenario.step_s > scenario.stop_s {
        return wrong(
            "step_s".into(),
            scenario.step_s.to_string(),
            "a time greater than 0 and at most stop_s, s",
        );
    }
    if scenario.record_every == 0 {
        return wrong("record_every".into(), "0".into(), "1 or more: every k-th step is recorded");
    }
    if scenario.name.is_empty() || scenario.name.contains(['/', '\\', '\0']) || scenario.name.starts_with('.')
    {
        return wrong("name".into(), format!("{:?}", scenario.name), "a name that can be a folder: my-case");
    }
    if scenario.bess.is_empty() {
        return wrong("bess".into(), "no battery".into(), "at least one");
    }
    for (i, bess) in scenario.bess.iter().enumerate() {
        // The default capacity divides by K_P.
        for (key, gain) in [("K_P", bess.k_p), ("K_Q", bess.k_q)] {
            if !(gain > 0.0 && gain.is_finite()) {
                return wrong(format!("bess[{i}].{key}"), gain.to_string(), "a number greater than 0");
            }
        }
        if !(0.0..=1.0).contains(&bess.soc_start) {
            return wrong(format!("bess[{i}].soc_start"), bess.soc_start.to_string(), "a number from 0 to 1");
        }
    }
    if scenario.communication.graphs.is_none()
        && matches!(scenario.communication.distance, Distance::Electrical)
    {
        for (i, bess) in scenario.bess.iter().enumerate() {
            if let Some(first) = scenario.bess.iter().take(i).position(|other| other.bus == bess.bus) {
                return wrong(
                    format!("bess[{i}].bus"),
                    format!("{}, where bess[{first}] is", bess.bus),
                    "a bus of its own, because electrical distances tell the batteries apart; or give \
                     `communication.graphs`, or positions and the distance \"euclidean\"",
                );
            }
        }
    }
    for (k, event) in scenario.events.iter().enumerate() {
        if !(0.0..=LONGEST_S).contains(&event.at_s) {
            return wrong(format!("events[{k}].at_s"), event.at_s.to_string(), "a time from 0, s");
        }
        for (variable, value) in &event.set {
            check_value(&format!("events[{k}].set.{variable}"), value, origin)?;
        }
    }
    for (variable, value) in &scenario.initial {
        check_value(&format!("initial.{variable}"), value, origin)?;
    }
    Ok(())
}

/// Fills in the placeholders of `initial` and of the events.
fn name_every_battery(scenario: &mut Scenario, origin: &str) -> Result<(), ScenarioError> {
    let batteries = Batteries::new(scenario);
    let fill = |path: &str, set: &mut Map<String, Value>| {
        let mut filled = Map::new();
        for (name, value) in set.iter() {
            let names = batteries.expand(name, &format!("{path}.{name}"), origin)?;
            filled.extend(names.into_iter().map(|name| (name, value.clone())));
        }
        *set = filled;
        Ok(())
    };
    fill("initial", &mut scenario.initial)?;
    let mut events = scenario.events.iter_mut().enumerate();
    events.try_for_each(|(k, event)| fill(&format!("events[{k}].set"), &mut event.set))
}

fn check_value(path: &str, value: &Value, origin: &str) -> Result<(), ScenarioError> {
    if value.is_number() || value.is_boolean() {
        return Ok(());
    }
    Err(ScenarioError::Value {
        origin: origin.into(),
        path: path.into(),
        found: value.to_string(),
        expected: "a number, true or false".into(),
    })
}

impl Grid {
    /// Whether the case is the name of a file rather than of a built-in case.
    pub(super) fn case_is_file(&self) -> bool {
        self.case.ends_with(".json") || self.case.ends_with(".m")
    }
}

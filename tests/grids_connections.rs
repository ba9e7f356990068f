//! A grid that calls everything by other names and speaks other units, behind the connection table: the same run as
//! with the grid itself. And every way to get the table wrong.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use bess_consensus::harness::{
    CallError, Cast, Memory, Participant, StateHandle, Variable, run, scenario_plan, stage,
};
use bess_consensus::scenario::{Resolved, Source, find};
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// Our grid under other names, in MW, Mvar, kV, Hz and percent of the battery's capacity.
struct Foreign {
    inside: Box<dyn Participant>,
    variables: Vec<Variable>,
    /// By value reference: one pu in its unit.
    scale: Vec<f64>,
}

const BUSES: [u32; 7] = [1, 2, 3, 6, 8, 9, 12];

impl Foreign {
    fn new(inside: Box<dyn Participant>, capacity: &[f64]) -> Self {
        let mut variables = inside.variables().to_vec();
        let largest = variables.iter().map(|v| v.reference as usize).max().unwrap();
        let mut scale = vec![1.0; largest + 1];
        for variable in &mut variables {
            let Some((quantity, index)) = variable.name.trim_end_matches(']').split_once('[') else {
                continue;
            };
            let i: usize = index.parse::<usize>().unwrap() - 1;
            let (name, unit, one) = match quantity {
                "P" => ("P", Some("MW"), 100.0),
                "Q" => ("Q", Some("kvar"), 1e5),
                "V" => ("v", None, 138.0),
                "omega" => ("w", Some("rad/s"), 2.0 * std::f64::consts::PI * 50.0),
                "E" => ("charge", Some("%"), 100.0 / capacity[i]),
                "omega_set" => ("f0", Some("Hz"), 50.0),
                "V_set" => ("v0", Some("V"), 138e3),
                "P_set" => ("P0", Some("kW"), 1e5),
                "Q_set" => ("Q0", Some("Mvar"), 100.0),
                _ => continue,
            };
            variable.name = format!("plant.bess[{}].{name}", BUSES[i]);
            variable.unit = unit.map(str::to_owned);
            scale[variable.reference as usize] = one;
        }
        Self { inside, variables, scale }
    }
}

fn foreign_table() -> Value {
    let line = |from: &str, from_unit: &str, to: &str, to_unit: &str| json!({"from": from, "from_unit": from_unit, "to": to, "to_unit": to_unit});
    json!([
        line("grid.plant.bess[{bus}].P", "MW", "controller.P[{i}]", "pu"),
        line("grid.plant.bess[{bus}].Q", "kvar", "controller.Q[{i}]", "pu"),
        line("grid.plant.bess[{bus}].v", "kV", "controller.V[{i}]", "pu"),
        line("grid.plant.bess[{bus}].w", "rad/s", "controller.omega[{i}]", "pu"),
        line("grid.plant.bess[{bus}].charge", "SoC_%", "controller.E[{i}]", "pu.h"),
        line("controller.omega_set[{i}]", "pu", "grid.plant.bess[{bus}].f0", "Hz"),
        line("controller.V_set[{i}]", "pu", "grid.plant.bess[{bus}].v0", "V"),
        line("controller.P_set[{i}]", "pu", "grid.plant.bess[{bus}].P0", "kW"),
        line("controller.Q_set[{i}]", "pu", "grid.plant.bess[{bus}].Q0", "Mvar"),
    ])
}

fn resolved(changes: &[(&str, Value)]) -> Result<Resolved, String> {
    let mut set: Map<String, Value> = [
        ("stop_s", json!(30)),
        ("control.gains.E", json!(0.002)),
        ("bases", json!({"MVA": 100, "kV": 138, "Hz": 50})),
    ]
    .into_iter()
    .map(|(key, value)| (key.to_owned(), value))
    .collect();
    set.extend(changes.iter().map(|(key, value)| ((*key).to_owned(), value.clone())));
    Resolved::of(&find("case1").unwrap(), &set).map_err(|e| e.to_string())
}

/// What the controller commands in the end: omega_set, V_set and P_set of all batteries.
fn commanded(resolved: &Resolved, foreign: bool) -> Result<Vec<f64>, String> {
    let text = |e: bess_consensus::harness::HarnessError| e.to_string();
    let plain = self::resolved(&[]).unwrap();
    let (mut participants, mut plan) =
        stage(if foreign { &plain } else { resolved }, &Cast::default()).map_err(text)?;
    if foreign {
        let inside = participants.pop().unwrap();
        participants.push(Box::new(Foreign::new(inside, &resolved.control.capacity)));
        plan = scenario_plan(resolved, &participants, Vec::new()).map_err(text)?;
    }
    let mut memory = Memory::new(1, |column| column.participant == "controller");
    run(&mut participants, &plan, &mut memory).map_err(text)?;
    let mut all = Vec::new();
    for quantity in ["omega_set", "V_set", "P_set"] {
        for i in 1..=7 {
            all.push(*memory.values("controller", &format!("{quantity}[{i}]")).unwrap().last().unwrap());
        }
    }
    Ok(all)
}

/// Conversions round at 1e-16; the closed loop keeps what comes of it below 1e-12 pu over 3000 steps, 10 s of them
/// with the control law at work, whose slope near consensus is bounded by its boundary layer.
#[test]
fn other_names_and_units_change_nothing() {
    let plain = commanded(&resolved(&[]).unwrap(), false).unwrap();
    let other = commanded(&resolved(&[("connections", foreign_table())]).unwrap(), true).unwrap();
    let apart = plain.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("setpoints {apart:e} pu apart");
    assert!(apart < 1e-12, "{apart}");
    // The run is one in which the controller did something.
    assert!((plain[0] - 1.0015).abs() > 1e-3 && plain[14].abs() > 1e-3, "{plain:?}");
}

fn refused(connections: Value, parts: &[&str]) {
    let error = resolved(&[("connections", connections)])
        .and_then(|resolved| commanded(&resolved, true).map(|_| ()))
        .expect_err("the mistake was accepted");
    for part in parts {
        assert!(error.contains(part), "{error:?} does not say {part:?}");
    }
}

fn without(k: usize) -> Value {
    let mut table = foreign_table();
    table.as_array_mut().unwrap().remove(k);
    table
}

fn with(k: usize, key: &str, value: Value) -> Value {
    let mut table = foreign_table();
    table[k][key] = value;
    table
}

#[test]
fn a_wrong_table_says_what_and_where() {
    refused(
        with(0, "from", json!("grid.plant.bess[{bus}].p")),
        &["connection 1 ", "did you mean plant.bess[1].P"],
    );
    refused(with(0, "to", json!("controler.P[{i}]")), &["no participant \"controler\"", "controller, grid"]);
    refused(
        with(0, "from", json!("grid.plant.bess[{bus}].Q0")),
        &["plant.bess[1].Q0 is input Real", "an output"],
    );
    refused(
        with(5, "to", json!("grid.plant.bess[{bus}].v")),
        &["plant.bess[1].v is output Real", "an input"],
    );
    refused(
        with(1, "to", json!("controller.P[{i}]")),
        &["controller.P[1] already has the source grid.plant"],
    );
    refused(
        with(0, "from_unit", json!("mW")),
        &["connections[0].from_unit", "found \"mW\"", "one of pu", "MW", "SoC_%"],
    );
    refused(
        with(0, "from_unit", json!("kV")),
        &["grid.plant.bess[1].P is in MW", "found kV in the connection table"],
    );
    refused(with(2, "to_unit", json!("Hz")), &["connections[2].to_unit", "found \"Hz\"", "kV can become"]);
    refused(with(0, "from_unit", json!("kW")), &["plant.bess[1].P is in MW", "found kW"]);
    refused(
        with(0, "from", json!("grid.plant.bess[{k}].P")),
        &["connections[0].from", "{k}", "{i}, {i0}, {bus}"],
    );
    refused(
        with(0, "to", json!("controller.P[1]")),
        &["connections[0].to", "a placeholder such as {i} in both"],
    );
    refused(with(0, "factor", json!([1, 2])), &["connections[0].factor", "2 numbers", "or 7"]);
    refused(
        without(0),
        &["controller.P[1] has no source", "a constant in `initial`", "free in grid: plant.bess[1].P"],
    );
    refused(without(4), &["controller.E[1] has no source"]);
    refused(without(5), &["controller.omega_set[1] reaches no input", "free in grid: "]);
    refused(without(7), &["controller.P_set[1] reaches no input", "control.gains.E = 0"]);
}

#[test]
fn a_base_that_is_not_known_is_asked_for() {
    let of = |bases: Value| resolved(&[("connections", foreign_table()), ("bases", bases)]).map(|_| ());
    // The 57-bus case says its MVA but not its kV.
    let error = of(json!({})).unwrap_err();
    assert!(error.contains("connections[2].from_unit") && error.contains("bases.kV"), "{error}");
    of(json!({"kV": [138, 138, 138, 138, 138, 138, 138]})).unwrap();
    assert!(of(json!({"kV": [138, 138]})).unwrap_err().contains("bases.kV: found 2 numbers"));
    assert!(of(json!({"kV": 138, "MVA": 0})).unwrap_err().contains("bases.MVA: found 0"));
}

#[test]
fn units_that_two_descriptions_declare_must_agree_without_a_table() {
    let mut table = foreign_table();
    table[0] = json!({"from": "grid.plant.bess[{bus}].P", "to": "controller.P[{i}]"});
    refused(table.clone(), &["grid.plant.bess[1].P is in MW", "without conversion", "\"from_unit\": \"MW\""]);
    // Whoever scales by hand is believed.
    table[0]["factor"] = json!(0.01);
    commanded(&resolved(&[("connections", table), ("stop_s", json!(1))]).unwrap(), true).unwrap();
}

#[test]
fn constants_and_absent_batteries_need_no_source() {
    let initial = json!({"controller.E[{i}]": 0.35});
    let set = [("connections", without(4)), ("initial", initial), ("stop_s", json!(1))];
    let constant = resolved(&set).unwrap();
    assert_eq!(constant.scenario.initial["controller.E[7]"], json!(0.35));
    commanded(&constant, true).unwrap();
    let absent = json!({"controller.available[{i}]": false});
    commanded(
        &resolved(&[("connections", without(0)), ("initial", absent), ("stop_s", json!(1))]).unwrap(),
        true,
    )
    .unwrap();
}

#[test]
fn lists_and_offsets_belong_to_their_battery() {
    let table = json!([
        {"from": "grid.x", "to": "controller.P[{i}]", "factor": [1, 2, 3, 4, 5, 6, 7], "offset": 0.5},
        {"from": "grid.y", "from_unit": "SoC", "to": "controller.E[3]"},
        {"from": "grid.z{i0}", "to": "grid.a{name}", "to_unit": "%"},
    ]);
    let resolved = resolved(&[("connections", table)]).unwrap();
    let wires = &resolved.wires;
    assert_eq!((wires[3].from.as_str(), wires[3].to.as_str()), ("grid.x", "controller.P[4]"));
    assert_eq!((wires[3].factor, wires[3].offset), (4.0, 0.5));
    assert_eq!(wires[7].factor, resolved.control.capacity[2]);
    assert_eq!((wires[8].from.as_str(), wires[8].factor), ("grid.z0", 100.0));
}

#[test]
fn a_scenario_names_its_fmu_beside_itself() {
    let source = Source { folder: PathBuf::from("somewhere"), ..find("case1").unwrap() };
    let set: Map<String, Value> = [("grid.fmu".to_owned(), json!("Mine.fmu"))].into_iter().collect();
    let resolved = Resolved::of(&source, &set).unwrap();
    assert_eq!(resolved.grid_fmu(), Some(PathBuf::from("somewhere/Mine.fmu")));
    assert_eq!(resolved.controller_fmu(), None);
    let error = stage(&resolved, &Cast::of(&resolved)).err().unwrap().to_string();
    assert!(error.contains("Mine.fmu"), "{error}");
}

/// Nothing but the batteries, the distances between them and the FMU: no network.
#[test]
fn a_grid_of_ones_own_needs_no_case() {
    let none = |more: &[(&str, Value)]| {
        let mut set = vec![("grid.case", json!("none")), ("connections", foreign_table())];
        set.extend(more.iter().cloned());
        resolved(&set)
    };
    let error = none(&[]).unwrap_err();
    assert!(error.contains("communication.distance") && error.contains("communication.graphs"), "{error}");
    let distance = |i: u32, j: u32| if i == j { 0.0 } else { 1.0 + f64::from(i + j) };
    let distances: Vec<Vec<f64>> = (0..7).map(|i| (0..7).map(|j| distance(i, j)).collect()).collect();
    let given = ("communication.distance", json!({"given": distances}));
    let error = none(&[given.clone(), ("bases", json!({"kV": 138}))]).unwrap_err();
    assert!(error.contains("bases.MVA"), "{error}");
    let resolved = none(&[given, ("stop_s", json!(1))]).unwrap();
    commanded(&resolved, true).unwrap();
    let error = stage(&resolved, &Cast::default()).err().unwrap().to_string();
    assert!(error.contains("grid.case is \"none\"") && error.contains("--grid"), "{error}");
}

impl Participant for Foreign {
    fn name(&self) -> &str {
        self.inside.name()
    }
    fn variables(&self) -> &[Variable] {
        &self.variables
    }
    fn can_vary_step(&self) -> bool {
        self.inside.can_vary_step()
    }
    fn setup(&mut self, start_ns: i64, stop_ns: Option<i64>) -> Result<(), CallError> {
        self.inside.setup(start_ns, stop_ns)
    }
    fn enter_initialization(&mut self) -> Result<(), CallError> {
        self.inside.enter_initialization()
    }
    fn exit_initialization(&mut self) -> Result<(), CallError> {
        self.inside.exit_initialization()
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.inside.get_real(references, values)?;
        for (value, reference) in values.iter_mut().zip(references) {
            *value *= self.scale[*reference as usize];
        }
        Ok(())
    }
    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.inside.get_integer(references, values)
    }
    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.inside.get_boolean(references, values)
    }
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        let pairs = values.iter().zip(references);
        let in_pu: Vec<f64> = pairs.map(|(value, r)| value / self.scale[*r as usize]).collect();
        self.inside.set_real(references, &in_pu)
    }
    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.inside.set_integer(references, values)
    }
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.inside.set_boolean(references, values)
    }
    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        self.inside.do_step(t_ns, h_ns)
    }
    fn terminate(&mut self) -> Result<(), CallError> {
        self.inside.terminate()
    }
    fn reset(&mut self) -> Result<(), CallError> {
        self.inside.reset()
    }
    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        self.inside.save_state()
    }
    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError> {
        self.inside.restore_state(state)
    }
    fn forget_state(&mut self, state: StateHandle) {
        self.inside.forget_state(state);
    }
    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        self.inside.serialise_state(state)
    }
    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        self.inside.deserialise_state(bytes)
    }
}

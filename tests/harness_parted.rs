//! The paper's cases with the controller in parts, coupled with the grid by the harness: `bess run --parts`. The
//! whole controller with one step of delay on the links that are cut gives the same bits.
#![cfg(feature = "host")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

use bess_consensus::control::communication::{
    Communication, Explicit, ExplicitEdge, ExplicitPin, ExplicitTopology,
};
use bess_consensus::control::partition::{numbers, written};
use bess_consensus::control::topology::Topologies;
use bess_consensus::harness::scenario::Staged;
use bess_consensus::harness::{
    CONTROLLER, Cast, Column, Endpoint, GRID, Memory, Origin, run, stage, stage_apart,
};
use bess_consensus::models::fleet::Cut;
use bess_consensus::scenario::Resolved;
use serde_json::{Map, Value, json};

const SETPOINTS: [&str; 3] = ["omega_set", "V_set", "P_set"];
const RATES: [&str; 5] = ["u_omega", "u_P", "u_E", "u_V", "u_Q"];

fn resolved(name: &str, set: &[(&str, Value)]) -> Resolved {
    let set: Map<String, Value> = set.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
    Resolved::load(name, &set).unwrap()
}

fn recorded(resolved: &Resolved, controller: Origin) -> Memory {
    let (mut participants, plan) = stage(resolved, &Cast { controller, grid: Origin::InProcess }).unwrap();
    let mut memory = Memory::new(1, |_| true);
    let outcome = run(&mut participants, &plan, &mut memory).unwrap();
    assert!(outcome.is_settled && outcome.warnings.is_empty(), "{:?}", outcome.warnings);
    memory
}

/// The whole controller with late links where the parts are cut.
fn whole(resolved: &Resolved, cut: Cut) -> Resolved {
    let (part_of, step_s) = (numbers(&resolved.control, cut), resolved.scenario.step_s);
    let mut topologies = written(&resolved.control);
    for edge in topologies.iter_mut().flat_map(|topology| &mut topology.edges) {
        if part_of[edge.a as usize - 1] != part_of[edge.b as usize - 1] {
            edge.delay_s = Some(edge.delay_s.unwrap_or(resolved.control.delay_s).max(step_s));
        }
    }
    let mut late = resolved.clone();
    late.control.communication = Communication::Explicit(Explicit { topologies });
    late
}

fn of<'a>(memory: &'a Memory, participant: &str, quantity: &str, i: usize) -> &'a [f64] {
    memory.values(participant, &format!("{quantity}[{i}]")).unwrap()
}

#[test]
fn the_papers_cases_in_parts_are_the_whole_controller_with_late_links() {
    let average = [("control.voltage_policy", json!("average"))];
    // Both ends of a link have to know them.
    let smaller = json!({ "controller.capacity[3]": 0.2, "controller.P_exchange_max[5]": 0.05 });
    let smaller = [("stop_s", json!(40)), ("initial", smaller)];
    for (name, set) in [
        ("case1", &[][..]),
        ("case1", &smaller),
        ("case2", &[]),
        ("case3", &[("stop_s", json!(40))]),
        ("case4", &[]),
        ("case4", &average),
        ("voltage", &[]),
    ] {
        let resolved = resolved(name, set);
        for cut in [Cut::Clusters, Cut::Agents] {
            let parts = recorded(&resolved, Origin::Parts(cut));
            let late = recorded(&whole(&resolved, cut), Origin::InProcess);
            assert_eq!(parts.times_ns(), late.times_ns());
            let agents = |who, quantities: &[&'static str]| -> Vec<(&str, &'static str, usize)> {
                quantities.iter().flat_map(|q| (1..=7).map(move |i| (who, *q, i))).collect()
            };
            let mut compared = agents(CONTROLLER, &SETPOINTS);
            compared.extend(agents(CONTROLLER, &RATES));
            compared.extend(agents(GRID, &["P", "Q", "V", "omega", "E"]));
            for (who, quantity, i) in compared {
                let (x, y) = (of(&parts, who, quantity, i), of(&late, who, quantity, i));
                let differs = x.iter().zip(y).position(|(x, y)| x.to_bits() != y.to_bits());
                assert_eq!(differs, None, "{name}, {cut:?}: {who}.{quantity}[{i}], row");
            }
            assert!(parts.values(CONTROLLER, "lambda_2").is_none(), "nobody knows the whole graph");
        }
    }
}

/// An agent leaves and comes back: the parts hear of it a step later, and end where the whole controller ends.
#[test]
fn plug_and_play_in_parts_ends_where_the_whole_controller_ends() {
    let resolved = resolved("plug_and_play", &[]);
    for cut in [Cut::Clusters, Cut::Agents] {
        let parts = recorded(&resolved, Origin::Parts(cut));
        let late = recorded(&whole(&resolved, cut), Origin::InProcess);
        let rows = parts.times_ns().len();
        let sum = |k: usize| (1..=7).map(|i| of(&parts, CONTROLLER, "P_set", i)[k]).sum::<f64>();
        // One step's move of a link that the other end has left.
        let worst = (0..rows).map(|k| sum(k).abs()).fold(0.0, f64::max);
        let off = (0..rows).filter(|&k| sum(k).abs() > 1e-12).count();
        assert!(worst < 2e-2 && off <= 4, "{cut:?}: {worst:e} in {off} rows");
        for quantity in ["P", "omega", "V"] {
            let gap = (1..=7).map(|i| {
                (of(&parts, GRID, quantity, i)[rows - 1] - of(&late, GRID, quantity, i)[rows - 1]).abs()
            });
            let gap = gap.fold(0.0, f64::max);
            assert!(gap < 1e-3, "{cut:?}: {quantity} {gap:e} apart at the end");
        }
    }
}

/// The active leader of a cluster leaves and comes back: its cluster elects another one, to whom the other cluster links
/// itself, as in the whole controller. One step of the link to the other cluster is told late.
#[test]
fn leaders_are_elected_anew_in_clusters() {
    // Of case1's first cluster, {1, 2, 3}, agent 1 leads; without it agent 3 does.
    let events = |switch: bool| {
        let mut at = [
            json!({ "at_s": 0, "set": { "controller.enable": true } }),
            json!({ "at_s": 20, "set": { "controller.available[1]": false } }),
            json!({ "at_s": 30, "set": { "grid.dP_load[12]": -0.5, "grid.dQ_load[12]": -0.5 } }),
            json!({ "at_s": 50, "set": { "controller.available[1]": true } }),
        ];
        for (k, topology) in [(1, 2), (3, 1)] {
            if switch {
                at[k]["set"]["controller.topology"] = json!(topology);
            }
        }
        Value::from_iter(at)
    };
    let with_events = |switch| resolved("case1", &[("stop_s", json!(80)), ("events", events(switch))]);
    let (ours, cut) = (with_events(false), Cut::Clusters);
    let parts = recorded(&ours, Origin::Parts(cut));
    // The whole one, whose second graph is the one without agent 1.
    let mut late = whole(&with_events(true), cut);
    let without = |i: usize| i != 0;
    let built =
        Topologies::new(7, &ours.control.communication).build(0, &(0..7).map(without).collect::<Vec<_>>());
    assert_eq!(built.leaders, [2, 6]);
    let Communication::Explicit(Explicit { topologies }) = &mut late.control.communication else { panic!() };
    let crosses = |a: u32, b: u32| (a < 3) != (b < 3);
    topologies[1] = ExplicitTopology {
        name: "without 1".into(),
        edges: built
            .graph
            .edges()
            .iter()
            .map(|edge| ExplicitEdge {
                a: edge.a + 1,
                b: edge.b + 1,
                weight: edge.weight,
                delay_s: crosses(edge.a, edge.b).then_some(ours.scenario.step_s),
            })
            .collect(),
        pins: [3, 7].map(|agent| ExplicitPin { agent, weight: 1.0 }).to_vec(),
        clusters: topologies[0].clusters.clone(),
        leaders: Some(vec![3, 7]),
    };
    // It is out while this graph counts; a graph needs all.
    topologies[1].edges.push(ExplicitEdge { a: 1, b: 2, weight: 1.0, delay_s: None });
    let late = recorded(&late, Origin::InProcess);
    let step = |t_s: f64| (t_s / ours.scenario.step_s).round() as usize;
    for quantity in ["omega_set", "V_set"] {
        for i in 1..=7 {
            let [x, y] = [&parts, &late].map(|memory| of(memory, CONTROLLER, quantity, i));
            assert!((0..=step(20.0)).all(|k| x[k].to_bits() == y[k].to_bits()), "{quantity}[{i}] before");
            // Never further apart than the agent moves in one step, and together again before the leader is back.
            let away = step(20.0)..step(50.0);
            let gap = |k: usize| (x[k] - y[k]).abs();
            let move_of = |values: &[f64], k: usize| (values[k + 1] - values[k]).abs();
            let most = away.clone().map(|k| move_of(x, k).max(move_of(y, k))).fold(0.0, f64::max);
            let worst = away.clone().map(gap).fold(0.0, f64::max);
            println!("{quantity}[{i}]: {worst:e} apart, {:e} at the end; a step: {most:e}", gap(away.end));
            assert!(worst <= most && gap(away.end) < 1e-6, "{quantity}[{i}]: {worst:e}, {:e}", gap(away.end));
            assert_eq!(most > 0.0, i != 1, "{quantity}[{i}] holds");
        }
    }
    let rows = parts.times_ns().len();
    let sum = |k: usize| (1..=7).map(|i| of(&parts, CONTROLLER, "P_set", i)[k]).sum::<f64>();
    let worst = (0..rows).map(|k| sum(k).abs()).fold(0.0, f64::max);
    let off = (0..rows).filter(|&k| sum(k).abs() > 1e-12).count();
    println!("sum of P_set off by {worst:e} in {off} rows");
    assert!(worst < 2e-2 && off <= 4, "{worst:e} in {off} rows");
    for quantity in ["P", "omega", "V"] {
        for i in 1..=7 {
            let [x, y] = [&parts, &late].map(|memory| of(memory, GRID, quantity, i)[rows - 1]);
            assert!((x - y).abs() < 1e-3, "{quantity}[{i}]: {x} and {y} at the end");
        }
    }
}

/// Faults of measurements reach the parts as they reach the whole controller: the same noise, stuck and lost signals.
#[test]
fn faults_on_the_wire_reach_the_parts() {
    let faults = [
        json!({ "kind": "noise", "signal": "P[{i}]", "deviation": 1e-3, "seed": 3, "from_s": 2 }),
        json!({ "kind": "noise", "signal": "omega[{i}]", "deviation": 1e-6, "from_s": 2 }),
        json!({ "kind": "stuck", "signal": "P[5]", "from_s": 3, "until_s": 5 }),
        json!({ "kind": "drift", "signal": "omega[6]", "rate_per_s": 1e-5, "from_s": 4, "until_s": 6 }),
        json!({ "kind": "quantisation", "signal": "V[{i}]", "step": 1e-4, "from_s": 5 }),
        json!({ "kind": "stuck", "signal": "omega_ref", "value": 1.001, "from_s": 7, "until_s": 9 }),
        json!({ "kind": "drift", "signal": "grid.omega_set[7]", "rate_per_s": 1e-4, "from_s": 8, "until_s": 9 }),
    ];
    let on = json!([{ "at_s": 0, "set": { "controller.enable": true } }]);
    // Agent 3 has no link to the other cluster, nor has its only neighbour: that it is out is no other part's business.
    let lost = json!({ "kind": "nan", "signal": "Q[3]", "from_s": 6, "until_s": 8 });
    for cut in [Cut::Clusters, Cut::Agents] {
        let lost = (cut == Cut::Clusters).then(|| lost.clone());
        let faults = Value::from_iter(faults.iter().cloned().chain(lost));
        let set =
            [("stop_s", json!(10)), ("step_s", json!(0.02)), ("events", on.clone()), ("faults", faults)];
        let resolved = resolved("case1", &set);
        let (late, told) = with_warnings(stage(&whole(&resolved, cut), &Cast::default()).unwrap());
        let cast = Cast { controller: Origin::Parts(cut), grid: Origin::InProcess };
        let (parts, told_in_parts) = with_warnings(stage(&resolved, &cast).unwrap());
        let apart = stage_apart(&resolved, &Cast::default(), Some(cut)).unwrap();
        let columns = apart.columns;
        let (apart, told_apart) = with_warnings(apart.staged);
        // The same, under the name of the part.
        assert_eq!(told, told_in_parts);
        let under = |told: &String| told.replace("controller.", "cluster1.");
        assert_eq!(told.iter().map(under).collect::<Vec<_>>(), told_apart);
        assert_eq!(told.len(), usize::from(cut == Cut::Clusters));
        let names = (1..=7).flat_map(|i| {
            let own = SETPOINTS.map(|quantity| (CONTROLLER, format!("{quantity}[{i}]")));
            own.into_iter().chain(["P", "Q", "V", "omega"].map(|quantity| (GRID, format!("{quantity}[{i}]"))))
        });
        for (who, variable) in names {
            let expected = late.values(who, &variable).unwrap();
            let is_it = |(column, _): &&(Column, Vec<Endpoint>)| {
                column.participant == who && column.variable == variable
            };
            let (_, sources) = columns.iter().find(is_it).unwrap();
            let found_apart = apart.values(&sources[0].participant, &sources[0].variable).unwrap();
            for (how, found) in [("in parts", parts.values(who, &variable).unwrap()), ("apart", found_apart)]
            {
                let differs = expected.iter().zip(found).position(|(x, y)| x.to_bits() != y.to_bits());
                assert_eq!(differs, None, "{cut:?}, {how}: {who}.{variable}, row");
            }
        }
    }
}

/// The largest spread among some agents is nobody's spread of all: whoever connects it is told, not left without.
#[test]
fn a_wire_from_what_no_part_knows_is_refused() {
    for what in ["spread_P", "lambda_2"] {
        let wire = json!([{ "from": format!("controller.{what}"), "to": "grid.dP_load[1]" }]);
        let resolved = resolved("case1", &[("connections", wire)]);
        let error = stage_apart(&resolved, &Cast::default(), Some(Cut::Clusters)).err().unwrap().to_string();
        let expected = format!("the connection to grid.dP_load[1]: controller.{what} is the whole fleet's");
        assert!(error.starts_with(&expected), "{error}");
        assert!(stage_apart(&resolved, &Cast::default(), None).is_ok());
    }
}

fn with_warnings((mut participants, plan): Staged) -> (Memory, Vec<String>) {
    let mut memory = Memory::new(1, |_| true);
    let outcome = run(&mut participants, &plan, &mut memory).unwrap();
    (memory, outcome.warnings)
}

/// Importers keep what they have unpacked by its GUID: equal batteries must not be taken for each other.
#[test]
fn equal_batteries_have_guids_of_their_own() {
    use bess_consensus::control::Config;
    use bess_consensus::control::communication::{ExplicitEdge, ExplicitPin, ExplicitTopology};
    use bess_consensus::fmi::{Instance, Interface, Logger};
    use bess_consensus::models::fleet::Fleet;
    use bess_consensus::models::{Controller, Resource};
    let edge = |a: u32, b: u32| ExplicitEdge { a, b, weight: 1.0, delay_s: None };
    let topologies = vec![ExplicitTopology {
        name: "ring".into(),
        edges: vec![edge(1, 2), edge(2, 3), edge(3, 4), edge(4, 1)],
        pins: (1..=4).map(|agent| ExplicitPin { agent, weight: 1.0 }).collect(),
        clusters: None,
        leaders: None,
    }];
    let config = Config::unit(4, Communication::Explicit(Explicit { topologies }));
    let fleet = Fleet::of(&Resource { stop_s: 1.0, step_s: 0.01, config }, Cut::Agents).unwrap();
    let guid = |resource: &Resource<Config>| {
        let model = Controller::new(resource.clone()).unwrap();
        Instance::from_model("x", model, Interface::Structured, Logger::silent()).unwrap().guid().to_string()
    };
    let mut guids: Vec<String> = fleet.parts.iter().map(|part| guid(&part.resource)).collect();
    assert_eq!(guids[0], guid(&fleet.parts[0].resource));
    guids.sort();
    guids.dedup();
    assert_eq!(guids.len(), 4);
}

/// A run of parts that goes on from a checkpoint is the run that was never interrupted.
#[test]
fn parts_are_kept_and_brought_back_as_one() {
    let resolved = resolved("case1", &[("stop_s", json!(30))]);
    let cast = Cast { controller: Origin::Parts(Cut::Clusters), grid: Origin::InProcess };
    let (mut participants, _) = stage(&resolved, &cast).unwrap();
    let mut controller = participants.swap_remove(0);
    controller.setup(0, None).unwrap();
    controller.enter_initialization().unwrap();
    controller.exit_initialization().unwrap();
    let reference = |name: &str| {
        controller.variables().iter().find(|variable| variable.name == name).map(|v| v.reference).unwrap()
    };
    let (enable, omega_set) = (reference("enable"), [reference("omega_set[1]"), reference("omega_set[7]")]);
    controller.set_boolean(&[enable], &[1]).unwrap();
    let advance = |controller: &mut Box<dyn bess_consensus::harness::Participant>, from: i64, to: i64| {
        (from..to).for_each(|k| controller.do_step(k * 10_000_000, 10_000_000).unwrap());
        let mut values = [0.0; 2];
        controller.get_real(&omega_set, &mut values).unwrap();
        values
    };
    advance(&mut controller, 0, 50);
    let kept = controller.save_state().unwrap();
    let bytes = controller.serialise_state(kept).unwrap();
    let straight = advance(&mut controller, 50, 100);
    controller.restore_state(kept).unwrap();
    assert_eq!(straight, advance(&mut controller, 50, 100));
    let read = controller.deserialise_state(&bytes).unwrap();
    controller.restore_state(read).unwrap();
    assert_eq!(straight, advance(&mut controller, 50, 100));
    assert_ne!(straight[0], straight[1]);
    assert!(controller.deserialise_state(&bytes[..bytes.len() - 1]).is_err());
}

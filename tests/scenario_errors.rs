//! Every mistake in a scenario is one error with its path, what was found and what was expected, and nothing is
//! written.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used)]

use bess_consensus::scenario::{self, Resolved, Source};
use serde_json::{Map, Value, json};
use std::path::PathBuf;

fn case1_with(path: &str, value: Value) -> Result<Resolved, String> {
    let set: Map<String, Value> = [(path.to_owned(), value)].into_iter().collect();
    Resolved::load("case1", &set).map_err(|e| e.to_string())
}

fn document(text: String) -> Result<Resolved, String> {
    let source = Source { origin: "mine.json".into(), folder: PathBuf::from("."), text };
    Resolved::of(&source, &Map::new()).map_err(|e| e.to_string())
}

fn case1_text(from: &str, to: &str) -> String {
    let text = scenario::find("case1").unwrap().text;
    assert!(text.contains(from), "case1 no longer holds {from}");
    text.replacen(from, to, 1)
}

/// The error names all of these.
fn says(error: Result<Resolved, String>, parts: &[&str]) {
    let error = error.map(|_| ()).expect_err("the mistake was accepted");
    for part in parts {
        assert!(error.contains(part), "{error:?} does not say {part:?}");
    }
}

#[test]
fn the_built_in_scenario_is_sound_and_has_the_papers_parameters() {
    let resolved = Resolved::load("case1", &Map::new()).unwrap();
    assert_eq!(resolved.control.K_P, [0.004, 0.0048, 0.005, 0.0036, 0.0038, 0.00408, 0.0044]);
    let soc: Vec<f64> = resolved
        .grid
        .as_ref()
        .unwrap()
        .bess
        .iter()
        .zip(&resolved.control.capacity)
        .map(|(b, c)| b.E_start / c)
        .collect();
    for (soc, expected) in soc.iter().zip([0.704, 0.703, 0.702, 0.7, 0.699, 0.698, 0.696]) {
        assert!((soc - expected).abs() < 1e-15);
    }
}

#[test]
fn a_wrong_key_names_the_right_ones() {
    says(
        document(case1_text("\"eta\": 0.5", "\"etta\": 0.5")),
        &["mine.json", "control", "unknown field `etta`", "`eta`", "line 1", "column"],
    );
}

#[test]
fn a_wrong_type_says_both_types() {
    says(
        document(case1_text("\"K_P\": 0.0048", "\"K_P\": \"0.0048\"")),
        &["bess[1].K_P", "string \"0.0048\"", "expected a number"],
    );
}

#[test]
fn text_that_is_no_json_says_where() {
    says(document(case1_text("\"bess\": [", "\"bess\": [,")), &["bess", "line 6"]);
}

#[test]
fn a_limit_of_nan_is_refused_at_its_place() {
    says(
        document(case1_text("\"bus\": 1,", "\"bus\": 1, \"P_exchange_max\": NaN,")),
        &["bess[0].P_exchange_max", "line 7"],
    );
    says(
        document(case1_text("\"bus\": 1,", "\"bus\": 1, \"P_exchange_max\": \"NaN\",")),
        &["bess[0].P_exchange_max", "expected a number"],
    );
    says(
        document(case1_text("\"bus\": 1,", "\"bus\": 1, \"P_exchange_max\": 1e999,")),
        &["bess[0].P_exchange_max", "out of range"],
    );
}

#[test]
fn droop_gains_are_positive() {
    says(case1_with("bess[2].K_P", json!(0.0)), &["bess[2].K_P", "found 0"]);
    says(case1_with("bess[2].K_P", json!(-0.004)), &["bess[2].K_P", "found -0.004"]);
    says(case1_with("bess[3].K_Q", json!(0.0)), &["bess[3].K_Q", "found 0"]);
}

#[test]
fn eta_is_in_the_half_open_interval() {
    for eta in [0.0, -0.5, 1.000001] {
        says(case1_with("control.eta", json!(eta)), &["control.eta", &format!("found {eta}"), "1"]);
    }
    assert!(case1_with("control.eta", json!(1)).is_ok(), "eta = 1 is the asymptotic law");
}

fn graph(edges: &[(u32, u32)], pins: &[u32]) -> Value {
    let edges: Vec<Value> = edges.iter().map(|(a, b)| json!({"a": a, "b": b, "weight": 1})).collect();
    let pins: Vec<Value> = pins.iter().map(|agent| json!({"agent": agent, "weight": 1})).collect();
    json!([{"name": "mine", "edges": edges, "pins": pins}])
}

const PATH: [(u32, u32); 6] = [(1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7)];

#[test]
fn graphs_are_checked() {
    assert!(case1_with("communication.graphs", graph(&PATH, &[1])).is_ok());
    let mut beyond = PATH;
    beyond[5] = (6, 8);
    says(
        case1_with("communication.graphs", graph(&beyond, &[1])),
        &["communication.graphs[0].edges[5].b", "found 8", "7"],
    );
    says(
        case1_with("communication.graphs", graph(&PATH[..5], &[1])),
        &["communication.graphs[0]", "connected"],
    );
    says(case1_with("communication.graphs", graph(&PATH, &[])), &["communication.graphs[0]", "pin"]);
    says(
        case1_with("communication.graphs", graph(&PATH, &[9])),
        &["communication.graphs[0].pins[0].agent", "found 9"],
    );
    let mut weight = graph(&PATH, &[1]);
    weight[0]["edges"][2]["weight"] = json!(-1);
    says(
        case1_with("communication.graphs", weight),
        &["communication.graphs[0].edges[2].weight", "found -1"],
    );
}

#[test]
fn the_frame_is_checked() {
    says(case1_with("step_s", json!(0)), &["step_s", "found 0"]);
    says(case1_with("stop_s", json!(-1)), &["stop_s", "found -1"]);
    says(case1_with("record_every", json!(0)), &["record_every"]);
    says(case1_with("name", json!("../x")), &["name", "../x"]);
    says(case1_with("bess[0].soc_start", json!(1.5)), &["bess[0].soc_start", "found 1.5"]);
    says(case1_with("bess[0].bus", json!(58)), &["bess[0].bus", "58"]);
    says(case1_with("grid.case", json!("case58")), &["grid.case", "case58", "case57"]);
    says(case1_with("grid.tie.X", json!(0)), &["grid.tie.X", "found 0"]);
    says(case1_with("events[0].at_s", json!(-1)), &["events[0].at_s", "found -1"]);
    says(
        case1_with("events[0].set", json!({"controller.enable": "yes"})),
        &["events[0].set.controller.enable", "yes"],
    );
    says(case1_with("bess[7].bus", json!(1)), &["bess[7].bus", "index `7`", "0 to 6"]);
}

#[test]
fn a_scenario_that_does_not_exist_names_the_built_in_ones() {
    let error = Resolved::load("case7", &Map::new()).map(|_| ()).expect_err("there is none");
    assert!(error.to_string().contains("case7"));
    assert!(error.help().contains("case1"));
}

#[test]
fn the_published_schema_is_fresh() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/schema/scenario.schema.json");
    let published = std::fs::read_to_string(file).unwrap_or_default();
    assert!(
        published == scenario::schema(),
        "schema/scenario.schema.json is stale: write it with `cargo run --release -- schema > schema/scenario.schema.json`"
    );
}

#[test]
fn a_scenario_written_out_and_read_again_resolves_to_the_same() {
    let (source, read) = scenario::Scenario::load("case1").unwrap();
    let again = Source { text: serde_json::to_string(&read).unwrap(), ..source.clone() };
    let (first, second) =
        (Resolved::of(&source, &Map::new()).unwrap(), Resolved::of(&again, &Map::new()).unwrap());
    assert_eq!(first.control, second.control);
    assert_eq!(first.grid, second.grid);
}

#[test]
fn a_scenario_extends_another_and_says_where_it_is_wrong() {
    let of = |text: &str| document(text.to_owned());
    let resolved =
        of(r#"{"extends": "case1", "name": "mine", "control": {"gains": {"E": 0}}, "compare": null}"#)
            .unwrap();
    assert_eq!(
        (resolved.control.agents(), resolved.control.gains.E, resolved.control.gains.P),
        (7, 0.0, 1.0)
    );
    assert!(resolved.scenario.compare.is_empty() && resolved.scenario.extends.is_none());
    says(of("{\"extends\": \"case1\",\n \"control\": {\"etta\": 1}}"), &["control", "etta", "line 2"]);
    says(of("{\"extends\": \"case1\",\n \"stop_s\": \"long\"}"), &["stop_s", "line 2"]);
    says(of(r#"{"extends": "case7"}"#), &["case7", "no such scenario"]);
    says(case1_with("extends", json!("case2")), &["extends", "case2", "in a document"]);
}

#[test]
fn files_that_a_base_names_are_those_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let base = folder.path().join("base");
    std::fs::create_dir(&base).unwrap();
    let text = r#"{"extends": "case1", "name": "a", "grid": {"fmu": "G.fmu"}, "control": {"fmu": "C.fmu"}, "compare": [
        {"label": "a key", "set": {"grid.fmu": "H.fmu", "control.eta": 0.3}},
        {"label": "a part", "set": {"control": {"fmu": "D.fmu"}}}
    ]}"#;
    std::fs::write(base.join("a.json"), text).unwrap();
    // A built-in name is the built-in scenario, whatever lies beside.
    std::fs::write(base.join("case1"), "{}").unwrap();
    let own = folder.path().join("b.json");
    std::fs::write(&own, r#"{"extends": "base/a.json", "control": {"fmu": "Own.fmu"}}"#).unwrap();
    let resolved = Resolved::load(&own.to_string_lossy(), &Map::new()).unwrap();
    assert_eq!(resolved.grid_fmu(), Some(base.join("G.fmu")));
    assert_eq!(resolved.controller_fmu(), Some(folder.path().join("Own.fmu")));
    let [key, part] = &resolved.scenario.compare[..] else { panic!("{:?}", resolved.scenario.compare) };
    let expected = json!({"grid.fmu": base.join("H.fmu"), "control.eta": 0.3});
    assert_eq!(json!(key.set), expected);
    assert_eq!(json!(part.set), json!({"control": {"fmu": base.join("D.fmu")}}));
}

#[test]
fn scenarios_that_extend_each_other_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, base: &str| {
        let file = folder.path().join(name);
        std::fs::write(&file, format!("{{\"extends\": \"{base}\"}}")).unwrap();
        file
    };
    let a = write("a.json", "b.json");
    write("b.json", "a.json");
    let error = Resolved::load(&a.to_string_lossy(), &Map::new()).map_err(|e| e.to_string());
    says(error, &["b.json: extends: found a circle", "a.json extends", "does not come back"]);
}

#[test]
fn every_built_in_scenario_resolves_with_its_variants() {
    for (name, _) in scenario::BUILT_IN {
        let resolved = Resolved::load(name, &Map::new()).map_err(|e| e.to_string()).unwrap();
        assert_eq!(resolved.scenario.name, name);
        for variant in &resolved.scenario.compare {
            Resolved::of(&resolved.source, &variant.set).map_err(|e| format!("{name}: {e}")).unwrap();
        }
        for trial in &resolved.scenario.trials {
            Resolved::of(&resolved.source, &trial.set).map_err(|e| format!("{name}: {e}")).unwrap();
        }
    }
}

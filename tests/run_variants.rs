//! A variant under `compare` is judged by its own batteries and events: its figures are those of a run of its own.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used)]

use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

fn summary(folder: &Path, set: &[String]) -> Value {
    let mut bess = Command::new(env!("CARGO_BIN_EXE_bess"));
    bess.args(["run", "case1", "--quiet", "-o", "out"]).current_dir(folder);
    let output = bess.args(set.iter().flat_map(|set| ["--set", set])).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&std::fs::read(folder.join("out/summary.json")).unwrap()).unwrap()
}

#[test]
fn a_variant_has_the_figures_of_a_run_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let events = json!([
        { "at_s": 1.0, "label": "on", "set": { "controller.enable": true } },
        { "at_s": 4.0, "label": "load", "set": { "grid.dP_load[12]": 0.3 } },
    ]);
    let variant = [("bess[1].K_P", json!(0.008)), ("bess[4].K_Q", json!(0.04)), ("events", events)];
    let stop = "stop_s=8".to_owned();
    let mut alone = vec![stop.clone(), "compare=[]".to_owned()];
    alone.extend(variant.iter().map(|(key, value)| format!("{key}={value}")));
    let set: serde_json::Map<String, Value> =
        variant.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
    let compare = json!([{ "label": "otherwise", "set": set }]);
    let beside = summary(folder.path(), &[stop, format!("compare={compare}")]);
    let alone = summary(folder.path(), &alone);
    assert_eq!(alone["phases"].as_array().unwrap().len(), 3);
    assert_eq!(beside["variants"][0]["phases"], alone["phases"]);
}

//! The grid model against trajectories of an independent solver, at every sample, 1e-6.
#![cfg(feature = "grid")]
#![allow(
    non_snake_case,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests: the paper's letters; a failure may panic"
)]

use bess_consensus::grid::{Bess, CaseSource, Config, GridModel, Tie};
use serde_json::Value;

const TOLERANCE: f64 = 1e-6;
const MS: i64 = 1_000_000;

fn reference(name: &str) -> Value {
    let path = format!("{}/../shared/reference/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn config(reference: &Value) -> Config {
    let (grid, start) = (&reference["grid"], &reference["start"]);
    let (K_P, K_Q) = (numbers(&grid["K_P"]), numbers(&grid["K_Q"]));
    let (omega, V, E) = (numbers(&start["omega_set"]), numbers(&start["V_set"]), numbers(&start["E"]));
    let bess = grid["bess_bus"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
        .map(|(i, bus)| Bess {
            bus: bus.as_u64().unwrap(),
            K_P: K_P[i],
            K_Q: K_Q[i],
            X_c: grid["X_c"].as_f64().unwrap(),
            E_start: E[i],
            omega_set_start: omega[i],
            V_set_start: V[i],
        })
        .collect();
    let tie: Option<Tie> = serde_json::from_value(grid["tie"].clone()).unwrap();
    Config {
        case: CaseSource::BuiltIn("case57".into()),
        bess,
        omega_c: grid["omega_c"].as_f64().unwrap(),
        f_nominal_hz: grid["f_nominal_hz"].as_f64().unwrap(),
        tie,
        tie_closed_start: start["tie_closed"].as_bool().unwrap(),
        ..Config::case57()
    }
}

/// Applies what the schedule sets at this time; load entries are changes, everything else is a value.
fn apply(model: &mut GridModel, reference: &Value, t_ns: i64) {
    for event in reference["schedule"].as_array().unwrap() {
        if (event["at"].as_f64().unwrap() * 1e9).round() as i64 != t_ns {
            continue;
        }
        let inputs = model.inputs_mut();
        for (name, value) in event["set"].as_object().unwrap() {
            if name == "tie_closed" {
                inputs.tie_closed = value.as_bool().unwrap();
                continue;
            }
            let (quantity, index) = name.trim_end_matches(']').split_once('[').unwrap();
            let (index, value) = (index.parse::<usize>().unwrap() - 1, value.as_f64().unwrap());
            match quantity {
                "omega_set" => inputs.omega_set[index] = value,
                "V_set" => inputs.V_set[index] = value,
                "P_set" => inputs.P_set[index] = value,
                "Q_set" => inputs.Q_set[index] = value,
                "dP_load" => inputs.dP_load[index] += value,
                "dQ_load" => inputs.dQ_load[index] += value,
                _ => panic!("unknown input {name}"),
            }
        }
        model.refresh().unwrap();
    }
}

/// The largest deviation over all samples and quantities.
fn deviation(name: &str, communication_ns: i64, change: impl Fn(&mut Config)) -> f64 {
    let reference = reference(name);
    let mut config = config(&reference);
    change(&mut config);
    let mut model = GridModel::new(&config).unwrap();
    model.initialise().unwrap();
    let mut worst = 0.0;
    let mut t_ns = 0;
    for sample in reference["samples"].as_array().unwrap() {
        let at = (sample["t"].as_f64().unwrap() * 1e9).round() as i64;
        while t_ns < at {
            model.step(t_ns, communication_ns).unwrap();
            t_ns += communication_ns;
            apply(&mut model, &reference, t_ns);
        }
        assert_eq!(t_ns, at);
        type Read = fn(&GridModel, usize) -> f64;
        let quantities: [(&str, Read); 5] = [
            ("P", GridModel::P),
            ("Q", GridModel::Q),
            ("V", GridModel::V),
            ("omega", GridModel::omega),
            ("E", GridModel::E),
        ];
        for (quantity, read) in quantities {
            for (i, expected) in numbers(&sample[quantity]).into_iter().enumerate() {
                let difference = (read(&model, i) - expected).abs();
                assert!(
                    difference < TOLERANCE,
                    "{name}, t = {}: {quantity}[{}] is {}, expected {expected}, off by {difference:.2e}",
                    sample["t"],
                    i + 1,
                    read(&model, i)
                );
                worst = f64::max(worst, difference);
            }
        }
    }
    println!("{name}, {} ms: largest deviation {worst:.2e}", communication_ns / MS);
    worst
}

#[test]
fn islanded_with_load_and_setpoint_steps() {
    deviation("grid_islanded", 10 * MS, |_| ());
    deviation("grid_islanded", 100 * MS, |_| ());
}

#[test]
fn tie_closing_and_opening() {
    deviation("grid_tie", 10 * MS, |_| ());
    deviation("grid_tie", 100 * MS, |_| ());
}

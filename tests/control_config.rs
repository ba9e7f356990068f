//! Every problem of a configuration is named with path, found and expected; good ones survive JSON.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::communication::{
    Communication, Inside, StepByStep, StepByStepTopology, Weights,
};
use bess_consensus::control::{Config, Controller};
use control_support::*;

fn path() -> Config {
    Config::unit(4, explicit((0..3).map(|i| edge(i, i + 1, 1.0)).collect(), vec![pin(0, 1.0)]))
}

fn topology(config: &mut Config) -> &mut bess_consensus::control::communication::ExplicitTopology {
    match &mut config.communication {
        Communication::Explicit(explicit) => &mut explicit.topologies[0],
        Communication::StepByStep(_) => unreachable!(),
    }
}

type Change = fn(&mut Config);

#[test]
fn every_problem_is_named() {
    let graph = "communication.explicit.topologies[0]";
    let cases: [(Change, &str, &str); 22] = [
        (|c| c.K_P[2] = 0.0, "K_P[2]", "0"),
        (|c| c.K_Q[0] = f64::NAN, "K_Q[0]", "NaN"),
        (|c| c.capacity[1] = -1.0, "capacity[1]", "-1"),
        (|c| c.P_exchange_max[3] = f64::INFINITY, "P_exchange_max[3]", "inf"),
        (|c| c.V_set_start.truncate(2), "V_set_start", "2 values"),
        (|c| c.eta = 0.0, "eta", "0"),
        (|c| c.eta = -0.1, "eta", "-0.1"),
        (|c| c.eta = 1.1, "eta", "1.1"),
        (|c| c.delay_s = -0.5, "delay_s", "-0.5"),
        (|c| c.gains.Q = -1.0, "gains.Q", "-1"),
        (|c| c.channel.loss = 1.0, "channel.loss", "1"),
        (|c| c.limits.P_max = Some(vec![f64::NAN; 4]), "limits.P_max[0]", "NaN"),
        (|c| c.limits.V_set_range = Some([1.1, 0.9]), "limits.V_set_range", "[1.1, 0.9]"),
        (|c| topology(c).edges[1].b = 9, "edges[1].b", "9"),
        (|c| topology(c).edges[1].b = 0, "edges[1].b", "0"),
        (|c| topology(c).edges[2].a = 4, "edges[2]", "an edge from agent 4 to agent 4"),
        (|c| topology(c).edges[0].delay_s = Some(-1.0), "edges[0].delay_s", "-1"),
        (|c| topology(c).edges[0].weight = 0.0, "edges[0].weight", "0"),
        (|c| topology(c).edges.truncate(2), "edges", "2 parts; no path from agent 1 to agent 4"),
        (|c| topology(c).pins.clear(), "pins", "no pin in the part of agent 1"),
        (|c| topology(c).pins.push(pin(0, 1.0)), "pins[1].agent", "agent 1 again"),
        (|c| topology(c).edges.push(edge(2, 1, 1.0)), "edges[3]", "agents 2 and 3 again, as in edges[1]"),
    ];
    path().validate().unwrap();
    for (change, at, found) in cases {
        let mut config = path();
        change(&mut config);
        let error = config.validate().unwrap_err();
        let there = |p: &str| p == at || p == format!("{graph}.{at}");
        assert!(error.problems.iter().any(|p| there(&p.path) && p.found == found), "{at}: {error}");
        assert!(Controller::new(config).is_err());
    }
    let mut config = path();
    config.eta = 2.0;
    config.K_P[1] = -3.0;
    assert_eq!(config.validate().unwrap_err().problems.len(), 2, "all problems at once");
}

#[test]
fn distances_must_be_distances() {
    let square = |d: f64| vec![vec![0.0, 1.0, d], vec![1.0, 0.0, 1.0], vec![2.0, 1.0, 0.0]];
    for (distances, at) in [
        (square(2.0), None),
        (square(3.0), Some("distances[2][0]")),
        (square(0.0), Some("distances[0][2]")),
        (square(f64::INFINITY), Some("distances[0][2]")),
        (vec![vec![0.0; 3]; 2], Some("distances")),
    ] {
        let topologies = vec![StepByStepTopology { name: "a3".into(), inside: Inside::Tree }];
        let communication = StepByStep { distances, weights: Weights::InverseDistance, topologies };
        let result = Config::unit(3, Communication::StepByStep(communication)).validate();
        match at {
            None => result.unwrap(),
            Some(at) => {
                let at = format!("communication.step_by_step.{at}");
                let error = result.unwrap_err();
                assert!(error.problems.iter().any(|p| p.path == at), "{error}");
            }
        }
    }
}

#[test]
fn json_is_read_and_written() {
    let json = r#"{
        "K_P": [0.004, 0.0048], "K_Q": [0.02, 0.0242], "capacity": [125, 104], "P_exchange_max": [1, 1],
        "omega_set_start": [1, 1], "V_set_start": [1.02, 1.02], "delay_s": 0.5,
        "law": {"fixed_time": {"alpha": 1, "beta": 2}}, "voltage_policy": "average",
        "communication": {"step_by_step": {
            "distances": [[0, 2], [2, 0]], "weights": "distance",
            "topologies": [{"name": "a3", "inside": "tree"}, {"name": "b3", "inside": "ring"}]}}
    }"#;
    let config: Config = serde_json::from_str(json).unwrap();
    config.validate().unwrap();
    assert_eq!((config.eta, config.gains.E, config.theta_E_s), (0.5, 0.005, 1.0));
    let again: Config = serde_json::from_str(&serde_json::to_string(&config).unwrap()).unwrap();
    assert_eq!(config, again);
    let misspelt = json.replace("\"delay_s\"", "\"delay\"");
    let error = serde_json::from_str::<Config>(&misspelt).unwrap_err().to_string();
    assert!(error.contains("unknown field `delay`"), "{error}");
    let path = path();
    let again: Config = serde_json::from_str(&serde_json::to_string(&path).unwrap()).unwrap();
    assert_eq!(path, again);
}

//! Faults of measurements on the wire: what reaches the controller, what NaN does, rollback, and mistakes in the names.
#![cfg(feature = "host")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod case_support;

use bess_consensus::harness::{CONTROLLER, Cast, Causality, Participant, Silent, run, stage};
use bess_consensus::scenario::Resolved;
use case_support::*;

const STEP_NS: i64 = 10_000_000;

fn controller(faults: &str) -> Box<dyn Participant> {
    let events = r#"[{"at_s": 0, "set": {"controller.enable": true}}]"#;
    let resolved = Resolved::load("case1", &keys(&[("faults", faults), ("events", events)])).unwrap();
    let (mut participants, _) = stage(&resolved, &Cast::default()).unwrap();
    participants.swap_remove(0)
}

fn reference(participant: &dyn Participant, name: &str) -> u32 {
    participant.variables().iter().find(|v| v.name == name).unwrap_or_else(|| panic!("no {name}")).reference
}

fn ready(mut participant: Box<dyn Participant>) -> Box<dyn Participant> {
    let enable = reference(participant.as_ref(), "enable");
    participant.setup(0, None).unwrap();
    participant.enter_initialization().unwrap();
    participant.set_boolean(&[enable], &[1]).unwrap();
    participant.exit_initialization().unwrap();
    participant
}

fn input(participant: &mut dyn Participant, name: &str) -> f64 {
    let mut found = [0.0];
    participant.get_real(&[reference(participant, name)], &mut found).unwrap();
    found[0]
}

fn is_available(participant: &mut dyn Participant, agent: usize) -> bool {
    let mut found = [0];
    let name = format!("available[{agent}]");
    participant.get_boolean(&[reference(participant, &name)], &mut found).unwrap();
    found[0] != 0
}

/// Sets P[3] at each step and tells what the controller got.
fn course(participant: &mut dyn Participant, from: i64, steps: i64) -> Vec<f64> {
    let P = reference(participant, "P[3]");
    let mut seen = Vec::new();
    for k in from..from + steps {
        participant.set_real(&[P], &[1.0 + 0.001 * k as f64]).unwrap();
        seen.push(input(participant, "P[3]"));
        participant.do_step(k * STEP_NS, STEP_NS).unwrap();
    }
    seen
}

#[test]
fn the_controller_gets_what_the_fault_makes_of_a_measurement() {
    let stuck = r#"[{"kind": "stuck", "signal": "P[3]", "from_s": 0.02, "until_s": 0.04}]"#;
    assert_eq!(course(ready(controller(stuck)).as_mut(), 0, 5), [1.0, 1.001, 1.001, 1.001, 1.004]);
    let value =
        r#"[{"kind": "stuck", "signal": "controller.P[3]", "from_s": 0.02, "until_s": 0.04, "value": -2}]"#;
    assert_eq!(course(ready(controller(value)).as_mut(), 0, 5), [1.0, 1.001, -2.0, -2.0, 1.004]);
    let steps = r#"[{"kind": "quantisation", "signal": "P[{i}]", "step": 0.25}]"#;
    assert_eq!(course(ready(controller(steps)).as_mut(), 0, 2), [1.0, 1.0]);
    let noise = r#"[{"kind": "noise", "signal": "P[3]", "deviation": 0.1, "seed": 4}]"#;
    let (first, again) =
        (course(ready(controller(noise)).as_mut(), 0, 50), course(ready(controller(noise)).as_mut(), 0, 50));
    assert_eq!(first, again, "one seed, one course");
    let off: f64 = first.iter().enumerate().map(|(k, x)| (x - 1.0 - 0.001 * k as f64).powi(2)).sum();
    // A chi-square of 50 degrees lies between 20 and 100 but for one in 30000.
    assert!((20.0..100.0).contains(&(off / 0.01)), "{off}");
}

#[test]
fn nan_takes_the_agent_out_and_gives_it_back() {
    let mut participant = ready(controller("[]"));
    let P = reference(participant.as_ref(), "P[3]");
    let available = reference(participant.as_ref(), "available[3]");
    course(participant.as_mut(), 0, 3);
    for bad in [f64::NAN, f64::INFINITY] {
        participant.set_real(&[P], &[bad]).unwrap();
        assert!(!is_available(participant.as_mut(), 3));
        assert_eq!(input(participant.as_mut(), "P[3]"), 1.002, "the last good value stays");
        participant.set_real(&[P], &[1.002]).unwrap();
        assert!(is_available(participant.as_mut(), 3));
    }
    // What the plan wants meanwhile counts afterwards.
    participant.set_real(&[P], &[f64::NAN]).unwrap();
    participant.set_boolean(&[available], &[1]).unwrap();
    assert!(!is_available(participant.as_mut(), 3));
    participant.set_boolean(&[available], &[0]).unwrap();
    participant.set_real(&[P], &[1.0]).unwrap();
    assert!(!is_available(participant.as_mut(), 3), "it was told to leave");
    let warnings = participant.take_warnings();
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert!(
        warnings[0].contains("controller.P[3] was not a finite number from 0.03 s to 0.03 s"),
        "{warnings:?}"
    );
}

#[test]
fn a_run_goes_on_through_nan_and_the_agent_holds() {
    let fault = r#"[{"kind": "nan", "signal": "P[5]", "from_s": 30, "until_s": 40}]"#;
    let set = keys(&[("faults", fault), ("stop_s", "45")]);
    let resolved = Resolved::load("case1", &set).unwrap();
    let (mut participants, plan) = stage(&resolved, &Cast::default()).unwrap();
    let outcome = run(&mut participants, &plan, &mut Silent).unwrap();
    assert_eq!(outcome.warnings.len(), 1, "{:?}", outcome.warnings);
    assert!(outcome.warnings[0].contains("from 30.0 s to 40.0 s; agent 5 was out"), "{:?}", outcome.warnings);
    let run = scenario("case1", &[("faults", fault), ("stop_s", "45")]);
    let omega_set = run.of_controller("omega_set");
    let out = run.between(30.01, 40.0);
    for i in 0..N {
        let holds = out.clone().all(|k| omega_set[i][k] == omega_set[i][out.start]);
        assert_eq!(holds, i == 4, "agent {}", i + 1);
    }
}

#[test]
fn a_rollback_brings_faults_back_too_in_another_process_as_well() {
    let faults = r#"[
        {"kind": "noise", "signal": "P[{i}]", "deviation": 0.1, "seed": 4},
        {"kind": "stuck", "signal": "P[3]", "from_s": 0.05, "until_s": 0.2},
        {"kind": "nan", "signal": "P[6]", "from_s": 0.04, "until_s": 0.3},
        {"kind": "drift", "signal": "omega[2]", "from_s": 0.02, "rate_per_s": 0.001}]"#;
    let outputs = |participant: &mut dyn Participant| {
        let variables = participant.variables().iter();
        let reals = variables.filter(|v| v.causality == Causality::Output && v.start.is_none());
        let references: Vec<u32> = reals
            .filter(|v| v.name.contains("_set[") || v.name.starts_with("u_"))
            .map(|v| v.reference)
            .collect();
        let mut values = vec![0.0; references.len()];
        participant.get_real(&references, &mut values).unwrap();
        values
    };
    // P[6] is set once: its fault comes and goes without anything new being set.
    let start = |mut participant: Box<dyn Participant>| {
        let P6 = reference(participant.as_ref(), "P[6]");
        participant.set_real(&[P6], &[1.5]).unwrap();
        participant
    };
    let mut first = start(ready(controller(faults)));
    course(first.as_mut(), 0, 10);
    let state = first.save_state().unwrap();
    let bytes = first.serialise_state(state).unwrap();
    let seen = course(first.as_mut(), 10, 30);
    let end = outputs(first.as_mut());
    assert!(is_available(first.as_mut(), 6), "back after 0.3 s");

    first.restore_state(state).unwrap();
    assert!(!is_available(first.as_mut(), 6));
    assert_eq!(course(first.as_mut(), 10, 30), seen);
    assert_eq!(outputs(first.as_mut()), end);

    let mut other = ready(controller(faults));
    let state = other.deserialise_state(&bytes).unwrap();
    other.restore_state(state).unwrap();
    assert_eq!(course(other.as_mut(), 10, 30), seen);
    assert_eq!(outputs(other.as_mut()), end);
    assert!(other.deserialise_state(&bytes[..7]).is_err());
    assert!(ready(controller("[]")).deserialise_state(&bytes).is_err(), "another run");
}

#[test]
fn mistakes_in_faults_are_told_with_their_place() {
    for (fault, parts) in [
        (r#"{"kind": "drift", "signal": "P[3]"}"#, ["faults[0].rate_per_s", "nothing"]),
        (r#"{"kind": "nan", "signal": "P[3]", "value": 3}"#, ["faults[0].value", "\"stuck\""]),
        (r#"{"kind": "freeze", "signal": "P[3]"}"#, ["faults[0].signal", "agent[3]"]),
        (r#"{"kind": "stuck", "signal": "agent[3]"}"#, ["faults[0].signal", "\"freeze\""]),
        (r#"{"kind": "nan", "signal": "grid.V_set[3]"}"#, ["faults[0].signal", "measurement"]),
        (r#"{"kind": "nan", "signal": "gird.V_set[3]"}"#, ["faults[0].signal", "grid.NAME"]),
        (r#"{"kind": "nan", "signal": "messages[8]"}"#, ["agent 8", "1 to 7"]),
        (
            r#"{"kind": "drift", "signal": "messages[3]", "rate_per_s": 1}"#,
            ["faults[0].signal", "messages.omega[3]"],
        ),
        (r#"{"kind": "nan", "signal": "P[3]", "from_s": 5, "until_s": 4}"#, ["faults[0].until_s", "5"]),
        (r#"{"kind": "noise", "signal": "P[3]", "deviation": -1}"#, ["faults[0].deviation", "-1"]),
        (r#"{"kind": "broken", "signal": "P[3]"}"#, ["faults[0].kind", "stuck"]),
    ] {
        let set = keys(&[("faults", &format!("[{fault}]"))]);
        let error = Resolved::load("case1", &set).map(|_| ()).unwrap_err().to_string();
        for part in parts {
            assert!(error.contains(part), "{fault}: {error} does not say {part}");
        }
    }
    for (signal, part) in [("p[3]", "P[3]"), ("omega_reff", "omega_ref"), ("topology", "Real")] {
        let fault = format!(r#"[{{"kind": "nan", "signal": "{signal}"}}]"#);
        let resolved = Resolved::load("case1", &keys(&[("faults", &fault)])).unwrap();
        let error = stage(&resolved, &Cast::default()).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("faults[0]") && error.contains(part), "{error}");
        assert!(error.contains(CONTROLLER), "{error}");
    }
}

//! Directional derivatives of the controller against central differences, at scattered points of all built-in
//! scenarios and of what they leave out.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail")]

mod derivative_support;

use bess_consensus::fmi::{Instance, Interface};
use bess_consensus::models::Controller;
use derivative_support::*;

/// Typical sizes of the groups of inputs and parameters, by which differences are scaled.
const SCALES: [(&str, f64); 17] = [
    ("P", 0.5),
    ("Q", 0.2),
    ("V", 0.01),
    ("omega", 1e-3),
    ("E", 0.3),
    ("omega_ref", 1e-3),
    ("V_ref", 0.01),
    ("P_ref", 1e-3),
    ("eta", 0.2),
    ("gain_omega", 0.5),
    ("gain_P", 0.5),
    ("gain_E", 1e-3),
    ("gain_V", 0.5),
    ("gain_Q", 0.5),
    ("delay", 0.01),
    ("theta_min", 0.01),
    ("theta_E", 0.1),
];

/// Inputs scattered about an operating point, off consensus.
fn scatter(instance: &mut Instance<Controller>, scatter: &mut Scatter) {
    for (group, centre, width) in [
        ("P", 2.0, 1.5),
        ("Q", 0.5, 0.8),
        ("V", 1.0, 0.02),
        ("omega", 1.0, 2e-3),
        ("omega_ref", 1.0, 1e-3),
        ("V_ref", 1.0, 1e-2),
        ("P_ref", 8e-3, 2e-3),
    ] {
        let references = references(instance, &[group]);
        let values: Vec<f64> = references.iter().map(|_| centre + width * scatter.next()).collect();
        instance.set_real(&references, &values).unwrap();
    }
    let (energy, capacity) = (references(instance, &["E"]), references(instance, &["capacity"]));
    let capacity = read(instance, &capacity);
    let values: Vec<f64> = capacity.iter().map(|capacity| capacity * (0.6 + 0.2 * scatter.next())).collect();
    instance.set_real(&energy, &values).unwrap();
}

/// A controller that has made `steps` steps of scattered length with scattered inputs.
fn at_some_point(name: &str, set: &[(&str, &str)], seed: u64) -> Instance<Controller> {
    let mut instance = controller(name, set, Interface::Structured);
    let mut random = Scatter(seed);
    instance.setup_experiment(0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    let enable = references(&instance, &["enable"]);
    instance.set_boolean(&enable, &[true]).unwrap();
    instance.exit_initialization_mode().unwrap();
    let mut now_ns = 0_i64;
    for _ in 0..60 {
        scatter(&mut instance, &mut random);
        let step_ns = 7_000_000 + (6e6 * random.next()) as i64;
        instance.do_step(now_ns as f64 / 1e9, step_ns as f64 / 1e9).unwrap();
        now_ns = instance.time_ns();
    }
    scatter(&mut instance, &mut random);
    instance
}

/// The first value of a group.
fn value(instance: &mut Instance<Controller>, group: &str) -> f64 {
    let references = references(instance, &[group]);
    read(instance, &references)[0]
}

fn check(name: &str, set: &[(&str, &str)], dispatch: bool) {
    let (mut judged, mut all) = (0, 0);
    for seed in [1, 2] {
        let mut instance = at_some_point(name, set, seed);
        let switch = references(&instance, &["dispatch"]);
        instance.set_boolean(&switch, &[dispatch]).unwrap();
        let (mut knowns, mut scales) = (Vec::new(), Vec::new());
        let eta = value(&mut instance, "eta");
        for (group, scale) in SCALES {
            // Only what can be moved both ways.
            let value = value(&mut instance, group);
            let scale = if group == "eta" { scale.min(eta).min(1.0 - eta) } else { scale };
            let parameter = tunables(&instance).contains(&references(&instance, &[group])[0]);
            if parameter && (value < 0.04 * scale || scale == 0.0) {
                continue;
            }
            for reference in references(&instance, &[group]) {
                knowns.push(reference);
                scales.push(scale);
            }
        }
        let (found, of) = compare(&mut instance, &knowns, &scales, &format!("{name} {set:?} {seed}"));
        (judged, all) = (judged + found, all + of);
    }
    println!("{name} {set:?}: {judged} of {all} derivatives have a difference to compare with");
    assert!(judged as f64 > 0.97 * all as f64, "{name} {set:?}: only {judged} of {all}");
}

#[test]
fn built_in_scenarios() {
    for name in ["case1", "case2", "case3", "case4", "plug_and_play", "voltage", "energy", "faults"] {
        check(name, &[], name == "case2");
    }
}

#[test]
fn exponents_from_0_1_to_1_and_the_fixed_time_law() {
    for eta in ["0.1", "0.3", "0.7", "0.9", "1"] {
        check("case1", &[("control.eta", eta)], false);
    }
    check("case3", &[("control.law", r#"{ "fixed_time": { "alpha": 1, "beta": 100 } }"#)], true);
    check("case1", &[("control.discretisation", "\"explicit\"")], false);
}

#[test]
fn delays_policies_filters_and_limits() {
    check("case1", &[("control.delay_s", "0.0537"), ("control.theta_min_s", "0.021")], false);
    check("voltage", &[("control.delay_s", "0.0231")], false);
    check("case4", &[("control.channel", r#"{ "jitter_s": 0.02, "loss": 0.2, "seed": 1 }"#)], false);
    check(
        "case1",
        &[(
            "control.measurement_filter",
            r#"{ "omega_s": 0.05, "P_s": 0.1, "V_s": 0.02, "Q_s": 0.1, "E_s": 1 }"#,
        )],
        false,
    );
    // The points lie 0.6 s after the start.
    let faults = r#"[{ "kind": "stuck", "signal": "messages.P[2]", "value": 0.006 },
        { "kind": "drift", "signal": "messages.omega[6]", "rate_per_s": 1e-4 },
        { "kind": "stuck", "signal": "messages.V[6]", "from_s": 0.2 },
        { "kind": "freeze", "signal": "agent[3]", "from_s": 0.3 }]"#;
    check("case1", &[("faults", faults)], false);
    check(
        "case1",
        &[("faults", faults), ("control.silence_s", "0.1"), ("control.outlier_filter", "1")],
        false,
    );
    // Each limit of every battery, where the scattered points lie on both sides of it.
    let mut limits = vec![("control.soc_limits".to_owned(), r#"{ "min": 0.3, "max": 0.9, "taper": 0.4 }"#)];
    for i in 0..7 {
        for (key, value) in [
            ("P_max", "2.2"),
            ("Q_max", "0.9"),
            ("S_max", "2.5"),
            ("P_set_rate", "0.1"),
            ("omega_set_rate", "0.05"),
        ] {
            limits.push((format!("bess[{i}].{key}"), value));
        }
    }
    let limits: Vec<(&str, &str)> = limits.iter().map(|(key, value)| (key.as_str(), *value)).collect();
    check("case1", &limits, true);
}

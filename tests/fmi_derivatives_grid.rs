//! Directional derivatives of the grid against central differences: in step mode with the states held, in
//! initialization mode through the steady state; all load models, both network methods, island and tie.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail")]

mod derivative_support;

use bess_consensus::fmi::{Instance, Interface};
use bess_consensus::models::Grid;
use derivative_support::*;

const SCALES: [(&str, f64); 6] = [
    ("omega_set", 1e-3),
    ("V_set", 0.01),
    ("P_set", 0.3),
    ("Q_set", 0.3),
    ("dP_load", 0.3),
    ("dQ_load", 0.3),
];

/// Every setpoint, and the loads at some buses.
fn knowns(instance: &Instance<Grid>) -> (Vec<u32>, Vec<f64>) {
    let (mut knowns, mut scales) = (Vec::new(), Vec::new());
    for (group, scale) in SCALES {
        let stride = if group.ends_with("_load") { 11 } else { 1 };
        for reference in references(instance, &[group]).into_iter().step_by(stride) {
            knowns.push(reference);
            scales.push(scale);
        }
    }
    (knowns, scales)
}

/// On the main grid the batteries keep to 1 pu: setpoints above it are the power they give.
fn scatter(instance: &mut Instance<Grid>, random: &mut Scatter, tie: bool) {
    for (group, centre, width) in [
        ("omega_set", if tie { 1.006 } else { 1.012 }, 1e-3),
        ("V_set", 1.02, 0.01),
        ("P_set", 0.0, 0.3),
        ("Q_set", 0.0, 0.2),
        ("dP_load", 0.0, 0.02),
        ("dQ_load", 0.0, 0.02),
    ] {
        let references = references(instance, &[group]);
        let values: Vec<f64> = references.iter().map(|_| centre + width * random.next()).collect();
        instance.set_real(&references, &values).unwrap();
    }
}

/// Scenario, changed keys, whether the tie is closed.
type Case = (&'static str, &'static [(&'static str, &'static str)], bool);

const CASES: [Case; 6] = [
    ("case1", &[], false),
    ("case1", &[("grid.network", "\"sparse\"")], true),
    ("case1", &[("grid.load_model", "\"constant_power\"")], false),
    ("case2", &[("grid.load_model", r#"{ "zip": { "Z": 0.3, "I": 0.3, "P": 0.4 } }"#)], true),
    ("case2", &[("grid.load_model", "\"constant_power\""), ("grid.network", "\"sparse\"")], true),
    ("voltage", &[], true),
];

#[test]
fn with_the_states_held() {
    for (name, set, tie) in CASES {
        let mut instance = grid(name, set, Interface::Structured);
        let mut random = Scatter(7);
        scatter(&mut instance, &mut random, tie);
        instance.enter_initialization_mode().unwrap();
        let breaker = references(&instance, &["tie_closed"]);
        instance.set_boolean(&breaker, &[tie]).unwrap();
        instance.exit_initialization_mode().unwrap();
        for k in 0..20 {
            scatter(&mut instance, &mut random, tie);
            instance.do_step(f64::from(k) * 0.01, 0.01).unwrap();
        }
        let (knowns, scales) = knowns(&instance);
        let (judged, all) = compare(&mut instance, &knowns, &scales, &format!("{name} {set:?} tie {tie}"));
        println!("{name} {set:?} tie {tie}: {judged} of {all}");
        assert!(judged as f64 > 0.97 * all as f64, "{name} {set:?}: {judged} of {all}");
    }
}

/// Loads that are not impedances are looked for; what is no number is not found.
#[test]
fn a_direction_beyond_all_numbers_is_refused() {
    for (name, set, tie) in
        CASES.into_iter().filter(|(_, set, _)| set.iter().any(|(key, _)| key.ends_with("load_model")))
    {
        let mut instance = grid(name, set, Interface::Structured);
        scatter(&mut instance, &mut Scatter(7), tie);
        instance.enter_initialization_mode().unwrap();
        instance.exit_initialization_mode().unwrap();
        let (known, unknown) = (references(&instance, &["dP_load", "dQ_load"]), outputs(&instance));
        let (seeds, mut rates) = (vec![f64::MAX; known.len()], vec![0.0; unknown.len()]);
        let refused = instance.get_directional_derivative(&unknown, &known, &seeds, &mut rates);
        assert!(refused.unwrap_err().to_string().contains("fmi2GetDirectionalDerivative"));
        assert!(rates.iter().all(|rate| *rate == 0.0), "a refused call writes nothing");
    }
}

#[test]
fn at_the_start_through_the_steady_state() {
    for (name, set, tie) in CASES {
        let mut instance = grid(name, set, Interface::Structured);
        scatter(&mut instance, &mut Scatter(3), tie);
        instance.enter_initialization_mode().unwrap();
        let breaker = references(&instance, &["tie_closed"]);
        instance.set_boolean(&breaker, &[tie]).unwrap();
        let unknowns = outputs(&instance);
        let (knowns, scales) = knowns(&instance);
        let (mut judged, mut all) = (0, 0);
        for (known, scale) in knowns.iter().zip(&scales).step_by(9) {
            let exact = derivative(&mut instance, &unknowns, &[*known], &[*scale]);
            let central = differences(&mut instance, &unknowns, &[*known], &[*scale]);
            for (k, unknown) in unknowns.iter().enumerate() {
                all += 1;
                let Some(central) = central[k] else { continue };
                judged += 1;
                // The steady state is solved to 1e-12, which a difference over a hundredth makes 1e-10.
                let tolerance = 1e-6 * exact[k].abs().max(central.abs()).max(1e-4);
                let name = |r: u32| instance.registry().name(r).unwrap();
                assert!(
                    (exact[k] - central).abs() <= tolerance,
                    "{set:?} tie {tie}: d {} / d {}: {} against {central}",
                    name(*unknown),
                    name(*known),
                    exact[k]
                );
            }
        }
        println!("{name} {set:?} tie {tie}: {judged} of {all}");
        assert!(judged as f64 > 0.9 * all as f64, "{name} {set:?}: {judged} of {all}");
    }
}

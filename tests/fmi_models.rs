//! What both models promise beside derivatives: units, and states that go on bit by bit wherever they were taken.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail")]

mod derivative_support;

use bess_consensus::fmi::{Instance, Interface, Model, model_description};
use bess_consensus::models::Controller;
use derivative_support::*;
use std::collections::BTreeMap;

/// name -> (factor to SI base units, exponents) as the standard's section 2.2.2 wants them.
fn expected_units() -> BTreeMap<&'static str, &'static str> {
    BTreeMap::from([
        ("1", "<BaseUnit/>"),
        ("pu", "<BaseUnit/>"),
        ("pu.h", r#"<BaseUnit s="1" factor="3600.0"/>"#),
        ("pu/s", r#"<BaseUnit s="-1"/>"#),
        ("1/s", r#"<BaseUnit s="-1"/>"#),
        ("s", r#"<BaseUnit s="1"/>"#),
        ("rad", r#"<BaseUnit rad="1"/><DisplayUnit name="deg" factor="57.29577951308232"/>"#),
        ("rad/s", r#"<BaseUnit s="-1" rad="1"/><DisplayUnit name="Hz" factor="0.15915494309189535"/>"#),
    ])
}

fn attribute<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    text.split_once(&format!(" {name}=\""))?.1.split_once('"').map(|(value, _)| value)
}

fn check_units<M: Model>(model: &M, interface: Interface) {
    let xml = model_description::write(model, interface).unwrap();
    let expected = expected_units();
    let mut defined = Vec::new();
    for line in xml.lines().filter(|line| line.contains("<Unit ")) {
        let name = attribute(line, "name").unwrap();
        let (_, contents) = line.split_once('>').unwrap();
        assert_eq!(contents.strip_suffix("</Unit>"), expected.get(name).copied(), "{name}");
        defined.push(name);
    }
    let mut used = Vec::new();
    for line in xml.lines().filter(|line| line.contains("<Real")) {
        let real = line.split_once("<Real").unwrap().1;
        let Some(unit) = attribute(real, "unit") else {
            // What is whole or true in the structured interface has none.
            let name = attribute(line, "name").unwrap();
            let switch =
                ["enable", "dispatch", "available", "topology", "cluster", "saturated", "tie_closed"];
            let choice = ["voltage_policy", "discretisation"];
            let known = switch.iter().chain(&choice).any(|word| name.starts_with(word));
            assert!(interface == Interface::Portable && known, "{name} has no unit");
            continue;
        };
        assert!(defined.contains(&unit), "{unit} is not defined");
        let shown = expected[unit].split_once("<DisplayUnit").and_then(|(_, text)| attribute(text, "name"));
        assert_eq!(attribute(real, "displayUnit"), shown);
        used.push(unit);
    }
    assert!(defined.iter().all(|unit| used.contains(unit)), "only units in use are defined");
}

#[test]
fn every_real_variable_has_a_unit_that_is_defined() {
    for interface in [Interface::Structured, Interface::Portable] {
        check_units(controller("case1", &[], interface).model(), interface);
        check_units(grid("case1", &[], interface).model(), interface);
    }
}

/// `count` steps of scattered lengths with scattered measurements and ramps; all outputs on the way, as bits.
fn go_on(instance: &mut Instance<Controller>, random: &mut Scatter, count: usize) -> Vec<u64> {
    let (inputs, outputs) = (inputs(instance), outputs(instance));
    let measured = references(instance, &["P", "Q", "V", "omega"]);
    let mut trace = Vec::new();
    for k in 0..count {
        let values: Vec<f64> = measured.iter().map(|_| 1.0 + 1e-3 * random.next()).collect();
        instance.set_real(&measured, &values).unwrap();
        if k % 3 == 0 {
            let rates: Vec<f64> = inputs.iter().map(|_| 1e-3 * random.next()).collect();
            instance.set_real_input_derivatives(&inputs, &vec![1; inputs.len()], &rates).unwrap();
        }
        let step_ns = 11_000_000 + (10.9e6 * random.next()) as i64;
        instance.do_step(instance.time_s(), step_ns as f64 / 1e9).unwrap();
        trace.extend(read(instance, &outputs).into_iter().map(f64::to_bits));
    }
    trace
}

#[test]
fn rollback_with_histories_of_scattered_steps_is_the_same_to_the_bit() {
    let channel = r#"{ "jitter_s": 0.03, "loss": 0.2, "seed": 7 }"#;
    for (name, set) in [
        ("case1", &[("control.delay_s", "0.1")][..]),
        ("voltage", &[("control.delay_s", "0.1")]),
        ("case4", &[("control.channel", channel)]),
    ] {
        let mut instance = controller(name, set, Interface::Structured);
        instance.enter_initialization_mode().unwrap();
        let enable = references(&instance, &["enable"]);
        instance.set_boolean(&enable, &[true]).unwrap();
        instance.exit_initialization_mode().unwrap();
        go_on(&mut instance, &mut Scatter(1), 60);
        let moving = inputs(&instance);
        instance.set_real_input_derivatives(&moving[..1], &[1], &[0.5]).unwrap();
        let middle = instance.snapshot().unwrap();
        let saved = instance.serialize(&middle).unwrap();
        let first = go_on(&mut instance, &mut Scatter(2), 60);
        let end = bytes(&instance);
        go_on(&mut instance, &mut Scatter(3), 20);
        instance.restore(&middle).unwrap();
        assert!(bytes(&instance) == saved, "{name}");
        assert!(go_on(&mut instance, &mut Scatter(2), 60) == first, "{name}");
        assert!(bytes(&instance) == end, "{name}");

        let mut other = controller(name, set, Interface::Structured);
        let copy = other.deserialize(&saved).unwrap();
        other.restore(&copy).unwrap();
        // Derivatives in between leave no trace.
        let (known, unknown) = (inputs(&other), outputs(&other));
        derivative(&mut other, &unknown, &known, &vec![1.0; known.len()]);
        assert!(go_on(&mut other, &mut Scatter(2), 60) == first, "{name}");
        assert!(bytes(&other) == end, "{name}");
    }
}

#[test]
fn a_state_goes_to_no_fmu_of_other_resources_though_its_variables_are_the_same() {
    let here = controller("case1", &[], Interface::Structured);
    let mut other = controller("case1", &[("control.exchange_fade_s", "3.0")], Interface::Structured);
    assert_eq!(here.guid(), other.guid());
    let (snapshot, before) = (here.snapshot().unwrap(), bytes(&other));
    let refused = other.restore(&snapshot).unwrap_err().to_string();
    assert!(refused.contains("made from other resources"), "{refused}");
    let refused = other.deserialize(&bytes(&here)).err().unwrap().to_string();
    assert!(refused.contains("made from other resources"), "{refused}");
    assert!(bytes(&other) == before);
}

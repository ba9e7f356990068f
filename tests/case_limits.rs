#![cfg(feature = "host")]
//! Limits, filters, enabling and disabling on the AC network. Each test prints its figures (`-- --nocapture`).
#![allow(non_snake_case, clippy::unwrap_used)]

mod case_support;

use bess_consensus::scenario::Resolved;
use case_support::{N, Run, keys, scenario};
use serde_json::{Value, json};

const NO_EXCHANGE: (&str, &str) = ("control.gains.E", "0");

/// Case 1 without exchange, every battery with `key`, which is `all` except for the battery `which` (from 1).
fn limited(key: &str, (which, value): (usize, f64), all: f64, more: &[(&str, &str)]) -> Run {
    let resolved = Resolved::load("case1", &keys(&[])).unwrap();
    let mut bess = serde_json::to_value(&resolved.scenario.bess).unwrap();
    for (i, b) in bess.as_array_mut().unwrap().iter_mut().enumerate() {
        b[key] = if i + 1 == which { json!(value) } else { json!(all) };
    }
    let bess = Value::to_string(&bess);
    let mut set = vec![("bess", bess.as_str()), NO_EXCHANGE];
    set.extend_from_slice(more);
    scenario("case1", &set)
}

#[test]
fn an_active_power_limit_holds_and_the_others_share_the_rest() {
    // BESS 4 is a leaf of the graph: its neighbour's neighbours still hear each other.
    let run = limited("P_max", (4, 1.5), 10.0, &[]);
    let free = scenario("case1", &[NO_EXCHANGE]).grid("P[4]")[run.before(50.0)];
    let P = run.worst(45.0, 50.0, |k| run.grid("P[4]")[k].abs());
    let others: Vec<Vec<f64>> =
        run.p().into_iter().enumerate().filter(|(i, _)| *i != 3).map(|(_, p)| p).collect();
    let (omega, sharing) = (run.omega_error(45.0, 50.0), run.spread(&others, 45.0, 50.0));
    println!(
        "P_max 1.5: P_4 {P:.6} (free {free:.3}), omega {omega:.1e}, sharing of the others {sharing:.1e}"
    );
    assert!(free > 1.6, "then the limit would not bind");
    assert!(P < 1.5 * (1.0 + 1e-3));
    assert!(omega < 1e-5 && sharing < 1e-5);
    for i in 1..=N {
        let saturated = run.controller(&format!("saturated[{i}]"));
        let expected = if i == 4 { 1.0 } else { 0.0 };
        assert!(run.between(45.0, 50.0).all(|k| saturated[k] == expected), "saturated[{i}]");
    }
}

#[test]
fn a_limited_battery_between_two_parts_of_the_graph_passes_their_sharing_on() {
    // BESS 1 is the only way between the clusters: with it at its limit they share through it all the same.
    let run = limited("P_max", (1, 1.5), 10.0, &[]);
    let p = run.p();
    let (P, omega) = (run.worst(45.0, 50.0, |k| run.grid("P[1]")[k]), run.omega_error(45.0, 50.0));
    let others = run.spread(&p[1..], 45.0, 50.0);
    println!("P_1 {P:.6}, omega {omega:.1e}; sharing of all others {others:.1e}");
    assert!(P < 1.5 * (1.0 + 1e-3));
    assert!(omega < 1e-9 && others < 1e-9, "the bars of the case without limits");
    // The same of reactive power, where it can be shared at all.
    let average = ("control.voltage_policy", "\"average\"");
    let run = limited("Q_max", (1, 0.34), 10.0, &[average]);
    let (Q, others) = (run.worst(45.0, 50.0, |k| run.grid("Q[1]")[k]), run.spread(&run.q()[1..], 45.0, 50.0));
    println!("Q_1 {Q:.6}; reactive sharing of all others {others:.1e}");
    assert!(Q < 0.34 * (1.0 + 1e-3) && others < 1e-5);
}

#[test]
fn a_limit_that_no_longer_binds_is_left_without_delay() {
    // A load of 5 pu less: every share falls below the limit. A wound-up setpoint would hang on.
    let events = r#"[{"at_s": 20, "set": {"controller.enable": true}},
        {"at_s": 50, "set": {"grid.dP_load[12]": -3.5, "grid.dP_load[8]": -1.5}}]"#;
    let more = [("events", events), ("stop_s", "80")];
    let (run, free) = (limited("P_max", (4, 1.5), 10.0, &more), limited("P_max", (4, 10.0), 10.0, &more));
    let settled = |run: &Run| {
        let p = run.p();
        run.settled(50.0, 80.0, 1e-4, |k| run.consensus_error(&p, k)).unwrap()
    };
    let (limited, unlimited) = (settled(&run), settled(&free));
    println!("consensus {limited:.2} s after the load drops, {unlimited:.2} s without any limit");
    assert!(limited < unlimited + 2.0);
    assert!(run.worst(75.0, 80.0, |k| run.controller("saturated[4]")[k]) == 0.0);
}

/// No load steps after the controller is on.
const QUIET: (&str, &str) = ("events", r#"[{"at_s": 20, "set": {"controller.enable": true}}]"#);

#[test]
fn a_reactive_power_limit_is_reached_within_seconds_at_any_step_and_held() {
    let free = scenario("case1", &[NO_EXCHANGE]);
    // To 0.1 % at steps that the power filters allow; at 1 s only the consensus of all sets the pace, in steps.
    for (step_s, within, seconds) in [("0.01", 1e-3, 10.0), ("0.1", 1e-3, 15.0), ("1", 0.05, 30.0)] {
        for which in [1, 4] {
            for policy in ["\"paper\"", "\"average\""] {
                let name = format!("Q[{which}]");
                let Q_max = 0.5 * free.grid(&name)[free.before(50.0)];
                let more = [QUIET, ("step_s", step_s), ("control.voltage_policy", policy)];
                let run = limited("Q_max", (which, Q_max), 10.0, &more);
                let Q = run.grid(&name);
                let settled = |to: f64| run.settled(20.0, 120.0, to * Q_max, |k| Q[k] - Q_max);
                println!(
                    "step {step_s} s, {policy}, BESS {which}: Q within 5 % of half its share after {:?} s, 1 % {:?}, 0.1 % {:?}",
                    settled(0.05),
                    settled(0.01),
                    settled(1e-3)
                );
                assert!(settled(within).is_some_and(|s| s < seconds), "{step_s} s, {policy}, BESS {which}");
            }
        }
    }
}

#[test]
fn an_apparent_power_limit_is_reached_within_seconds_and_held() {
    let free = scenario("case1", &[NO_EXCHANGE]);
    let at = free.before(50.0);
    let (P, Q) = (free.grid("P[1]")[at], free.grid("Q[1]")[at].abs());
    let S_max = (P * P + 0.25 * Q * Q).sqrt();
    let run = limited("S_max", (1, S_max), 10.0, &[QUIET]);
    let S = |k: usize| run.grid("P[1]")[k].hypot(run.grid("Q[1]")[k]);
    let settled = run.settled(20.0, 120.0, 1e-3 * S_max, |k| S(k) - S_max);
    println!("S_max {S_max:.3} (free {:.3}): within 0.1 % after {settled:?} s", P.hypot(Q));
    assert!(settled.is_some_and(|s| s < 10.0));
}

#[test]
fn a_nearly_empty_battery_ends_without_rocking() {
    let resolved = Resolved::load("energy", &keys(&[])).unwrap();
    let mut bess = serde_json::to_value(&resolved.scenario.bess).unwrap();
    bess[3]["soc_start"] = json!(0.12);
    let bess = Value::to_string(&bess);
    for step_s in ["0.02", "0.1"] {
        let set = [("bess", bess.as_str()), ("step_s", step_s), ("record_every", "10"), ("stop_s", "1300")];
        let run = scenario("energy", &set);
        let (P, soc, p) = (run.grid("P[4]"), &run.soc()[3], run.p());
        let others: Vec<Vec<f64>> = [0, 1, 2, 4, 5, 6].map(|i| p[i].clone()).to_vec();
        // The limit falls to nothing with the state of charge.
        let over = run.worst(100.0, 1300.0, |k| P[k] - 4.0 * ((soc[k] - 0.1) / 0.05).clamp(0.0, 1.0));
        let charging = run.worst(100.0, 1300.0, |k| (-P[k]).max(0.0));
        let (omega, sharing) = (run.omega_error(1200.0, 1300.0), run.spread(&others, 1200.0, 1300.0));
        println!(
            "step {step_s} s: SoC {:.5}, P {:.4}, over its limit by {over:.1e}, charging {charging:.1e}; omega {omega:.1e}, sharing of the others {sharing:.1e}",
            soc[run.before(1300.0)],
            P[run.before(1300.0)]
        );
        assert!(over < 4.0 * 1e-3 && charging == 0.0);
        assert!(omega < 1e-5 && sharing < 1e-5);
    }
}

#[test]
fn setpoints_keep_their_rates_and_ranges() {
    for (key, setpoint, rate) in [("omega_set_rate", "omega_set", 1e-3), ("V_set_rate", "V_set", 1e-3)] {
        let run = limited(key, (1, rate), rate, &[]);
        let of = run.of_controller(setpoint);
        let fastest =
            run.worst(0.0, 119.9, |k| of.iter().fold(0.0, |w: f64, s| w.max((s[k + 1] - s[k]).abs() / 0.01)));
        println!("{key} {rate}: {fastest:.6} pu/s, omega {:.1e} before 50 s", run.omega_error(45.0, 50.0));
        assert!(fastest <= rate * (1.0 + 1e-9));
        assert!(run.omega_error(45.0, 50.0) < 1e-5);
    }
    let run = scenario("case1", &[NO_EXCHANGE, ("control.V_set_range", "[0.98, 1.03]")]);
    let V_set = run.of_controller("V_set");
    assert!(V_set.iter().flatten().all(|v| (0.98 - 1e-12..=1.03 + 1e-12).contains(v)));
}

#[test]
fn measurement_filters_leave_the_steady_state_alone() {
    let filter = r#"{"omega_s": 0.02, "P_s": 0.02, "E_s": 0.02, "V_s": 0.02, "Q_s": 0.02}"#;
    let run = scenario("case1", &[NO_EXCHANGE, ("control.measurement_filter", filter)]);
    let (omega, sharing) = (run.omega_error(45.0, 50.0), run.spread(&run.p(), 45.0, 50.0));
    println!("filters of 20 ms: omega {omega:.1e}, sharing {sharing:.1e}");
    assert!(omega < 1e-5 && sharing < 1e-5);
}

#[test]
fn enabling_and_disabling_are_bumpless() {
    let events = r#"[{"at_s": 20, "set": {"controller.enable": true}},
        {"at_s": 50, "set": {"controller.enable": false}},
        {"at_s": 60, "set": {"controller.enable": true}}]"#;
    let run = scenario("case1", &[("events", events), ("stop_s", "80")]);
    let (omega_set, V_set) = (run.of_controller("omega_set"), run.of_controller("V_set"));
    let (P_set, Q_set) = (run.of_controller("P_set"), run.of_controller("Q_set"));
    let (u_omega, u_V) = (run.of_controller("u_omega"), run.of_controller("u_V"));
    let fastest =
        |u: &[Vec<f64>], k: usize| u.iter().fold(0.0, |w: f64, u| w.max(u[k].abs()).max(u[k + 1].abs()));
    let off = run.between(50.01, 60.0);
    for s in [&omega_set, &V_set, &P_set, &Q_set] {
        assert_eq!(run.worst(50.01, 59.98, |k| step(s, k)), 0.0, "off, the setpoints stand still");
    }
    for k in [run.before(20.0), run.before(20.0) + 1, off.start - 1, off.end - 1, off.end] {
        let (omega, V, P) = (step(&omega_set, k), step(&V_set, k), step(&P_set, k));
        println!(
            "{:.2} s: omega_set moves by {omega:.1e}, V_set by {V:.1e}, P_set by {P:.1e} in a step",
            run.t[k]
        );
        // No more than the laws ask for in a step of 10 ms.
        assert!(omega <= 0.01 * fastest(&u_omega, k) + 1e-12 && V <= 0.01 * fastest(&u_V, k) + 1e-12);
        // P_exchange_max, 1 pu, in two seconds.
        assert!(P <= 0.01 / 2.0 * (1.0 + 1e-9));
    }
    println!("omega within {:.1e} before 80 s", run.omega_error(75.0, 80.0));
}

fn step(series: &[Vec<f64>], k: usize) -> f64 {
    series.iter().fold(0.0, |w: f64, s| w.max((s[k + 1] - s[k]).abs()))
}

#[test]
fn the_exchange_jumps_at_no_event_and_keeps_its_sum() {
    let events = r#"[{"at_s": 20, "set": {"controller.enable": true}},
        {"at_s": 24, "set": {"controller.topology": 2}},
        {"at_s": 25, "set": {"controller.available[5]": false}},
        {"at_s": 28, "set": {"controller.topology": 1}},
        {"at_s": 32, "set": {"controller.available[5]": true}},
        {"at_s": 36, "set": {"controller.enable": false}},
        {"at_s": 37, "set": {"controller.topology": 2}},
        {"at_s": 38, "set": {"controller.enable": true}}]"#;
    let of = |fade: &str| {
        let set = [
            ("events", events),
            ("stop_s", "45"),
            ("control.exchange_fade_s", fade),
            ("control.gains.E", "0.02"),
        ];
        let run = scenario("case1", &set);
        let P_set = run.of_controller("P_set");
        assert!(run.worst_sum_of_P_set() < 1e-13);
        let largest = P_set.iter().flatten().fold(0.0, |w: f64, P| w.max(P.abs()));
        (run.worst(19.0, 44.9, |k| step(&P_set, k)), largest, run.omega_error(43.0, 45.0))
    };
    let ((faded, largest, omega), (at_once, ..)) = (of("2"), of("0"));
    println!(
        "P_set up to {largest:.2} pu moves by {faded:.1e} in a step, {at_once:.1e} without the fade; omega {omega:.1e}"
    );
    // From -P to P in two seconds at most, in steps of 10 ms.
    assert!(at_once > 0.1 && faded <= 2.0 * largest * 0.01 / 2.0 * 1.5);
}

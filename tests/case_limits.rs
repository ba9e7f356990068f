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
fn a_limited_battery_between_two_parts_of_the_graph_parts_their_sharing() {
    // BESS 1 is the only way between the clusters: with it at its limit each cluster shares for itself.
    let run = limited("P_max", (1, 1.5), 10.0, &[]);
    let p = run.p();
    let (P, omega) = (run.worst(45.0, 50.0, |k| run.grid("P[1]")[k]), run.omega_error(45.0, 50.0));
    let (own, other) = (run.spread(&p[1..3], 45.0, 50.0), run.spread(&p[3..], 45.0, 50.0));
    println!(
        "P_1 {P:.6}, omega {omega:.1e}; sharing {own:.1e} and {other:.1e} inside, {:.1e} over all others",
        run.spread(&p[1..], 45.0, 50.0)
    );
    assert!(P < 1.5 * (1.0 + 1e-3) && omega < 1e-5);
    assert!(own < 1e-5 && other < 1e-5);
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

#[test]
fn reactive_and_apparent_power_limits_hold() {
    let free = scenario("case1", &[NO_EXCHANGE]);
    let at = free.before(50.0);
    let (P, Q) = (free.grid("P[1]")[at], free.grid("Q[1]")[at].abs());
    // No load steps: a reactive power beyond its limit comes back slowly, by the droop of its own setpoint.
    let quiet = ("events", r#"[{"at_s": 20, "set": {"controller.enable": true}}]"#);
    let Q_max = 0.5 * Q;
    let run = limited("Q_max", (1, Q_max), 10.0, &[quiet]);
    let reached = run.worst(115.0, 120.0, |k| run.grid("Q[1]")[k].abs());
    println!(
        "Q_max {Q_max:.3}: Q_1 {reached:.4} after 95 s (free {Q:.3}), {:.4} after 30 s",
        run.grid("Q[1]")[run.before(50.0)]
    );
    assert!(reached < Q_max * 1.01);
    let S_max = (P * P + 0.25 * Q * Q).sqrt();
    let run = limited("S_max", (1, S_max), 10.0, &[quiet]);
    let S = run.worst(115.0, 120.0, |k| run.grid("P[1]")[k].hypot(run.grid("Q[1]")[k]));
    println!("S_max {S_max:.3}: S_1 {S:.4} (free {:.3})", P.hypot(Q));
    assert!(S < S_max * 1.001);
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
    // An exchange asks for its power at once unless it has a ramp; all other setpoints are integrators.
    let resolved = Resolved::load("case1", &keys(&[])).unwrap();
    let mut bess = serde_json::to_value(&resolved.scenario.bess).unwrap();
    for b in bess.as_array_mut().unwrap() {
        b["P_set_rate"] = json!(0.05);
    }
    let bess = Value::to_string(&bess);
    let run = scenario("case1", &[("bess", &bess), ("events", events), ("stop_s", "80")]);
    let (omega_set, V_set) = (run.of_controller("omega_set"), run.of_controller("V_set"));
    let (P_set, Q_set) = (run.of_controller("P_set"), run.of_controller("Q_set"));
    let (u_omega, u_V) = (run.of_controller("u_omega"), run.of_controller("u_V"));
    let step = |s: &[Vec<f64>], k: usize| s.iter().fold(0.0, |w: f64, s| w.max((s[k + 1] - s[k]).abs()));
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
        assert!(P <= 0.05 * 0.01 * (1.0 + 1e-9));
    }
    println!("omega within {:.1e} before 80 s", run.omega_error(75.0, 80.0));
}

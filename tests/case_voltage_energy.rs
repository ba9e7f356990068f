#![cfg(feature = "host")]
//! Average voltage and energy balance on the AC network. Each test prints its figures (`-- --nocapture`).
#![allow(non_snake_case, clippy::unwrap_used)]

mod case_support;

use bess_consensus::scenario::Resolved;
use case_support::{N, Run, keys, scenario};

/// When the controller turns on, a load drops and another one comes in `voltage`, s.
const EVENTS: [f64; 3] = [20.0, 50.0, 80.0];

/// Spread of K_Q Q and abs(mean V - 1) in the last second before 30 s after each event.
fn average_voltage(run: &Run, events: &[f64]) -> Vec<(f64, f64)> {
    let (q, V) = (run.q(), run.of_grid("V"));
    let of = |at: &f64| (run.spread(&q, at + 29.0, at + 30.0), run.mean_error(&V, 1.0, at + 29.0, at + 30.0));
    events.iter().map(of).collect()
}

#[test]
fn reactive_sharing_and_mean_voltage_are_exact_within_30_s_of_each_event() {
    for (sharing, mean) in average_voltage(&scenario("voltage", &[]), &EVENTS) {
        println!("10 ms: K_Q Q spread {sharing:.1e}, mean V {mean:.1e}");
        assert!(sharing < 1e-6 && mean < 1e-6);
    }
}

/// With 500 ms on every edge and the scenario's own settings.
#[test]
fn with_half_a_second_of_delay_both_are_within_5e_4_within_30_s_of_each_event() {
    for (sharing, mean) in average_voltage(&scenario("voltage", &[("control.delay_s", "0.5")]), &EVENTS) {
        println!("500 ms: K_Q Q spread {sharing:.1e}, mean V {mean:.1e}");
        assert!(sharing < 5e-4 && mean < 5e-4);
    }
}

/// What meets a bar for its reason meets it in the neighbourhood too.
#[test]
fn it_hangs_neither_on_the_step_nor_on_gains_nor_on_punctual_messages() {
    for change in [
        ("step_s", "0.002"),
        ("step_s", "0.02"),
        ("control.delay_s", "0.3"),
        ("control.delay_s", "0.6"),
        ("control.eta", "0.3"),
        ("control.gains.V", "0.3"),
        ("control.gains.V", "3"),
        ("control.gains.Q", "0.5"),
        ("control.gains.Q", "2"),
        ("control.channel", r#"{"jitter_s": 0.2, "loss": 0.2, "seed": 1}"#),
        ("communication.topologies", r#"[{"name": "b3", "inside": "ring"}]"#),
    ] {
        let figures = average_voltage(&scenario("voltage", &[("control.delay_s", "0.5"), change]), &EVENTS);
        println!("500 ms, {change:?}: {figures:?}");
        assert!(figures.iter().all(|(sharing, mean)| *sharing < 5e-4 && *mean < 5e-4));
    }
}

#[test]
fn the_estimates_recover_after_an_agent_leaves_and_joins() {
    let events = r#"[{"at_s": 20, "set": {"controller.enable": true}},
        {"at_s": 50, "set": {"controller.available[7]": false}},
        {"at_s": 80, "set": {"controller.available[7]": true}}]"#;
    for (delay_s, bar) in [("0", 1e-6), ("0.5", 5e-4)] {
        let set = [("events", events), ("stop_s", "120"), ("control.delay_s", delay_s)];
        let run = scenario("voltage", &set);
        let figures = average_voltage(&run, &[20.0, 80.0]);
        let stayed: Vec<Vec<f64>> = run.q()[..6].to_vec();
        let away = run.spread(&stayed, 79.0, 80.0);
        println!("{delay_s} s: {figures:?}; K_Q Q spread of the others meanwhile {away:.1e}");
        assert!(away < bar);
        assert!(figures.iter().all(|(sharing, mean)| *sharing < bar && *mean < bar));
    }
}

#[test]
fn an_hour_balances_unequal_batteries_beside_the_sharing() {
    let run = scenario("energy", &[]);
    let (soc, p) = (run.soc(), run.p());
    let (start, end) = (run.spread(&soc, 0.0, 1.0), run.spread(&soc, 3590.0, 3600.0));
    let alone = scenario("energy", &[("control.gains.E", "0")]);
    let without = alone.spread(&alone.soc(), 3590.0, 3600.0);
    let (sum, sharing) = (run.worst_sum_of_P_set(), run.spread(&p, 3590.0, 3600.0));
    println!(
        "SoC spread {start:.2e} -> {end:.1e} (without exchange {without:.1e}); sharing {sharing:.1e}; sum {sum:.1e}"
    );
    assert!(end < 2e-4 && without > 0.1);
    assert!(sharing < 1e-5 && run.omega_error(3590.0, 3600.0) < 1e-5);
    assert!(sum < 1e-9);
}

/// The energy scenario with a load so small that the exchange would turn the takers into chargers.
fn light_load(step_s: &str, ramps: bool, more: &[(&str, &str)]) -> Run {
    let load = r#"{"grid.dP_load[12]": -3.7, "grid.dP_load[8]": -1.4, "grid.dP_load[9]": -1.2, "grid.dP_load[1]": -0.5, "grid.dP_load[6]": -0.7}"#;
    let resolved = Resolved::load("energy", &keys(&[])).unwrap();
    let mut bess = serde_json::to_value(&resolved.scenario.bess).unwrap();
    for b in bess.as_array_mut().unwrap().iter_mut().filter(|_| !ramps) {
        b.as_object_mut().unwrap().remove("P_set_rate");
    }
    let bess = bess.to_string();
    let mut set = vec![
        ("stop_s", "300"),
        ("record_every", "1"),
        ("initial", load),
        ("bess", &bess),
        ("step_s", step_s),
    ];
    set.extend_from_slice(more);
    scenario("energy", &set)
}

#[test]
fn nobody_is_made_to_charge_by_the_exchange() {
    let charging = |run: &Run, from_s: f64| {
        let P = run.of_grid("P");
        run.worst(from_s, 300.0, |k| P.iter().fold(0.0, |w: f64, P| w.max(-P[k])))
    };
    let free = light_load("0.1", true, &[("control.no_circulation", "false")]);
    println!("largest charging power {:.3} pu without the rule", charging(&free, 60.0));
    assert!(charging(&free, 60.0) > 0.05, "then the rule had nothing to do");
    for (step_s, ramps, from_s) in
        [("0.01", true, 0.0), ("0.01", false, 0.0), ("0.1", true, 0.0), ("0.1", false, 60.0)]
    {
        let run = light_load(step_s, ramps, &[]);
        println!(
            "step {step_s} s, ramps {ramps}: {:.1e} pu, {:.1e} after 30 s; omega {:.1e}",
            charging(&run, 0.0),
            charging(&run, 30.0),
            run.omega_error(290.0, 300.0)
        );
        assert!(charging(&run, from_s) < 1e-3);
        assert!(run.omega_error(290.0, 300.0) < 1e-9);
    }
    let late = light_load("0.01", false, &[("control.delay_s", "0.5")]);
    println!(
        "0.5 s of delay: {:.1e} pu, {:.1e} after 60 s, {:.1e} after 200 s",
        charging(&late, 0.0),
        charging(&late, 60.0),
        charging(&late, 200.0)
    );
    let coarse = light_load("1", false, &[]);
    println!("step 1 s: {:.1e} pu, {:.1e} after 60 s", charging(&coarse, 0.0), charging(&coarse, 60.0));
    // A load that drops takes its share from every battery at once; the exchange follows.
    let drop = r#"[{"at_s": 20, "set": {"controller.enable": true}}, {"at_s": 60, "set": {"grid.dP_load[8]": -1.9}}]"#;
    let dropped = light_load("0.01", false, &[("events", drop)]);
    let P = dropped.of_grid("P");
    let back = dropped.settled(60.0, 300.0, 1e-3, |k| P.iter().fold(0.0, |w: f64, P| w.max(-P[k])));
    println!(
        "0.5 pu of load less at 60 s: {:.1e} pu, within 1e-3 again after {back:?} s",
        charging(&dropped, 60.0)
    );
    assert!(back.is_some_and(|s| s < 5.0));
}

#[test]
fn near_its_lower_limit_a_battery_gives_nothing_away() {
    // P_max 4 pu falls to nothing between SoC 0.63 and 0.58 and passes below the share of the load on the way.
    let set = [("control.soc_limits", r#"{"min": 0.58, "max": 0.95, "taper": 0.05}"#), ("stop_s", "1800")];
    let run = scenario("energy", &set);
    let (soc, p, P_set) = (run.soc(), run.p(), run.of_controller("P_set"));
    let mut closed = 0;
    for k in run.between(25.0, 1800.0) {
        for i in 0..N {
            let limit = 4.0 * ((soc[i][k] - 0.58) / 0.05).clamp(0.0, 1.0);
            if limit < p[i][k] / run.K_P[i] {
                closed += 1;
                // The setpoint follows a step later, and by its ramp.
                let (before, after) = (P_set[i][k], P_set[i][(k + 1).min(run.t.len() - 1)]);
                assert!(after <= 1e-9 || after < before, "BESS {} gives {after} pu at {} s", i + 1, run.t[k]);
            }
        }
    }
    println!("closed at {closed} instants, sum {:.1e}", run.worst_sum_of_P_set());
    assert!(closed > 1000);
    assert!(run.worst_sum_of_P_set() < 1e-9);
}

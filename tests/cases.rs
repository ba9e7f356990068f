#![cfg(feature = "host")]
//! The built-in scenarios on the AC network, claim by claim. Each test prints its figures (`-- --nocapture`).
#![allow(non_snake_case, clippy::unwrap_used)]

mod case_support;

use bess_consensus::control::{Controller, Event};
use bess_consensus::fmi::{Category, Instance, Interface, Logger};
use bess_consensus::grid::GridModel;
use bess_consensus::harness::{CONTROLLER, InProcess};
use bess_consensus::models;
use bess_consensus::scenario::Resolved;
use case_support::{N, Run, keys, scenario, with};
use std::sync::{Arc, Mutex};

const NO_EXCHANGE: (&str, &str) = ("control.gains.E", "0");

#[test]
fn case2_charges_as_dispatched_and_takes_its_load_back() {
    let run = scenario("case2", &[]);
    let (P, p) = (run.of_grid("P"), run.p());
    let island = run.before(20.0);
    assert!(P.iter().all(|P| P[island] > 0.5), "discharging in the island");
    for end in [50.0, 80.0, 110.0] {
        let charging =
            run.worst(end - 5.0, end, |k| P.iter().fold(f64::NEG_INFINITY, |w, P| w.max(P[k])) + 1.0);
        let off = run.worst(end - 5.0, end, |k| p.iter().fold(0.0, |w: f64, p| w.max((p[k] + 0.0005).abs())));
        let (spread, omega) = (run.spread(&p, end - 5.0, end), run.omega_error(end - 5.0, end));
        println!(
            "until {end}: largest P {:.3}, K_P P off {off:.1e}, spread {spread:.1e}, omega {omega:.1e}",
            charging - 1.0
        );
        assert!(charging < 1.0, "every P_i is negative");
        assert!(off < 1e-5 && spread < 1e-5 && omega < 1e-5);
    }
    // The droop asks for a fall of the frequency by what all take over together, divided by sum 1/K_P.
    let before = run.before(110.0);
    let total = |k: usize| P.iter().map(|P| P[k]).sum::<f64>();
    let stiffness: f64 = run.K_P.iter().map(|K| 1.0 / K).sum();
    let demanded = (total(run.before(140.0)) - total(before)) / stiffness;
    // Which battery takes over how much at first is the network's doing; together they follow the droop.
    let omega = run.of_grid("omega");
    let together =
        |k: usize| omega.iter().zip(&run.K_P).map(|(w, K)| (1.0 - w[k]) / K).sum::<f64>() / stiffness;
    let fall = run.worst(110.0, 140.0, together);
    let (omega_set, P_set) = (run.of_controller("omega_set"), run.of_controller("P_set"));
    let off_droop = run.worst(110.0, 140.0, |k| {
        (0..N).fold(0.0, |w: f64, i| {
            w.max((omega[i][k] - omega_set[i][k] + run.K_P[i] * (P[i][k] - P_set[i][k])).abs())
        })
    });
    let step = |k: usize| omega_set.iter().map(|s| (s[k + 1] - s[k]).abs()).fold(0.0, f64::max);
    println!(
        "110 s: omega falls by {fall:.2e} together ({:.2e} at worst), the droop demands {demanded:.2e}; off the droop by \
         {off_droop:.1e}; omega_set moves by {:.1e} as the tie opens",
        run.omega_error(110.0, 140.0),
        step(before)
    );
    assert!(fall <= demanded && off_droop < 1e-9);
    assert!(step(before) < 1e-6, "the setpoints do not jump");
    assert!(run.omega_error(135.0, 140.0) < 1e-5 && run.spread(&p, 135.0, 140.0) < 1e-5);
    assert!(P.iter().all(|P| P[run.before(140.0)] > 0.5), "discharging again");
}

/// Case 2 up to the opening of the tie, then `last`.
fn opening(last: &str) -> Run {
    let before = r#"{"at_s": 20, "set": {"grid.tie_closed": true, "controller.enable": true, "controller.P_ref": -0.0005, "controller.dispatch": true}},
        {"at_s": 50, "set": {"controller.topology": 2}},
        {"at_s": 80, "set": {"grid.dP_load[12]": -0.5, "grid.dQ_load[12]": -0.5}}"#;
    scenario("case2", &[("events", &format!("[{before}, {last}]")), ("stop_s", "120")])
}

/// What the droop demands of each battery when the tie opens is in the end the same for all, and what it is at
/// first is the network's to distribute, by the distance of each battery from the tie. The controller must add
/// to neither: the yardstick is the same opening with the setpoints frozen.
#[test]
fn case2_the_controller_takes_from_the_jump_that_droop_and_network_make_and_adds_nothing() {
    let opens = r#"{"at_s": 110, "set": {"grid.tie_closed": false, "controller.dispatch": false}}"#;
    let active = opening(opens);
    let frozen = opening(&format!(r#"{{"at_s": 109.99, "set": {{"controller.enable": false}}}}, {opens}"#));
    let (before, end) = (frozen.before(110.0), frozen.before(120.0));
    let P = frozen.of_grid("P");
    let total = |k: usize| P.iter().map(|P| P[k]).sum::<f64>();
    let stiffness: f64 = frozen.K_P.iter().map(|K| 1.0 / K).sum();
    let demanded = (total(end) - total(before)) / stiffness;
    let (omega, controlled) = (frozen.of_grid("omega"), active.of_grid("omega"));
    // Closed form: the droops in parallel, from the frequency before.
    for (i, w) in omega.iter().enumerate() {
        let off = w[before] - w[end] - demanded;
        assert!(off.abs() < 1e-6, "BESS {}: {off:e} off the droop's {demanded:e}", i + 1);
    }
    // The synchronous state by Newton's method, from the frozen setpoints alone.
    let grid = Resolved::load("case2", &keys(&[])).unwrap().grid.unwrap();
    let mut grid = GridModel::new(&grid).unwrap();
    let inputs = grid.inputs_mut();
    for (name, setpoint) in
        [("omega_set", &mut inputs.omega_set), ("V_set", &mut inputs.V_set), ("P_set", &mut inputs.P_set)]
    {
        *setpoint = frozen.of_controller(name).iter().map(|s| s[end]).collect();
    }
    (inputs.dP_load[11], inputs.dQ_load[11]) = (-0.5, -0.5);
    let steady = grid.find_steady_state().unwrap().omega;
    println!(
        "frozen: omega ends {:.4e} below, the droop demands {demanded:.4e}, Newton finds {:.4e}",
        1.0 - omega[0][end],
        1.0 - steady
    );
    assert!((omega[0][end] - steady).abs() < 1e-9);
    // Until the first control action shows, both are the same; after it, no battery falls further.
    for i in 0..N {
        let lowest = |run: &Run, w: &[Vec<f64>]| run.worst(110.0, 120.0, |k| 1.0 - w[i][k]);
        let (alone, with) = (lowest(&frozen, &omega), lowest(&active, &controlled));
        let first = omega[i][before + 2] - controlled[i][before + 2];
        println!(
            "BESS {}: falls {alone:.3e} alone, {with:.3e} with the controller; first step {first:.0e} apart",
            i + 1
        );
        assert!(first.abs() < 1e-6);
        assert!(with <= alone);
    }
}

#[test]
fn case3_smaller_eta_settles_sooner_and_acts_harder() {
    let mut last: Option<(f64, f64)> = None;
    for eta in ["1", "0.9", "0.6", "0.5", "0.4", "0.1"] {
        let run = scenario("case3", &[("control.eta", eta)]);
        let p = run.p();
        let settled = run.settled(20.0, 50.0, 1e-5, |k| run.consensus_error(&p, k));
        let u = run.of_controller("u_omega");
        let hardest = run.worst(20.0, 50.0, |k| u.iter().fold(0.0, |w: f64, u| w.max(u[k].abs())));
        println!("eta {eta}: settled {settled:?} s, largest u_omega {hardest:.2e} pu/s");
        let settled = settled.unwrap_or(f64::INFINITY);
        if let Some((before, weaker)) = last {
            assert!(settled < before && hardest > weaker, "eta = {eta}");
        }
        last = Some((settled, hardest));
    }
}

#[test]
fn case3_the_fixed_time_law_settles_no_later_than_the_finite_time_law() {
    let of = |law: &str| {
        let run = scenario("case3", &[("control.law", law)]);
        let p = run.p();
        run.settled(20.0, 50.0, 1e-5, |k| run.consensus_error(&p, k)).unwrap()
    };
    let (finite, fixed) = (of("\"finite_time\""), of(r#"{"fixed_time":{"alpha":1,"beta":100}}"#));
    println!("finite time {finite:.2} s, fixed time {fixed:.2} s");
    assert!(fixed <= finite);
}

#[test]
fn case4_reaches_consensus_half_a_second_late_and_later_than_without_delay() {
    let (late, prompt) = (scenario("case4", &[]), scenario("case4", &[("control.delay_s", "0")]));
    let (p_late, p_prompt) = (late.p(), prompt.p());
    let settled = |to_s: f64, tolerance: f64| {
        (
            late.settled(to_s - 30.0, to_s, tolerance, |k| late.consensus_error(&p_late, k)),
            prompt.settled(to_s - 30.0, to_s, tolerance, |k| prompt.consensus_error(&p_prompt, k)),
        )
    };
    for (to_s, tolerance) in [(50.0, 1e-3), (80.0, 1e-5)] {
        let (slow, quick) = settled(to_s, tolerance);
        println!("within {tolerance:.0e} {slow:?} s after {}, {quick:?} s without delay", to_s - 30.0);
        assert!(slow.unwrap() > quick.unwrap());
    }
}

#[test]
fn case4_jitter_and_loss_come_from_the_seed_alone() {
    let channel = |seed: u32| format!(r#"{{"jitter_s": 0.2, "loss": 0.2, "seed": {seed}}}"#);
    let of = |seed: u32| {
        let run = scenario("case4", &[("control.channel", &channel(seed)), ("stop_s", "50")]);
        (run.of_controller("omega_set"), run.omega_error(45.0, 50.0))
    };
    let ((first, error), (again, _), (other, _)) = (of(1), of(1), of(2));
    println!("jitter 0.2 s and 20 % loss on top of 0.5 s: omega within {error:.1e}");
    assert!(first == again, "one seed, one run");
    assert!(first != other, "another seed, another run");
    assert!(error < 1e-3);
}

#[test]
fn case4_each_edge_has_its_own_delay() {
    let resolved = Resolved::load("case4", &keys(&[])).unwrap();
    let variant = resolved.scenario.compare.iter().find(|v| v.label == "a delay per edge").unwrap();
    let graphs = serde_json::to_string(&variant.set["communication.graphs"]).unwrap();
    let per_edge = scenario("case4", &[("communication.graphs", &graphs)]);
    let common = graphs.replace(",\"delay_s\":0.7", "");
    assert_ne!(graphs, common);
    let other = scenario("case4", &[("communication.graphs", &common)]);
    assert!(
        per_edge.of_controller("omega_set") != other.of_controller("omega_set"),
        "0.7 s or 0.5 s on one edge"
    );
    let p = per_edge.p();
    let (omega, sharing) = (per_edge.omega_error(75.0, 80.0), per_edge.spread(&p, 75.0, 80.0));
    println!("0.1 to 0.7 s: omega {omega:.1e}, sharing {sharing:.1e} before 80 s");
    assert!(omega < 1e-4 && sharing < 1e-4);
}

#[test]
fn plug_and_play_holds_who_left_and_takes_them_back() {
    let run = scenario("plug_and_play", &[]);
    let p = run.p();
    let omega_set = run.of_controller("omega_set");
    let away = run.between(40.02, 70.0);
    for i in [4, 6] {
        assert!(away.clone().all(|k| omega_set[i][k] == omega_set[i][away.start]), "agent {} holds", i + 1);
    }
    let staying: Vec<Vec<f64>> = [0, 1, 2, 3, 5].map(|i| p[i].clone()).to_vec();
    let (among, omega) = (run.spread(&staying, 65.0, 70.0), run.omega_error(65.0, 70.0));
    let back = (run.spread(&p, 90.0, 95.0), run.omega_error(90.0, 95.0));
    println!(
        "away: sharing among the others {among:.1e}, omega {omega:.1e}; back: {:.1e}, {:.1e}",
        back.0, back.1
    );
    assert!(among < 1e-5 && omega < 1e-5);
    assert!(back.0 < 1e-5 && back.1 < 1e-5);
    assert!(run.worst_sum_of_P_set() < 1e-9);
}

#[test]
fn a_cluster_whose_leader_leaves_elects_the_next() {
    let resolved = Resolved::load("plug_and_play", &keys(&[])).unwrap();
    let mut controller = Controller::new(resolved.control).unwrap();
    assert_eq!(controller.leaders(), [0, 6]);
    let mut events = Vec::new();
    for i in [4, 6] {
        controller.inputs_mut().available[i] = false;
    }
    controller.refresh(&mut |event| events.push(event));
    println!("{events:?}");
    // Of the pairs that are left between the clusters, BESS 3 and 6 are the nearest.
    assert!(events.contains(&Event::LeaderElected { agent: 6, cluster: 2 }), "an election is reported");
    assert_eq!(controller.leaders(), [2, 5]);
}

/// A path 1 - 2 - ... - 7, pinned at agent 1.
const PATH: &str = r#"[{"name": "path", "pins": [{"agent": 1}], "edges": [
    {"a": 1, "b": 2, "weight": 1}, {"a": 2, "b": 3, "weight": 1}, {"a": 3, "b": 4, "weight": 1},
    {"a": 4, "b": 5, "weight": 1}, {"a": 5, "b": 6, "weight": 1}, {"a": 6, "b": 7, "weight": 1}]}]"#;

#[test]
fn a_graph_that_falls_apart_is_reported_and_its_pinned_part_goes_on() {
    let lines: Arc<Mutex<Vec<(Category, String)>>> = Arc::default();
    let sink = Arc::clone(&lines);
    let events = r#"[{"at_s": 20, "set": {"controller.enable": true}},
        {"at_s": 50, "set": {"controller.available[4]": false}},
        {"at_s": 55, "set": {"grid.dP_load[12]": -0.5, "grid.dQ_load[12]": -0.5}}]"#;
    let set = [("communication.graphs", PATH), ("events", events), ("stop_s", "80"), NO_EXCHANGE];
    let resolved = Resolved::load("case1", &keys(&set)).unwrap();
    let run = with("case1", &set, |participants| {
        let model = models::Controller::new(models::Controller::resource(&resolved)).unwrap();
        let write = move |category: Category, line: std::fmt::Arguments<'_>| {
            sink.lock().unwrap().push((category, line.to_string()));
        };
        let logger = Logger::new(write, true);
        let instance = Instance::from_model(CONTROLLER, model, Interface::Structured, logger).unwrap();
        participants[0] = Box::new(InProcess::new(CONTROLLER, instance));
    });
    let lines = lines.lock().unwrap();
    let warned = |part: &str| lines.iter().any(|(c, line)| *c == Category::Warning && line.contains(part));
    println!("{lines:?}");
    assert!(warned("fell into 2 parts"), "the parting is a warning of the FMI logger");
    assert!(warned("5"), "the part that holds is named");
    let omega_set = run.of_controller("omega_set");
    let after = run.between(50.02, 80.0);
    for i in 3..N {
        assert!(after.clone().all(|k| omega_set[i][k] == omega_set[i][after.start]), "agent {} holds", i + 1);
    }
    for i in 0..3 {
        assert!(omega_set[i][after.end - 1] != omega_set[i][after.start], "agent {} goes on", i + 1);
    }
    let pinned: Vec<Vec<f64>> = run.p()[..3].to_vec();
    let (sharing, omega) = (run.spread(&pinned, 75.0, 80.0), run.omega_error(75.0, 80.0));
    println!("pinned part: sharing {sharing:.1e}, omega {omega:.1e}");
    assert!(sharing < 1e-6 && omega < 1e-6);
}

//! Properties of the grid model: fixed point, energy balance, step-size independence, both network
//! methods, load models, states.
#![cfg(feature = "grid")]
#![allow(
    non_snake_case,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests: the paper's letters; a failure may panic"
)]

use bess_consensus::grid::{
    Case, Config, GridError, GridModel, LoadModel, NetworkMethod, State, electrical_distances,
};

const MS: i64 = 1_000_000;
const S: i64 = 1_000 * MS;

fn started(config: &Config) -> GridModel {
    let mut model = GridModel::new(config).unwrap();
    model.initialise().unwrap();
    model
}

fn run(model: &mut GridModel, from_ns: i64, to_ns: i64, h_ns: i64) {
    let mut t = from_ns;
    while t < to_ns {
        model.step(t, h_ns).unwrap();
        t += h_ns;
    }
}

/// What the FMI shell asks of a model.
#[test]
fn the_model_can_be_cloned_and_sent() {
    fn asks<T: Clone + Send + 'static>() {}
    asks::<GridModel>();
}

/// P, Q, V, omega of all BESS.
fn outputs(model: &GridModel) -> Vec<f64> {
    (0..model.n()).flat_map(|i| [model.P(i), model.Q(i), model.V(i), model.omega(i)]).collect()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

const LOADS: [LoadModel; 3] =
    [LoadModel::Impedance, LoadModel::ConstantPower, LoadModel::Zip { Z: 0.3, I: 0.3, P: 0.4 }];

#[test]
fn the_steady_state_is_a_fixed_point() {
    for load_model in LOADS {
        for tie_closed_start in [false, true] {
            let config = Config { load_model, tie_closed_start, ..Config::case57() };
            let mut model = GridModel::new(&config).unwrap();
            // The tie alone cannot feed constant-power loads of 12.5 pu: its limit is near 10 pu.
            model.inputs_mut().P_set.fill(1.2);
            model.initialise().unwrap();
            let before = outputs(&model);
            let E: Vec<f64> = (0..7).map(|i| model.E(i)).collect();
            let start = model.state().clone();
            for h in [10 * MS, 10 * S] {
                model.set_state(&start).unwrap();
                run(&mut model, 0, 10 * S, h);
                let moved = difference(&outputs(&model), &before);
                println!("{load_model:?}, tie {tie_closed_start}, {} ms: moved {moved:.2e}", h / MS);
                assert!(moved < 1e-9, "{load_model:?}, tie {tie_closed_start}: moved {moved:.2e}");
            }
            for i in 0..7 {
                assert!((model.E(i) - (E[i] - model.P(i) * 10.0 / 3600.0)).abs() < 1e-9);
            }
        }
    }
}

/// Losses in the branches and consumption of the loads, from the bus voltages, element by element.
fn consumption(model: &GridModel, case: &Case, v0: &[f64]) -> (f64, f64) {
    let base = case.base_mva;
    let at = |id: u64| case.bus.iter().position(|b| b.id == id).unwrap();
    let (mut P, mut Q) = (0.0, 0.0);
    for (k, bus) in case.bus.iter().enumerate() {
        let v2 = model.bus_V(k).powi(2);
        P += (bus.gs + bus.pd / v0[k].powi(2)) / base * v2 + model.inputs().dP_load[k] * v2;
        Q += (bus.qd / v0[k].powi(2) - bus.bs) / base * v2 + model.inputs().dQ_load[k] * v2;
    }
    for branch in &case.branch {
        let tap = if branch.ratio == 0.0 { 1.0 } else { branch.ratio };
        let (f, t) = (at(branch.from), at(branch.to));
        let (vf, vt) = (model.bus_V(f) / tap, model.bus_V(t));
        let theta = model.bus_angle(f) - model.bus_angle(t) - branch.shift.to_radians();
        let through2 = vf * vf + vt * vt - 2.0 * vf * vt * theta.cos();
        let z2 = branch.r * branch.r + branch.x * branch.x;
        P += through2 * branch.r / z2;
        Q += through2 * branch.x / z2 - branch.b / 2.0 * (vf * vf + vt * vt);
    }
    (P, Q)
}

#[test]
fn what_is_sent_is_consumed() {
    let case = Case::built_in("case57").unwrap();
    let v0 = bess_consensus::grid::power_flow(&case, Default::default()).unwrap().vm;
    for tie_closed_start in [false, true] {
        let mut model = GridModel::new(&Config { tie_closed_start, ..Config::case57() }).unwrap();
        (model.inputs_mut().dP_load[11], model.inputs_mut().dQ_load[11]) = (-0.5, -0.5);
        (model.inputs_mut().dP_load[30], model.inputs_mut().dQ_load[30]) = (0.05, 0.02);
        model.initialise().unwrap();
        let (P, Q) = consumption(&model, &case, &v0);
        let sent_P = (0..7).map(|i| model.P(i)).sum::<f64>() + model.tie_P();
        // Sources are measured in front of X_c, the tie behind X.
        let in_X_c: f64 =
            (0..7).map(|i| 0.1 * (model.P(i).powi(2) + model.Q(i).powi(2)) / model.V(i).powi(2)).sum();
        let sent_Q = (0..7).map(|i| model.Q(i)).sum::<f64>() + model.tie_Q() - in_X_c;
        assert!((sent_P - P).abs() < 1e-10, "P sent {sent_P}, consumed {P}");
        assert!((sent_Q - Q).abs() < 1e-10, "Q sent {sent_Q}, consumed {Q}");
        assert_eq!(model.tie_P() != 0.0, tie_closed_start);
    }
}

/// Droop in closed form: with the tie closed every BESS must sit at omega = 1, islanded at one omega.
#[test]
fn droop_shares_power_as_its_equations_say() {
    let tied = started(&Config { tie_closed_start: true, ..Config::case57() });
    let config = Config::case57();
    for (i, bess) in config.bess.iter().enumerate() {
        assert!((tied.P(i) - (bess.omega_set_start - 1.0) / bess.K_P).abs() < 1e-10);
    }
    let islanded = started(&config);
    for i in 0..7 {
        assert!((islanded.omega(i) - islanded.omega(0)).abs() < 1e-13);
    }
}

fn without_loads() -> Case {
    let mut case = Case::built_in("case57").unwrap();
    case.bus.iter_mut().for_each(|bus| (bus.pd, bus.qd) = (0.0, 0.0));
    case
}

#[test]
fn constant_power_loads_hold_their_power() {
    let config = Config { load_model: LoadModel::ConstantPower, ..Config::case57() };
    let model = started(&config);
    // What is sent less the branch losses is the sum of the loads, at whatever voltage.
    let (losses, _) = consumption(&model, &without_loads(), &[1.0; 57]);
    let sent: f64 = (0..7).map(|i| model.P(i)).sum();
    assert!((sent - losses - 12.508).abs() < 1e-9, "{}", sent - losses);
}

/// A disturbed run, 3 s: load steps, tie, setpoints; communication step h.
fn disturbed(config: &Config, h_ns: i64) -> GridModel {
    let mut model = started(config);
    model.inputs_mut().omega_set[2] += 2e-3;
    model.inputs_mut().P_set[4] = 0.5;
    run(&mut model, 0, S, h_ns);
    (model.inputs_mut().dP_load[11], model.inputs_mut().dQ_load[11]) = (-0.5, -0.5);
    run(&mut model, S, 2 * S, h_ns);
    model.inputs_mut().tie_closed = true;
    run(&mut model, 2 * S, 3 * S, h_ns);
    model
}

#[test]
fn the_communication_step_does_not_matter() {
    for load_model in [LoadModel::Impedance, LoadModel::Zip { Z: 0.3, I: 0.3, P: 0.4 }] {
        let config = Config { load_model, ..Config::case57() };
        let fine = disturbed(&config, MS);
        for h in [10 * MS, 100 * MS, S] {
            let coarse = disturbed(&config, h);
            let d = difference(&outputs(&fine), &outputs(&coarse));
            println!("{load_model:?}: 1 ms against {} ms: {d:.2e}", h / MS);
            assert!(d < 1e-8, "{} ms: {d:.2e}", h / MS);
            for i in 0..7 {
                assert!((fine.state().delta[i] - coarse.state().delta[i]).abs() < 1e-7);
                assert!((fine.E(i) - coarse.E(i)).abs() < 1e-10);
            }
        }
    }
}

#[test]
fn dense_and_sparse_network_agree() {
    for load_model in LOADS {
        let dense = Config { load_model, network: NetworkMethod::Kron, ..Config::case57() };
        let sparse = Config { network: NetworkMethod::Sparse, ..dense.clone() };
        let (a, b) = (started(&dense), started(&sparse));
        assert!(a.is_dense() && !b.is_dense());
        assert!(difference(&outputs(&a), &outputs(&b)) < 1e-12);
        // From one and the same state, one disturbed step: rounding only.
        let mut a = disturbed(&dense, 100 * MS);
        let mut b = GridModel::new(&sparse).unwrap();
        b.set_state(a.state()).unwrap();
        b.refresh().unwrap();
        let volts = |m: &GridModel| (0..57).flat_map(|k| [m.bus_V(k), m.bus_angle(k)]).collect::<Vec<_>>();
        let d = difference(&volts(&a), &volts(&b));
        assert!(d < 1e-12, "{load_model:?}: bus voltages differ by {d:.2e}");
        assert!((a.tie_P() - b.tie_P()).abs() < 1e-11 && (a.tie_Q() - b.tie_Q()).abs() < 1e-11);
        a.step(0, 10 * MS).unwrap();
        b.step(0, 10 * MS).unwrap();
        let d = difference(&outputs(&a), &outputs(&b));
        println!("{load_model:?}: outputs differ by {d:.2e}");
        assert!(d < 1e-12, "{load_model:?}: outputs differ by {d:.2e}");
    }
}

#[test]
fn rollback_is_bit_identical_and_states_travel() {
    for load_model in LOADS {
        let config = Config { load_model, ..Config::case57() };
        let mut model = disturbed(&config, 10 * MS);
        let kept = model.state().clone();
        let go_on = |model: &mut GridModel| {
            model.inputs_mut().dP_load[7] = 0.3;
            run(model, 3 * S, 4 * S, 25 * MS);
            model.inputs_mut().tie_closed = false;
            run(model, 4 * S, 5 * S, 25 * MS);
            (model.state().clone(), model.bus_V(20).to_bits())
        };
        let first = go_on(&mut model);
        model.set_state(&kept).unwrap();
        assert_eq!(go_on(&mut model), first);
        // In another instance, through text; serde_json keeps every bit of a float.
        let text = serde_json::to_string(&kept).unwrap();
        let mut other = GridModel::new(&config).unwrap();
        other.set_state(&serde_json::from_str::<State>(&text).unwrap()).unwrap();
        assert_eq!(go_on(&mut other), first);
    }
}

#[test]
fn reading_changes_nothing() {
    let mut quiet = started(&Config::case57());
    let mut watched = quiet.clone();
    for k in 0..50 {
        let t = k * 20 * MS;
        for model in [&mut quiet, &mut watched] {
            model.inputs_mut().V_set[1] = 1.02 + 1e-4 * k as f64;
            model.step(t, 20 * MS).unwrap();
        }
        let _ = (watched.bus_V(3), watched.tie_P(), watched.refresh());
        watched.step(t + 20 * MS, 0).unwrap();
    }
    assert_eq!(quiet.state(), watched.state());
}

#[test]
fn damaged_states_and_inputs_are_refused_whole() {
    let mut model = started(&Config { tie: None, ..Config::case57() });
    let good = model.state().clone();
    let changes: [fn(&mut State); 7] = [
        |s| s.delta[3] = f64::NAN,
        |s| s.P.truncate(3),
        |s| s.inputs.dP_load.push(0.0),
        |s| s.inputs.tie_closed = true,
        |s| s.parameters.X_c[0] = 0.0,
        |s| s.internal_step_s = -1.0,
        |s| s.E[6] = f64::INFINITY,
    ];
    for change in changes {
        let mut bad = good.clone();
        change(&mut bad);
        assert!(matches!(model.set_state(&bad), Err(GridError::Invalid { .. })));
        assert_eq!(model.state(), &good);
    }
    model.inputs_mut().omega_set[2] = f64::NAN;
    let error = model.step(0, MS).unwrap_err().to_string();
    assert!(error.starts_with("omega_set[3]: found NaN"), "{error}");
}

/// That a network has no finite solution is found out by trying; what is read then is what was there before.
#[test]
fn a_state_without_a_network_leaves_the_readings() {
    for network in [NetworkMethod::Kron, NetworkMethod::Sparse] {
        let mut model = started(&Config { network, ..Config::case57() });
        model.step(0, 10 * MS).unwrap();
        let untouched = model.clone();
        let mut bad = model.state().clone();
        (bad.inputs.dP_load[11], bad.inputs.dQ_load[11]) = (f64::MAX, f64::MAX);
        assert!(matches!(model.set_state(&bad), Err(GridError::Singular { .. })));
        assert_eq!(model.state(), untouched.state());
        for b in 0..model.n_bus() {
            assert_eq!(model.bus_V(b).to_bits(), untouched.bus_V(b).to_bits(), "{network:?}, bus {b}");
        }
    }
}

#[test]
fn a_run_away_is_an_error_and_leaves_the_state() {
    let mut model = started(&Config::case57());
    // With Q this large the droop turns the voltage over, and Q grows like its square: infinite within
    // a fraction of a second.
    let mut state = model.state().clone();
    state.Q[2] = 1e3;
    model.set_state(&state).unwrap();
    let error = model.step(2 * S, S).unwrap_err();
    println!("{error}");
    assert!(matches!(error, GridError::Step { start_s, offset_s, .. } if start_s == 2.0 && offset_s < 1.0));
    assert_eq!(model.state(), &state);
    // And the model can go on from a sound state.
    state.Q[2] = 0.5;
    model.set_state(&state).unwrap();
    model.step(2 * S, S).unwrap();
}

#[test]
fn no_steady_state_says_what_to_look_at() {
    let mut model = GridModel::new(&Config::case57()).unwrap();
    model.inputs_mut().P_set[0] = 1e4;
    let error = model.initialise().unwrap_err().to_string();
    assert!(error.contains("P_set"), "{error}");
    assert!(matches!(model.step(0, MS), Err(GridError::Misuse { .. })));
    model.inputs_mut().P_set[0] = 0.0;
    model.initialise().unwrap();
}

#[test]
fn parameters_count_until_the_start() {
    let mut model = GridModel::new(&Config::case57()).unwrap();
    let parameters = model.parameters_mut();
    parameters.E_start[0] = 0.25;
    parameters.K_P[3] = 0.008;
    parameters.X_c[1] = 0.2;
    model.initialise().unwrap();
    let mut config = Config::case57();
    config.bess[0].E_start = 0.25;
    config.bess[3].K_P = 0.008;
    config.bess[1].X_c = 0.2;
    assert_eq!(model.state(), started(&config).state());
}

/// A generator without a BESS goes on with the power of the power flow, as a negative load.
#[test]
fn generators_without_a_battery_stay() {
    let mut config = Config { load_model: LoadModel::ConstantPower, ..Config::case57() };
    config.bess.retain(|b| b.bus != 8);
    let model = started(&config);
    let sent: f64 = (0..6).map(|i| model.P(i)).sum();
    let (losses, _) = consumption(&model, &without_loads(), &[1.0; 57]);
    // 12.508 pu of load, 4.5 pu of generation at bus 8.
    assert!((sent - losses - (12.508 - 4.5)).abs() < 1e-9, "{}", sent - losses);
}

/// Two buses joined by one line: its impedance, parallel to the shunts in series.
#[test]
fn the_electrical_distance_in_closed_form() {
    let case = Case::from_json(
        r#"{"base_mva": 100, "bus": [{"id": 4, "type": 3, "gs": 40}, {"id": 2, "type": 1, "pd": 50}],
            "branch": [{"from": 4, "to": 2, "r": 0.03, "x": 0.04}], "generator": [{"bus": 4}]}"#,
    )
    .unwrap();
    let v2 = bess_consensus::grid::power_flow(&case, Default::default()).unwrap().vm[1];
    let shunts = 1.0 / 0.4 + v2 * v2 / 0.5;
    let expected = 0.05 * shunts / (shunts + 0.03f64).hypot(0.04);
    let d = electrical_distances(&case, &[4, 2]).unwrap();
    assert!((d[0][1] - expected).abs() < 1e-12 && d[1][0] == d[0][1] && d[0][0] == 0.0, "{d:?}, {expected}");
}

/// DESIGN section 1: the 57-bus system falls into {1, 2, 3} and {6, 8, 9, 12}; here by the two clusters
/// of single linkage.
#[test]
fn electrical_distances_part_the_57_buses() {
    let buses = [1, 2, 3, 6, 8, 9, 12];
    let d = electrical_distances(&Case::built_in("case57").unwrap(), &buses).unwrap();
    let mut cluster: Vec<usize> = (0..7).collect();
    for _ in 0..5 {
        let pairs = (0..7).flat_map(|i| (0..i).map(move |j| (i, j)));
        let apart = pairs.filter(|&(i, j)| cluster[i] != cluster[j]);
        let (i, j) = apart.min_by(|a, b| d[a.0][a.1].total_cmp(&d[b.0][b.1])).unwrap();
        let (from, to) = (cluster[i], cluster[j]);
        cluster.iter_mut().filter(|c| **c == from).for_each(|c| *c = to);
    }
    println!("{d:.4?} {cluster:?}");
    assert!(cluster[..3].iter().all(|&c| c == cluster[0]));
    assert!(cluster[3..].iter().all(|&c| c == cluster[3] && c != cluster[0]), "{cluster:?}");
}

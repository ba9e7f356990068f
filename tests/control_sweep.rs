//! The sweep over many agents gives the bits of the step that does everything: a rate limit that never binds
//! keeps a controller from sweeping.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::communication;
use bess_consensus::control::config::{Discretisation, Limits};
use bess_consensus::control::{Config, Controller, Outputs};
use control_support::*;

/// A ring with chords, some of them long, and a few pins.
fn config(n: usize, random: &mut Random) -> Config {
    let mut edges: Vec<_> = (0..n).map(|i| edge(i, (i + 1) % n, random.within(0.2, 1.0))).collect();
    for _ in 0..n {
        let a = random.integer(0, n - 1);
        let b = (a + random.integer(2, n - 2)) % n;
        let new = |e: &&communication::ExplicitEdge| {
            let ends = [e.a as usize - 1, e.b as usize - 1];
            ends != [a, b] && ends != [b, a]
        };
        if a != b && edges.iter().filter(new).count() == edges.len() {
            edges.push(edge(a, b, random.within(0.2, 1.0)));
        }
    }
    with(n, edges, random)
}

/// A band: every agent talks to those a few numbers away. Of the edges some are missing, and in the middle third
/// a few far ones are added, so that diagonals without gaps, with gaps, and none at all are met.
fn band(n: usize, missing: f64, random: &mut Random) -> Config {
    let mut edges: Vec<_> = (0..n - 1).map(|i| edge(i, i + 1, random.within(0.2, 1.0))).collect();
    for i in 0..n {
        for far in [2, 4, 70] {
            if i + far < n && random.within(0.0, 1.0) >= missing {
                edges.push(edge(i, i + far, random.within(0.2, 1.0)));
            }
        }
        if i > n / 3 && i < n / 2 && i % 3 == 0 {
            edges.push(edge(i, i + 100 + i % 31, random.within(0.2, 1.0)));
        }
    }
    with(n, edges, random)
}

fn with(n: usize, edges: Vec<communication::ExplicitEdge>, random: &mut Random) -> Config {
    let pins = (0..3).map(|k| pin(k * n / 3, random.within(0.5, 1.0))).collect();
    Config {
        K_P: random.values(n, 0.002, 0.006),
        K_Q: random.values(n, 0.01, 0.03),
        capacity: random.values(n, 5.0, 20.0),
        P_exchange_max: random.values(n, 0.02, 1.0),
        omega_set_start: random.values(n, 0.998, 1.002),
        V_set_start: random.values(n, 1.0, 1.04),
        exchange_fade_s: 0.05,
        ..Config::unit(n, explicit(edges, pins))
    }
}

fn measure(controller: &mut Controller, k: usize, random: &mut Random) {
    let n = controller.agents();
    let setpoints: Vec<(f64, f64)> =
        (0..n).map(|i| (controller.outputs().omega_set[i], controller.outputs().V_set[i])).collect();
    let inputs = controller.inputs_mut();
    for (i, (omega, V)) in setpoints.into_iter().enumerate() {
        inputs.P[i] = random.within(0.0, 1.0);
        inputs.Q[i] = random.within(-0.5, 0.5);
        (inputs.omega[i], inputs.V[i]) = (omega - 0.004 * inputs.P[i], V - 0.02 * inputs.Q[i]);
        inputs.E[i] = random.within(5.0, 10.0);
    }
    inputs.enable = true;
    inputs.dispatch = k > 8;
    inputs.P_ref = 1e-4;
    inputs.available[n / 2] = !(4..7).contains(&k);
}

/// Outputs and memory, and whatever else a rollback brings back.
fn bits(controller: &Controller) -> Vec<u8> {
    postcard::to_allocvec(controller.state()).unwrap()
}

fn same_bits(n: usize, eta: f64, discretisation: Discretisation) {
    let mut random = Random(n as u64 + 1);
    let plain = Config { eta, discretisation, ..config(n, &mut random) };
    same_bits_of(plain, random);
}

fn same_bits_of(plain: Config, mut random: Random) {
    let (n, eta) = (plain.agents(), plain.eta);
    let limits = Limits { omega_set_rate: Some(vec![1e300; n]), ..Limits::default() };
    let (mut swept, mut whole) =
        (Controller::new(plain.clone()).unwrap(), Controller::new(Config { limits, ..plain }).unwrap());
    for k in 0..14 {
        let mut again = Random(random.next() | 1);
        let mut once_more = Random(again.0);
        measure(&mut swept, k, &mut again);
        measure(&mut whole, k, &mut once_more);
        let start_ns = k as i64 * 10_000_000;
        swept.refresh(&mut |_| {});
        whole.refresh(&mut |_| {});
        assert!(bits(&swept) == bits(&whole), "refreshed, n = {n}, eta = {eta}, step {k}");
        swept.step(start_ns, 10_000_000, &mut |_| {});
        whole.step(start_ns, 10_000_000, &mut |_| {});
        assert!(bits(&swept) == bits(&whole), "n = {n}, eta = {eta}, step {k}");
    }
    let moved = swept.outputs().u_omega.iter().filter(|u| **u != 0.0).count();
    assert!(moved > n / 2 && swept.outputs().saturated.contains(&true), "something was compared");
}

#[test]
fn few_agents_and_many_at_all_exponents() {
    for n in [4, 6, 7, 8, 255, 257, 1000] {
        for eta in [0.5, 0.3, 1.0] {
            same_bits(n, eta, Discretisation::Capped);
        }
    }
}

#[test]
fn very_few_agents() {
    for n in [2, 3] {
        let mut random = Random(n as u64 + 1);
        let edges = (1..n).map(|i| edge(i - 1, i, random.within(0.2, 1.0))).collect();
        let chain =
            Config { communication: explicit(edges, vec![pin(1, 0.7)]), ..with(n, Vec::new(), &mut random) };
        same_bits_of(chain, random);
    }
}

/// What each droop shows of the setpoints of the step before.
fn measure_late(controller: &mut Controller, before: &Outputs, random: &mut Random) {
    let (K_P, K_Q) = (controller.parameters().K_P.clone(), controller.parameters().K_Q.clone());
    let inputs = controller.inputs_mut();
    for i in 0..K_P.len() {
        inputs.P[i] = random.within(0.0, 1.0);
        inputs.Q[i] = random.within(-0.5, 0.5);
        inputs.omega[i] = before.omega_set[i] - K_P[i] * (inputs.P[i] - before.P_set[i]);
        inputs.V[i] = before.V_set[i] - K_Q[i] * (inputs.Q[i] - before.Q_set[i]);
        inputs.E[i] = random.within(5.0, 10.0);
    }
    inputs.enable = true;
}

#[test]
fn late_measurements() {
    for n in [7, 300] {
        let mut random = Random(n as u64);
        let plain = config(n, &mut random);
        let limits = Limits { omega_set_rate: Some(vec![1e300; n]), ..Limits::default() };
        let mut swept = Controller::new(plain.clone()).unwrap();
        let mut whole = Controller::new(Config { limits, ..plain }).unwrap();
        let mut before = swept.outputs().clone();
        for k in 0..12 {
            let (mut again, mut once_more) = (Random(random.0), Random(random.0));
            random.next();
            measure_late(&mut swept, &before, &mut again);
            measure_late(&mut whole, &before, &mut once_more);
            before = swept.outputs().clone();
            swept.step(k * 10_000_000, 10_000_000, &mut |_| {});
            whole.step(k * 10_000_000, 10_000_000, &mut |_| {});
            assert_eq!(swept.outputs(), whole.outputs(), "n = {n}, step {k}");
        }
        assert_eq!((swept.lags(), whole.lags()), ([1, 1], [1, 1]), "n = {n}: nothing was late");
    }
}

#[test]
fn the_bare_law() {
    for n in [7, 8, 300] {
        same_bits(n, 0.5, Discretisation::Explicit);
    }
}

#[test]
fn along_diagonals_with_and_without_gaps() {
    // The last has more agents than give evidence of how late measurements are.
    for (n, missing, etas) in
        [(300, 0.0, &[0.5, 0.3][..]), (480, 0.2, &[0.5, 0.3]), (480, 0.8, &[0.5]), (9000, 0.1, &[0.5])]
    {
        for &eta in etas {
            let mut random = Random(n as u64 + 1);
            let plain = Config { eta, ..band(n, missing, &mut random) };
            same_bits_of(plain, random);
        }
    }
}

/// What a step that nobody sees does not make.
fn without_diagnostics(outputs: &Outputs) -> Outputs {
    Outputs {
        spread_P: 0.0,
        spread_Q: 0.0,
        spread_E: 0.0,
        error_omega: 0.0,
        error_V: 0.0,
        lambda_2: 0.0,
        T_P: 0.0,
        T_omega: 0.0,
        ..outputs.clone()
    }
}

#[test]
fn a_step_that_nobody_sees_moves_alike() {
    for n in [4, 5, 7, 8, 300] {
        let mut random = Random(n as u64);
        let mut seen = Controller::new(config(n, &mut random)).unwrap();
        let (mut unseen, mut looked_at) = (seen.clone(), seen.clone());
        for k in 0..14 {
            let start_ns = k as i64 * 10_000_000;
            let again = random.next() | 1;
            for controller in [&mut seen, &mut unseen, &mut looked_at] {
                measure(controller, k, &mut Random(again));
            }
            looked_at.refresh(&mut |_| {});
            assert!(k == 0 || looked_at.outputs().spread_P > 0.0);
            seen.step(start_ns, 10_000_000, &mut |_| {});
            unseen.step_unseen(start_ns, 10_000_000, &mut |_| {});
            looked_at.step_unseen(start_ns, 10_000_000, &mut |_| {});
            assert!(bits(&unseen) == bits(&looked_at), "n = {n}, step {k}: a look between steps shows");
            let [moved, expected] = [&unseen, &seen].map(|c| without_diagnostics(c.outputs()));
            assert_eq!(moved, expected, "n = {n}, step {k}");
            let mut after = [seen.clone(), unseen.clone()];
            after.iter_mut().for_each(|controller| controller.refresh(&mut |_| {}));
            assert!(bits(&after[0]) == bits(&after[1]), "n = {n}, step {k}, refreshed");
        }
        assert!(seen.outputs().T_P > 0.0 && unseen.outputs().T_P == 0.0, "n = {n}: nothing was spared");
    }
}

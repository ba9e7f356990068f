//! Grids beyond 57 buses: warm power flows against fresh ones, both network methods against each other,
//! the steady state as a fixed point.
#![cfg(feature = "grid")]
#![allow(
    non_snake_case,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests: the paper's letters; a failure may panic"
)]

mod grid_support;

use bess_consensus::grid::{
    Case, Config, GridModel, LoadModel, NetworkMethod, PowerFlowSolver, Start, Tie, power_flow,
};
use grid_support::{Numbers, mesh};

const MS: i64 = 1_000_000;

fn case_of(config: &Config) -> Case {
    config.case.resolve().unwrap()
}

/// Power that leaves each bus, element by element from the pi model, without a matrix.
fn power_leaving(case: &Case, vm: &[f64], va: &[f64]) -> Vec<(f64, f64)> {
    let mut out: Vec<(f64, f64)> = case
        .bus
        .iter()
        .zip(vm)
        .map(|(b, v)| (b.gs / case.base_mva * v * v, -b.bs / case.base_mva * v * v))
        .collect();
    for branch in &case.branch {
        let (f, t) = (case.position(branch.from).unwrap(), case.position(branch.to).unwrap());
        let tap = if branch.ratio == 0.0 { 1.0 } else { branch.ratio };
        let (g, b) = {
            let z2 = branch.r * branch.r + branch.x * branch.x;
            (branch.r / z2, -branch.x / z2)
        };
        for (own, other, at, theta) in [
            (vm[f] / tap, vm[t], f, va[f] - va[t] - branch.shift.to_radians()),
            (vm[t], vm[f] / tap, t, va[t] - va[f] + branch.shift.to_radians()),
        ] {
            let (sin, cos) = theta.sin_cos();
            out[at].0 += own * own * g - own * other * (g * cos + b * sin);
            out[at].1 += -own * own * (b + branch.b / 2.0) - own * other * (g * sin - b * cos);
        }
    }
    out
}

#[test]
fn two_thousand_buses_balance() {
    let case = case_of(&mesh(2000, 20));
    let solution = power_flow(&case, Start::Flat).unwrap();
    let leaving = power_leaving(&case, &solution.vm, &solution.va);
    for (k, bus) in case.bus.iter().enumerate() {
        let generated: f64 = case.generator.iter().filter(|g| g.bus == bus.id).map(|g| g.pg).sum();
        if bus.kind != 3 {
            assert!((leaving[k].0 - (generated - bus.pd) / 100.0).abs() < 1e-9, "bus {}", bus.id);
        }
        if bus.kind == 1 {
            assert!((leaving[k].1 + bus.qd / 100.0).abs() < 1e-9, "bus {}", bus.id);
        } else {
            assert!((solution.vm[k] - 1.02).abs() < 1e-15);
        }
    }
}

#[test]
fn a_warm_power_flow_is_the_fresh_one() {
    for case in [Case::built_in("case57").unwrap(), case_of(&mesh(2000, 20))] {
        let mut numbers = Numbers::new(7);
        let mut solver = PowerFlowSolver::new(&case, Start::Case).unwrap();
        solver.solve().unwrap();
        let mut changed = case.clone();
        for _ in 0..10 {
            let b = numbers.below(case.bus.len() as u32) as usize;
            let (p, q) = (6.0 * numbers.unit(), 2.0 * numbers.unit());
            (changed.bus[b].pd, changed.bus[b].qd) = (p, q);
            solver.set_load(b, p / case.base_mva, q / case.base_mva).unwrap();
            assert!((solver.load(b).0 - p / case.base_mva).abs() < 1e-14);
            let warm = solver.solve().unwrap();
            let fresh = power_flow(&changed, Start::Case).unwrap();
            assert!(warm.iterations <= fresh.iterations.max(3) && warm.pivoted == 0);
            for k in 0..case.bus.len() {
                // Mismatches below 1e-10 pu, short-circuit power of a few pu per bus and some 100 buses in line.
                assert!((solver.vm(k) - fresh.vm[k]).abs() < 1e-8);
                assert!((solver.va(k) - fresh.va[k]).abs() < 1e-8);
            }
        }
    }
}

#[test]
fn an_impossible_load_leaves_the_solution() {
    let case = Case::built_in("case57").unwrap();
    let mut solver = PowerFlowSolver::new(&case, Start::Case).unwrap();
    solver.solve().unwrap();
    let solution =
        |s: &PowerFlowSolver| (0..57).map(|b| (s.vm(b), s.va(b), s.injection(b))).collect::<Vec<_>>();
    let before = solution(&solver);
    let (p, q) = solver.load(30);
    solver.set_load(30, 50.0, 0.0).unwrap();
    let error = solver.solve().unwrap_err().to_string();
    assert!(error.contains("case57") && error.contains("at bus"), "{error}");
    assert_eq!(solution(&solver), before);
    for (b, p) in [(57, 0.1), (3, f64::NAN)] {
        assert!(solver.set_load(b, p, 0.0).is_err());
    }
    assert!(solver.set_tolerance(0.0).is_err());
    solver.set_load(30, p, q).unwrap();
    assert_eq!(solver.solve().unwrap().iterations, 0);
}

#[test]
fn warm_solves_are_reproducible_to_the_bit() {
    let case = case_of(&mesh(500, 20));
    let run = || {
        let mut solver = PowerFlowSolver::new(&case, Start::Flat).unwrap();
        solver.solve().unwrap();
        for k in 0..5 {
            solver.set_load(40 * k + 3, 0.05, 0.01).unwrap();
            solver.solve().unwrap();
        }
        (0..500).flat_map(|b| [solver.vm(b).to_bits(), solver.va(b).to_bits()]).collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
}

/// A second of a grid with 100 BESS through the dense and the sparse network, a load step and a tie on the way.
#[test]
fn dense_and_sparse_networks_agree_on_two_thousand_buses() {
    let mut config = mesh(2000, 20);
    config.tie = Some(Tie { bus: 41, X: 0.05 });
    let simulate = |network: NetworkMethod| {
        let mut model = GridModel::new(&Config { network, ..config.clone() }).unwrap();
        assert_eq!(model.is_dense(), network == NetworkMethod::Kron);
        model.initialise().unwrap();
        for k in 0..100 {
            if k == 30 {
                (model.inputs_mut().dP_load[777], model.inputs_mut().dQ_load[777]) = (0.3, 0.1);
            }
            if k == 60 {
                model.inputs_mut().tie_closed = true;
            }
            model.step(k * 10 * MS, 10 * MS).unwrap();
        }
        let sources = (0..model.n()).flat_map(|i| [model.P(i), model.Q(i), model.V(i), model.omega(i)]);
        let buses = (0..model.n_bus()).map(|b| model.bus_V(b));
        sources.chain(buses).chain([model.tie_P(), model.tie_Q()]).collect::<Vec<f64>>()
    };
    let (dense, sparse) = (simulate(NetworkMethod::Kron), simulate(NetworkMethod::Sparse));
    let worst = dense.iter().zip(&sparse).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("dense against sparse after 1 s: {worst:.1e}");
    // Rounding moves the integrator's choice of steps, whose tolerance is 1e-9.
    assert!(worst < 1e-8, "{worst:.1e}");
}

#[test]
fn the_steady_state_of_two_thousand_buses_is_a_fixed_point() {
    for load_model in [LoadModel::Impedance, LoadModel::ConstantPower] {
        for tie_closed_start in [false, true] {
            let mut config = Config { load_model, tie_closed_start, ..mesh(2000, 20) };
            config.tie = Some(Tie { bus: 41, X: 0.05 });
            let mut model = GridModel::new(&config).unwrap();
            // Each source's share of the load; the tie alone could not feed 28 pu.
            model.inputs_mut().P_set.fill(0.285);
            model.initialise().unwrap();
            let outputs = |m: &GridModel| (0..m.n()).flat_map(|i| [m.P(i), m.Q(i)]).collect::<Vec<f64>>();
            let before = outputs(&model);
            (0..10).for_each(|k| model.step(k * 100 * MS, 100 * MS).unwrap());
            let moved = outputs(&model).iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(moved < 1e-9, "{load_model:?}, tie {tie_closed_start}: {moved:.1e}");
            if tie_closed_start {
                (0..model.n()).for_each(|i| assert!((model.omega(i) - 1.0).abs() < 1e-11));
            }
        }
    }
}

//! What a step costs; for a person: `cargo test --release ... --test grid_timing -- --ignored --nocapture`.
#![cfg(feature = "grid")]
#![allow(
    non_snake_case,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests: the paper's letters; a failure may panic"
)]

use bess_consensus::grid::{Bess, Branch, Case, CaseSource, Config, GridModel, LoadModel, NetworkMethod};
use std::time::Instant;

/// Mean over a batch; of many repeats the best of ten batches, as other programs share the machine.
fn microseconds(repeats: u32, mut what: impl FnMut()) -> f64 {
    let batches = if repeats >= 1000 { 10 } else { 1 };
    let mut batch = || {
        let start = Instant::now();
        (0..repeats / batches).for_each(|_| what());
        start.elapsed().as_secs_f64() * 1e6 / f64::from(repeats / batches)
    };
    (0..batches).map(|_| batch()).fold(f64::INFINITY, f64::min)
}

#[test]
#[ignore = "measures, asserts nothing"]
fn cost_of_a_step() {
    for (network, load_model) in [
        (NetworkMethod::Kron, LoadModel::Impedance),
        (NetworkMethod::Sparse, LoadModel::Impedance),
        (NetworkMethod::Kron, LoadModel::ConstantPower),
    ] {
        let config = Config { network, load_model, ..Config::case57() };
        let mut model = GridModel::new(&config).unwrap();
        model.initialise().unwrap();
        const H: i64 = 10_000_000;
        println!("{network:?}, {load_model:?}, 57 buses, 10 ms communication step, us each:");
        println!("  steady            {:8.2}", microseconds(2000, || model.step(0, H).unwrap()));
        println!("                    {:?}", model.effort());
        model.inputs_mut().omega_set[2] += 2e-3;
        (model.inputs_mut().dP_load[11], model.inputs_mut().dQ_load[11]) = (-0.5, -0.5);
        println!("  first 0.2 s after a load step {:8.2}", microseconds(20, || model.step(0, H).unwrap()));
        println!("                    {:?}", model.effort());
        println!("  first 2 s after   {:8.2}", microseconds(180, || model.step(0, H).unwrap()));
        println!("  a setpoint moves in every step {:8.2}", {
            let mut k = 0;
            microseconds(2000, || {
                k += 1;
                model.inputs_mut().omega_set[k % 7] += if k % 14 < 7 { 1e-5 } else { -1e-5 };
                model.step(0, H).unwrap();
                model.refresh().unwrap();
            })
        });
        println!("                    {:?}", model.effort());
        println!("  reading all buses {:8.2}", {
            microseconds(2000, || {
                model.refresh().unwrap();
                std::hint::black_box((model.bus_V(3), model.tie_P()));
            })
        });
        println!("  network rebuild on a load change {:8.2}", {
            let mut k = 0;
            microseconds(2000, || {
                k += 1;
                model.inputs_mut().dP_load[11] = -0.5 + 1e-6 * f64::from(k);
                model.refresh().unwrap();
            })
        });
        println!(
            "  one hour in one step {:8.0}",
            microseconds(1, || model.step(0, 3_600_000_000_000).unwrap())
        );
        println!("  initialise        {:8.2}", microseconds(10, || model.initialise().unwrap()));
        println!("  new               {:8.2}", microseconds(3, || drop(GridModel::new(&config).unwrap())));
    }
}

/// Copies of the 57-bus system in a chain, each with its seven BESS.
fn chain(copies: u64) -> Config {
    let unit = Case::built_in("case57").unwrap();
    let one = Config::case57();
    let mut case = Case { bus: vec![], branch: vec![], generator: vec![], ..unit.clone() };
    let mut bess = vec![];
    for k in 0..copies {
        let id = |id: u64| id + 100 * k;
        for bus in &unit.bus {
            let kind = if k > 0 && bus.kind == 3 { 2 } else { bus.kind };
            case.bus.push(bess_consensus::grid::Bus { id: id(bus.id), kind, ..bus.clone() });
        }
        for branch in &unit.branch {
            case.branch.push(Branch { from: id(branch.from), to: id(branch.to), ..branch.clone() });
        }
        if k > 0 {
            case.branch.push(Branch {
                from: 100 * k - 99,
                to: id(1),
                r: 0.01,
                x: 0.1,
                ..unit.branch[0].clone()
            });
        }
        for generator in &unit.generator {
            let pg = if generator.bus == 1 { 478.66 } else { generator.pg };
            case.generator.push(bess_consensus::grid::Generator {
                bus: id(generator.bus),
                pg,
                ..generator.clone()
            });
        }
        bess.extend(one.bess.iter().map(|b| Bess { bus: id(b.bus), ..b.clone() }));
    }
    Config { case: CaseSource::Inline(Box::new(case)), bess, ..one }
}

#[test]
#[ignore = "measures, asserts nothing"]
fn dense_or_sparse() {
    for (copies, keep) in [(20, 140), (20, 60), (100, 100), (100, 700), (200, 100), (200, 400)] {
        for network in [NetworkMethod::Kron, NetworkMethod::Sparse] {
            let mut config = Config { network, ..chain(copies) };
            config.bess.truncate(keep);
            let start = Instant::now();
            let mut model = GridModel::new(&config).unwrap();
            let new = start.elapsed().as_secs_f64();
            let start = Instant::now();
            model.initialise().unwrap();
            let initialise = start.elapsed().as_secs_f64();
            println!(
                "{} buses, {keep} BESS, {network:?}: new {new:.3} s, initialise {initialise:.3} s, 10 ms step {:.0} us, rebuild {:.0} us",
                model.n_bus(),
                microseconds(20, || model.step(0, 10_000_000).unwrap()),
                {
                    let mut k = 0;
                    microseconds(5, || {
                        k += 1;
                        model.inputs_mut().dP_load[11] = -0.5 + 1e-6 * f64::from(k);
                        model.refresh().unwrap();
                    })
                }
            );
        }
    }
}

//! What a step costs; for a person: `cargo test --release ... --test grid_timing -- --ignored --nocapture`.
#![cfg(feature = "grid")]

use bess_consensus::grid::{Config, GridModel, LoadModel, NetworkMethod};
use std::time::Instant;

fn microseconds(repeats: u32, mut what: impl FnMut()) -> f64 {
    let start = Instant::now();
    (0..repeats).for_each(|_| what());
    start.elapsed().as_secs_f64() * 1e6 / f64::from(repeats)
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

//! The controller on small plants with a network: average voltage, limits of power, the exchange's limits.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::Config;
use bess_consensus::control::config::{Limits, SocLimits, VoltagePolicy};
use control_support::*;
use nalgebra::{DMatrix, DVector};

/// A resistive-like network for reactive power: Q = Q_load + Y (V - 1), V = V_set - K_Q Q.
struct ReactiveNetwork {
    inverse: DMatrix<f64>,
    Y: DMatrix<f64>,
    load: DVector<f64>,
    K_Q: f64,
}

impl ReactiveNetwork {
    fn ring(n: usize, K_Q: f64, random: &mut Random) -> Self {
        let mut Y = DMatrix::<f64>::zeros(n, n);
        for i in 0..n {
            let (j, y) = ((i + 1) % n, random.within(2.0, 8.0));
            for (a, b) in [(i, j), (j, i)] {
                Y[(a, a)] += y;
                Y[(a, b)] -= y;
            }
        }
        // The loads take more at a higher voltage.
        for i in 0..n {
            Y[(i, i)] += 0.5;
        }
        let inverse = (DMatrix::identity(n, n) + K_Q * &Y).try_inverse().unwrap();
        Self { inverse, Y, load: DVector::from_vec(random.values(n, 0.1, 0.5)), K_Q }
    }

    /// (V, Q) at these setpoints.
    fn solve(&self, V_set: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let ones = DVector::from_element(V_set.len(), 1.0);
        let right = DVector::from_column_slice(V_set) - self.K_Q * (&self.load - &self.Y * &ones);
        let V = &self.inverse * right;
        let Q = &self.load + &self.Y * (&V - ones);
        (V.as_slice().to_vec(), Q.as_slice().to_vec())
    }
}

#[test]
fn the_average_policy_shares_q_and_restores_the_mean_through_leaving_and_joining() {
    for delay_s in [0.0, 0.5] {
        let (n, K_Q) = (7, 0.05);
        let network = ReactiveNetwork::ring(n, K_Q, &mut Random(21));
        let mut config = Config::unit(n, two_groups());
        config.K_Q = vec![K_Q; n];
        config.voltage_policy = VoltagePolicy::Average;
        config.delay_s = delay_s;
        let mut controller = enabled(config);
        let (h_ns, mut now_ns) = (20_000_000, 0);
        let mut run = |available: bool, steps: usize| {
            for _ in 0..steps {
                let (V, Q) = network.solve(&controller.outputs().V_set);
                let inputs = controller.inputs_mut();
                (inputs.V, inputs.Q) = (V, Q);
                inputs.available[3] = available;
                controller.step(now_ns, h_ns, &mut |_| {});
                now_ns += h_ns;
            }
            let (V, Q) = network.solve(&controller.outputs().V_set);
            let there: Vec<usize> = (0..n).filter(|&i| available || i != 3).collect();
            let mean = there.iter().map(|&i| V[i]).sum::<f64>() / there.len() as f64;
            let q: Vec<f64> = there.iter().map(|&i| K_Q * Q[i]).collect();
            (mean - 1.0, spread(&q))
        };
        let bar = if delay_s == 0.0 { 1e-9 } else { 1e-4 };
        for (phase, available) in [("all", true), ("without agent 4", false), ("all again", true)] {
            let (mean, shared) = run(available, 10_000);
            println!("tau {delay_s}, {phase}: mean V off by {mean:.1e}, spread of K_Q Q {shared:.1e}");
            assert!(mean.abs() < bar && shared < bar, "tau {delay_s}, {phase}: {mean} {shared}");
        }
    }
}

#[test]
fn powers_stay_within_their_limits_and_the_others_go_on() {
    let n = 5;
    let edges = (0..n).map(|i| edge(i, (i + 1) % n, 1.0)).collect();
    let mut config = Config::unit(n, explicit(edges, vec![pin(0, 1.0)]));
    let mut P_max = vec![10.0; n];
    P_max[2] = 0.6;
    config.limits = Limits { P_max: Some(P_max), ..Limits::default() };
    config.K_P = vec![0.01; n];
    let mut controller = enabled(config);
    // A single-node grid: one frequency, the load shared by the droops; all SoC equal.
    let load = 5.0;
    for k in 0..20_000 {
        let omega_set = &controller.outputs().omega_set;
        let omega = (omega_set.iter().sum::<f64>() - 0.01 * load) / n as f64;
        let P: Vec<f64> = omega_set.iter().map(|set| (set - omega) / 0.01).collect();
        let inputs = controller.inputs_mut();
        inputs.P = P;
        inputs.omega.fill(omega);
        controller.step(k * 10_000_000, 10_000_000, &mut |_| {});
    }
    let P = &controller.inputs().P;
    println!("P = {P:?}, frequency off by {:.1e}", controller.outputs().error_omega);
    assert!((P[2] - 0.6).abs() < 1e-3, "{P:?}");
    assert!([0, 1, 3, 4].iter().all(|&i| (P[i] - 1.1).abs() < 1e-2), "{P:?}");
    assert!(controller.outputs().error_omega < 1e-6, "the frequency is restored all the same");
    assert!(controller.outputs().saturated[2] && !controller.outputs().saturated[0]);
}

#[test]
fn the_exchange_respects_its_limits_edge_by_edge() {
    let n = 4;
    let edges: Vec<_> = (0..n).map(|i| edge(i, (i + 1) % n, 1.0)).collect();
    let run = |change: &dyn Fn(&mut Config), P: [f64; 4], E: [f64; 4]| {
        let mut config = Config::unit(n, explicit(edges.clone(), vec![pin(0, 1.0)]));
        change(&mut config);
        let mut controller = enabled(config);
        let inputs = controller.inputs_mut();
        inputs.P.copy_from_slice(&P);
        inputs.E.copy_from_slice(&E);
        controller.step(0, 10_000_000, &mut |_| {});
        let out = controller.outputs();
        assert!(out.P_set.iter().sum::<f64>().abs() < 1e-14);
        out.P_set.clone()
    };
    let uneven = [0.9, 0.5, 0.5, 0.5];
    // Two edges of agent 1 at half its limit of 1 pu each.
    assert_eq!(run(&|_| {}, [1.0; 4], uneven), [1.0, -0.5, 0.0, -0.5]);
    // Agent 2 discharges 0.3 pu and may not charge; it has two edges.
    assert_eq!(run(&|c| c.no_circulation = true, [1.0, 0.3, 1.0, 1.0], uneven), [0.65, -0.15, 0.0, -0.5]);
    // A ramp of 1 pu/s over 10 ms, shared by two edges.
    let ramped = run(&|c| c.limits.P_set_rate = Some(vec![1.0; 4]), [1.0; 4], uneven);
    assert!(largest_gap(&ramped, &[0.01, -0.005, 0.0, -0.005]) < 1e-15, "{ramped:?}");
    // A power limit of 1.2 pu leaves 0.2 pu beside a share of 1 pu.
    let limited = run(&|c| c.limits.P_max = Some(vec![1.2; 4]), [1.0; 4], uneven);
    assert!(largest_gap(&limited, &[0.2, -0.1, 0.0, -0.1]) < 1e-14, "{limited:?}");
    // An empty battery gives nothing, though it is the fullest.
    let empty = run(
        &|c| {
            c.limits.P_max = Some(vec![9.0; 4]);
            c.limits.SoC = Some(SocLimits { min: 0.95, max: 1.0, taper: 0.01 });
        },
        [0.0; 4],
        uneven,
    );
    assert_eq!(empty, [0.0; 4]);
}

//! Limits, the no-circulation rule and the fade of the exchange on the 57-bus grid under a master whose
//! measurements are 0 to 3 steps late. Prints its figures (`-- --nocapture`).
#![cfg(all(feature = "controller", feature = "grid"))]
#![allow(non_snake_case, clippy::unwrap_used)]

use bess_consensus::control::Controller;
use bess_consensus::control::communication::{
    Communication, Inside, StepByStep, StepByStepTopology, Weights,
};
use bess_consensus::control::config::{Config, Limits};
use bess_consensus::grid::{self, GridModel, electrical_distances};
use std::collections::VecDeque;

const N: usize = 7;
/// States of charge at the start.
const SOC: [f64; N] = [0.78, 0.8, 0.73, 0.74, 0.77, 0.7, 0.68];

/// P, Q, V, omega, E of all batteries.
type Measured = [Vec<f64>; 5];

/// Controller and grid, the measurements on their way between them.
struct Late {
    controller: Controller,
    grid: GridModel,
    on_their_way: VecDeque<Measured>,
    h_ns: i64,
    now_ns: i64,
}

/// The batteries and the step-by-step graph of Case 1.
fn config(gain_E: f64, limits: Limits) -> Config {
    let grid = grid::Config::case57();
    let buses: Vec<u64> = grid.bess.iter().map(|b| b.bus).collect();
    let distances = electrical_distances(&grid.case.resolve().unwrap(), &buses).unwrap();
    let topologies = vec![StepByStepTopology { name: "a3".into(), inside: Inside::Tree }];
    let communication =
        Communication::StepByStep(StepByStep { distances, weights: Weights::InverseDistance, topologies });
    let of_each = |value: fn(&grid::Bess) -> f64| grid.bess.iter().map(value).collect::<Vec<f64>>();
    let mut config = Config::unit(N, communication);
    (config.K_P, config.K_Q) = (of_each(|b| b.K_P), of_each(|b| b.K_Q));
    config.capacity = of_each(|b| 0.002 / b.K_P);
    config.omega_set_start = of_each(|b| b.omega_set_start);
    config.V_set_start = of_each(|b| b.V_set_start);
    (config.gains.E, config.exchange_fade_s, config.limits) = (gain_E, 2.0, limits);
    config
}

impl Late {
    fn new(config: Config, lag: usize, h_ms: i64) -> Self {
        let mut grid = GridModel::new(&grid::Config::case57()).unwrap();
        for (i, C) in config.capacity.iter().enumerate() {
            grid.parameters_mut().E_start[i] = SOC[i] * C;
        }
        grid.initialise().unwrap();
        let controller = Controller::new(config).unwrap();
        let mut late =
            Self { controller, grid, on_their_way: VecDeque::new(), h_ns: h_ms * 1_000_000, now_ns: 0 };
        late.on_their_way = vec![late.measure(); lag].into();
        late.run(2.0, |_| {});
        late.controller.inputs_mut().enable = true;
        late
    }

    fn measure(&self) -> Measured {
        let of = |value: &dyn Fn(usize) -> f64| (0..N).map(value).collect::<Vec<f64>>();
        let grid = &self.grid;
        [
            of(&|i| grid.P(i)),
            of(&|i| grid.Q(i)),
            of(&|i| grid.V(i)),
            of(&|i| grid.omega(i)),
            of(&|i| grid.E(i)),
        ]
    }

    fn run(&mut self, duration_s: f64, mut seen: impl FnMut(&Self)) {
        for _ in 0..(duration_s * 1e9) as i64 / self.h_ns {
            let (out, inputs) = (self.controller.outputs(), self.grid.inputs_mut());
            inputs.omega_set.copy_from_slice(&out.omega_set);
            inputs.V_set.copy_from_slice(&out.V_set);
            inputs.P_set.copy_from_slice(&out.P_set);
            self.grid.refresh().unwrap();
            self.on_their_way.push_back(self.measure());
            let [P, Q, V, omega, E] = self.on_their_way.pop_front().unwrap();
            let told = self.controller.inputs_mut();
            (told.P, told.Q, told.V, told.omega, told.E) = (P, Q, V, omega, E);
            self.controller.step(self.now_ns, self.h_ns, &mut |_| {});
            self.grid.step(self.now_ns, self.h_ns).unwrap();
            self.now_ns += self.h_ns;
            seen(self);
        }
    }

    fn off_nominal(&self) -> f64 {
        (0..N).map(|i| (self.grid.omega(i) - 1.0).abs()).fold(0.0, f64::max)
    }

    /// Runs for `duration_s`; the time until `figure` stays within `tolerance`, and the largest error of the
    /// frequency in the last fifth.
    fn settles(&mut self, duration_s: f64, tolerance: f64, figure: impl Fn(&Self) -> f64) -> (f64, f64) {
        let start_ns = self.now_ns;
        let (mut settled_s, mut omega) = (0.0, 0.0);
        self.run(duration_s, |late| {
            let t_s = (late.now_ns - start_ns) as f64 * 1e-9;
            if figure(late) > tolerance {
                settled_s = t_s;
            }
            if t_s > 0.8 * duration_s {
                omega = late.off_nominal().max(omega);
            }
        });
        (settled_s, omega)
    }
}

/// Limit of BESS `which` (from 0) alone.
fn only(which: usize, value: f64) -> Option<Vec<f64>> {
    let mut all = vec![10.0; N];
    all[which] = value;
    Some(all)
}

#[test]
fn power_limits_hold_whatever_the_lag() {
    // At 1 s the consensus itself takes a minute or two; there it is the end that counts.
    for (h_ms, within, duration_s, omega_bar) in
        [(10, 10.0, 100.0, 1e-9), (100, 20.0, 100.0, 1e-5), (1000, 240.0, 300.0, 1e-5)]
    {
        for lag in 0..=3 {
            for which in [0, 3] {
                let P_max = config(0.0, Limits { P_max: only(which, 1.5), ..Limits::default() });
                let (P_s, omega) =
                    Late::new(P_max, lag, h_ms).settles(duration_s, 1.5 * 1e-3, |l| l.grid.P(which) - 1.5);
                let Q_max = config(0.0, Limits { Q_max: only(which, 0.3), ..Limits::default() });
                let (Q_s, omega_Q) =
                    Late::new(Q_max, lag, h_ms).settles(duration_s, 0.3 * 0.01, |l| l.grid.Q(which) - 0.3);
                println!(
                    "{h_ms} ms, {lag} late, BESS {}: P_max to 0.1 % in {P_s:.2} s, omega {omega:.1e}; Q_max to 1 % in {Q_s:.2} s, omega {omega_Q:.1e}",
                    which + 1
                );
                assert!(P_s < within && Q_s < within);
                assert!(omega < omega_bar && omega_Q < omega_bar);
            }
        }
    }
}

#[test]
fn nobody_is_made_to_charge_whatever_the_lag() {
    for (h_ms, within) in [(10, 10.0), (100, 20.0), (1000, 240.0)] {
        for lag in 0..=3 {
            let mut config = config(0.02, Limits::default());
            config.no_circulation = true;
            config.capacity.iter_mut().for_each(|C| *C *= 10.0);
            let mut late = Late::new(config, lag, h_ms);
            // So little load that the exchange would turn the takers into chargers.
            for (bus, dP) in [(11, -3.7), (7, -1.4), (8, -1.2), (0, -0.5), (5, -0.7)] {
                late.grid.inputs_mut().dP_load[bus] = dP;
            }
            let charging = |l: &Late| (0..N).map(|i| -l.grid.P(i)).fold(0.0, f64::max);
            let (settled_s, omega) = late.settles(300.0, 1e-3, charging);
            let sum: f64 = late.controller.outputs().P_set.iter().sum();
            let taken = late.controller.outputs().P_set.iter().fold(0.0, |w: f64, P| w.min(*P));
            println!(
                "{h_ms} ms, {lag} late: nobody charges above 1e-3 pu after {settled_s:.2} s, one takes {taken:.3} pu, omega {omega:.1e}"
            );
            assert!(sum.abs() < 1e-12 && taken < -0.3);
            assert!(settled_s < within, "{h_ms} ms, {lag} late: {settled_s} s");
        }
    }
}

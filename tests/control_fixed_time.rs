//! The fixed-time law in the agent loop: no start, however far, takes longer than the certified bound; with
//! the finite-time law the time grows with the start.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::config::Law;
use control_support::*;

/// How far from consensus the starts are, about pu: far beyond what a grid survives.
const SCALES: [f64; 3] = [1.0, 100.0, 10_000.0];
/// Errors below this count as consensus, pu: outside the boundary layers of all steps here.
const NEAR: f64 = 0.02;

/// A run: when P agreed and omega was at its reference, s, and what was certified for this start and for any.
struct Run {
    settled: [f64; 2],
    certified: [f64; 2],
    bounds: Option<[f64; 2]>,
}

fn run(graph: u64, law: Law, scale: f64, h_ns: i64) -> Run {
    let mut random = Random(100 + graph);
    let n = random.integer(4, 8);
    let (edges, pins) = random_graph(&mut random, n);
    let mut start = Sample::random(&mut random, n);
    start.P.iter_mut().for_each(|P| *P *= scale);
    start.omega.iter_mut().for_each(|omega| *omega = 1.0 + 10.0 * scale * (*omega - 1.0));
    let mut config = agent_model(n, 0.5, explicit(edges, pins), &start);
    config.law = law;
    // Not looked at here, and far out of this world.
    config.gains.E = 0.0;
    let mut coupled = Loop::new(config, &start);
    coupled.discharging = false;
    let out = coupled.controller.outputs();
    let certified = [out.T_P, out.T_omega];
    let spectrum = coupled.controller.spectrum();
    let bound = |tie: &bess_consensus::control::Tie| tie.fixed_time.map(|fixed| fixed.bound(0.5));
    let bounds = bound(&spectrum.P).zip(bound(&spectrum.omega)).map(|(P, omega)| [P, omega]);
    let mut settled = [f64::INFINITY; 2];
    while settled.contains(&f64::INFINITY) {
        coupled.step(h_ns);
        let errors = [spread(&coupled.plant.P), largest_gap(&coupled.plant.omega, &vec![1.0; n])];
        for (settled, error) in settled.iter_mut().zip(errors) {
            *settled = if error < NEAR { settled.min(coupled.plant.t) } else { f64::INFINITY };
        }
        assert!(coupled.plant.t < 1e4, "graph {graph}, {law:?}, scale {scale}: {errors:?}");
    }
    Run { settled, certified, bounds }
}

#[test]
fn no_start_takes_longer_than_the_fixed_time_bound() {
    let law = Law::FixedTime { alpha: 1.0, beta: 1.0 };
    for graph in 0..10 {
        let runs = SCALES.map(|scale| run(graph, law, scale, 1_000_000));
        let bounds = runs[0].bounds.unwrap();
        for (run, scale) in runs.iter().zip(SCALES) {
            println!(
                "graph {graph}, start {scale}: settled {:.2?} s, certified {:.2?} s, bound {bounds:.2?} s",
                run.settled, run.certified
            );
            assert_eq!(run.bounds, Some(bounds), "the bound knows no start");
            for q in 0..2 {
                assert!(run.settled[q] < run.certified[q] && run.certified[q] < bounds[q]);
            }
        }
    }
}

#[test]
fn the_finite_time_law_takes_the_longer_the_farther_the_start() {
    for graph in 0..10 {
        let runs = SCALES.map(|scale| run(graph, Law::FiniteTime, scale, 10_000_000));
        for q in 0..2 {
            let times = runs.each_ref().map(|run| run.settled[q]);
            // A homogeneous law: 100^(1 - eta) = 10 times as long, but for the last stretch to NEAR.
            println!("graph {graph}, quantity {q}: {times:.2?} s");
            assert!((9.5..12.0).contains(&(times[2] / times[1])), "graph {graph}: {times:?}");
            assert!(times[1] > 5.0 * times[0], "graph {graph}: {times:?}");
            assert!(runs.iter().all(|run| run.settled[q] < run.certified[q]), "graph {graph}");
        }
    }
}

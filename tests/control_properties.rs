//! Properties that hold on every graph: certificates, information flow, symmetry, stability of the capped
//! law for every step.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::certificates::settling_time;
use bess_consensus::control::config::Law;
use bess_consensus::control::delay::{History, Quantity, Signals};
use bess_consensus::control::discretisation::{Flow, SignPower};
use bess_consensus::control::graph::{Edge, Graph};
use bess_consensus::control::network::{Lateness, Network};
use bess_consensus::control::protocol::{View, active_power, frequency};
use bess_consensus::control::spectrum::smallest;
use bess_consensus::control::{Config, Controller};
use control_support::*;

/// A random graph of 5 to 30 agents, prepared, and its largest w (1 + deg), pins included.
fn random_network(random: &mut Random) -> (Network, f64) {
    let n = random.integer(5, 30);
    let (edges, pins) = random_graph(random, n);
    let mut a0 = vec![0.0; n];
    for p in &pins {
        a0[p.agent as usize - 1] = p.weight;
    }
    let edges = edges.iter().map(|e| Edge::new(e.a as usize - 1, e.b as usize - 1, e.weight));
    let network = Network::new(Graph::new(n, edges.collect(), a0));
    let shares = network.graph.edges().iter().zip(&network.shares).map(|(e, share)| e.weight / share);
    let widest = shares.chain(network.pins.iter().map(|p| p.weight / p.share)).fold(0.0, f64::max);
    (network, widest)
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn centred(mut x: Vec<f64>) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    x.iter_mut().for_each(|x| *x -= mean);
    x
}

/// The rate of the errors under the law of P (`pinned` false) or of omega.
struct Rates {
    history: History,
    signals: Signals,
    zeros: Vec<f64>,
}

impl Rates {
    fn new(n: usize) -> Self {
        Self { history: History::new(n, 0), signals: Signals::new(n), zeros: vec![0.0; n] }
    }

    fn of(&mut self, network: &Network, pinned: bool, e: &[f64], flow: &Flow, u: &mut [f64]) {
        let quantity = if pinned { Quantity::Omega } else { Quantity::P };
        self.signals.of_mut(quantity).copy_from_slice(e);
        let view = View {
            network,
            history: &self.history,
            signals: &self.signals,
            told: &self.signals,
            late: Lateness::default(),
        };
        if pinned {
            frequency(view, flow, &self.zeros, 0.0, u);
        } else {
            active_power(view, flow, None, u);
        }
    }
}

/// Without any sampling: the certificates are d norm(e)/dt <= -lambda^((1+eta)/2) norm(e)^eta, integrated;
/// the inequality is looked at in random states, near-consensus and clustered ones among them.
#[test]
fn the_inequality_behind_the_certificates_holds_on_10000_graphs() {
    let mut random = Random(1);
    let mut tightest = f64::INFINITY;
    for _ in 0..10_000 {
        let (network, _) = random_network(&mut random);
        let n = network.graph.agents();
        let eta = random.within(0.1, 0.9);
        let mut rates = Rates::new(n);
        let mut u = vec![0.0; n];
        for pinned in [false, true] {
            let lambda = smallest(&network.graph, &vec![true; n], 1.0, 2.0 / (1.0 + eta), pinned).value;
            for state in 0..3 {
                let mut e = random.values(n, -1.0, 1.0);
                if state == 1 {
                    // Two camps, the states in which Laplacians are tightest.
                    let border = random.within(-1.0, 1.0);
                    e.iter_mut().for_each(|e| *e = if *e < border { -0.3 } else { 0.7 });
                }
                let scale = random.within(-6.0, 1.0);
                e.iter_mut().for_each(|e| *e *= 10f64.powf(scale));
                let e = if pinned { e } else { centred(e) };
                let flow = Flow::new(SignPower::new(Law::FiniteTime, eta), 1.0, 0.0);
                rates.of(&network, pinned, &e, &flow, &mut u);
                let r = norm(&e);
                // One camp for all leaves rounding only.
                if r < 1e-9 * 10f64.powf(scale) {
                    continue;
                }
                let rate = -e.iter().zip(&u).map(|(e, u)| e * u).sum::<f64>() / r;
                let certified = lambda.powf(0.5 * (1.0 + eta)) * r.powf(eta);
                assert!(
                    rate >= certified * (1.0 - 1e-9),
                    "n {n}, eta {eta}, pinned {pinned}: {rate} {certified}"
                );
                tightest = tightest.min(rate / certified);
            }
        }
    }
    println!("tightest ratio of rate to certificate: {tightest:.3}");
}

/// Sampled trajectories stay below the certified envelope, norm(e)^(1-eta) <= norm(e_0)^(1-eta) (1 - t/T).
///
/// Sampling is allowed for by the boundary layer alone: an edge is capped where abs(d)^(1-eta) is below
/// theta w (1 + deg), so norm(e)^(1-eta) may lag by that much times n^((1-eta)/2) (n agents at that
/// distance); the step is chosen such that this is 10 % of the start. The run ends when the error is inside.
#[test]
fn no_sampled_trajectory_is_slower_than_its_certificate() {
    let graphs = (10_000.0 * scale()) as usize;
    // The longest test of the room, shared between two cores.
    std::thread::scope(|scope| {
        for seed in [2, 3] {
            scope.spawn(move || compare_with_certificates(seed, graphs / 2));
        }
    });
}

fn compare_with_certificates(seed: u64, graphs: usize) {
    let mut random = Random(seed);
    let (mut steps, mut slowest) = (0u64, 0.0_f64);
    for _ in 0..graphs {
        let (network, widest) = random_network(&mut random);
        let n = network.graph.agents();
        let eta = random.within(0.1, 0.9);
        let mut rates = Rates::new(n);
        let mut u = vec![0.0; n];
        let pinned = random.integer(0, 1) == 1;
        let mut e = random.values(n, -0.5, 0.5);
        if !pinned {
            e = centred(e);
        }
        let lambda = smallest(&network.graph, &vec![true; n], 1.0, 2.0 / (1.0 + eta), pinned).value;
        let T = settling_time(norm(&e), lambda, eta);
        let start = norm(&e).powf(1.0 - eta);
        let crowd = (n as f64).powf(0.5 * (1.0 - eta));
        let h = 0.1 * start / (widest * crowd);
        let flow = Flow::new(SignPower::new(Law::FiniteTime, eta), 1.0, h);
        let mut t = 0.0;
        loop {
            rates.of(&network, pinned, &e, &flow, &mut u);
            e.iter_mut().zip(&u).for_each(|(e, u)| *e += h * u);
            t += h;
            steps += 1;
            let now = norm(&e).powf(1.0 - eta) / start;
            assert!(
                now <= (1.0 - t / T).max(0.0) + 0.1,
                "n {n}, eta {eta}, pinned {pinned}: {now} at {t} of {T}"
            );
            if now <= 0.1 {
                break;
            }
        }
        slowest = slowest.max(t / T);
    }
    println!("{graphs} graphs, {steps} steps; the slowest took {slowest:.3} of its certified time");
}

#[test]
fn the_certificate_is_exact_for_two_agents() {
    for (eta, w) in [(0.5, 0.8), (0.2, 1.0), (0.8, 0.4)] {
        let start = Sample {
            P: vec![1.4, 0.6],
            omega: vec![1.0, 1.0],
            E: vec![0.5, 0.5],
            V: vec![1.0; 2],
            Q: vec![0.5; 2],
            t: 0.0,
        };
        let config = || agent_model(2, eta, explicit(vec![edge(0, 1, w)], vec![pin(0, 1.0)]), &start);
        // d' = -2 w d^eta.
        let exact = 0.8_f64.powf(1.0 - eta) / ((1.0 - eta) * 2.0 * w);
        let half = |steps: i64| {
            let mut coupled = Loop::new(config(), &start);
            let T = coupled.controller.outputs().T_P;
            assert!((T - exact).abs() < 1e-12 * exact, "{T} {exact}");
            let h_ns = (0.5 * exact * 1e9 / steps as f64) as i64;
            for _ in 0..steps {
                coupled.step(h_ns);
            }
            coupled.tell();
            coupled.controller.refresh(&mut |_| {});
            // What has passed and what is certified to come.
            coupled.plant.t + coupled.controller.outputs().T_P
        };
        // Euler's error is of the first order in h: extrapolated away.
        let total = 2.0 * half(20_000) - half(10_000);
        assert!((total - exact).abs() < 1e-6 * exact, "eta {eta}: {total} {exact}");
    }
}

/// A controller on a random graph with random measurements told, after some steps.
fn running(random: &mut Random, n: usize, change: impl Fn(&mut Config)) -> (Loop, Sample) {
    let (edges, pins) = random_graph(random, n);
    let start = Sample::random(random, n);
    let mut config = Config::unit(n, explicit(edges, pins));
    config.K_P = random.values(n, 0.5, 1.5);
    config.capacity = random.values(n, 0.5, 1.5);
    change(&mut config);
    let mut coupled = Loop::new(config, &start);
    for _ in 0..5 {
        coupled.step(10_000_000);
    }
    (coupled, start)
}

fn five_inputs(controller: &Controller, i: usize) -> [u64; 5] {
    let out = controller.outputs();
    [out.u_omega[i], out.u_P[i], out.u_E[i], out.u_V[i], out.u_Q[i]].map(f64::to_bits)
}

#[test]
fn an_agent_hears_its_neighbours_and_nobody_else() {
    let mut random = Random(3);
    for round in 0..200 {
        let n = random.integer(5, 15);
        let (coupled, _) = running(&mut random, n, |config| {
            config.delay_s = if round % 2 == 0 { 0.0 } else { 0.02 };
            config.no_circulation = round % 3 == 0;
        });
        let changed = random.integer(0, n - 1);
        let [mut plain, mut disturbed] = [coupled.controller.clone(), coupled.controller];
        let inputs = disturbed.inputs_mut();
        for x in [&mut inputs.P, &mut inputs.Q, &mut inputs.V, &mut inputs.omega, &mut inputs.E] {
            x[changed] += random.within(0.01, 0.1);
        }
        for controller in [&mut plain, &mut disturbed] {
            controller.step(50_000_000, 10_000_000, &mut |_| {});
        }
        let graph = plain.network().graph.clone();
        for i in 0..n {
            let hears = i == changed || graph.neighbours(i).contains(&(changed as u32));
            let same = five_inputs(&plain, i) == five_inputs(&disturbed, i);
            if !hears {
                assert!(same, "agent {i} felt agent {changed}, {:?}", graph.neighbours(i));
            } else if i == changed {
                assert!(!same, "agent {i} did not feel itself");
            }
        }
    }
}

#[test]
fn numbering_the_agents_otherwise_numbers_the_outputs_otherwise() {
    let mut random = Random(4);
    for _ in 0..100 {
        let n = random.integer(3, 12);
        let (edges, pins) = random_graph(&mut random, n);
        let start = Sample::random(&mut random, n);
        let mut new_of: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            new_of.swap(i, random.integer(0, i));
        }
        let moved = |x: &[f64]| {
            let mut y = vec![0.0; n];
            (0..n).for_each(|i| y[new_of[i]] = x[i]);
            y
        };
        let there = |i: u32| new_of[i as usize - 1];
        let edges_there = edges.iter().map(|e| edge(there(e.a), there(e.b), e.weight)).rev().collect();
        let pins_there = pins.iter().map(|p| pin(there(p.agent), p.weight)).collect();
        let start_there = Sample {
            t: 0.0,
            omega: moved(&start.omega),
            P: moved(&start.P),
            E: moved(&start.E),
            V: moved(&start.V),
            Q: moved(&start.Q),
        };
        let mut here = Loop::new(agent_model(n, 0.6, explicit(edges, pins), &start), &start);
        let mut other =
            Loop::new(agent_model(n, 0.6, explicit(edges_there, pins_there), &start_there), &start_there);
        for _ in 0..20 {
            here.step(10_000_000);
            other.step(10_000_000);
        }
        let (a, b) = (here.controller.outputs(), other.controller.outputs());
        for (x, y, tolerance) in [
            (&a.omega_set, &b.omega_set, 1e-12),
            (&a.V_set, &b.V_set, 1e-12),
            (&a.u_omega, &b.u_omega, 1e-9),
            // Powers of up to 2000 pu.
            (&a.P_set, &b.P_set, 1e-6),
        ] {
            assert!(largest_gap(&moved(x), y) < tolerance, "{}", largest_gap(&moved(x), y));
        }
        for (x, y) in
            [(a.spread_P, b.spread_P), (a.T_P, b.T_P), (a.T_omega, b.T_omega), (a.lambda_2, b.lambda_2)]
        {
            assert!((x - y).abs() <= 1e-9 * x.abs().max(1e-3), "{x} {y}");
        }
    }
}

/// In a stable step no agent leaves the hull of the values: x(k+1) is a mean of x(k). E is looked at
/// without discharge, which would move the hull itself.
fn stays_in_its_hull(mut coupled: Loop, h_ns: i64, steps: usize) -> [f64; 5] {
    coupled.discharging = false;
    for k in 0..steps {
        let before = coupled.plant.clone();
        coupled.step(h_ns);
        for (q, (x, y)) in before.quantities().into_iter().zip(coupled.plant.quantities()).enumerate() {
            let leader = if q == 0 || q == 3 { 1.0 } else { x[0] };
            let low = x.iter().copied().fold(leader, f64::min) - 1e-12;
            let high = x.iter().copied().fold(leader, f64::max) + 1e-12;
            assert!(
                y.iter().all(|y| (low..=high).contains(y)),
                "quantity {q}, step {k} of {h_ns} ns: {x:?} {y:?}"
            );
        }
    }
    let mut left = [0.0; 5];
    for (left, x) in left.iter_mut().zip(coupled.plant.quantities()) {
        *left = spread(x);
    }
    left
}

#[test]
fn the_capped_law_is_stable_for_steps_of_10_ms_to_10_s_on_1000_graphs() {
    let mut random = Random(5);
    for _ in 0..1000 {
        let n = random.integer(5, 30);
        let (edges, pins) = random_graph(&mut random, n);
        let start = Sample::random(&mut random, n);
        let eta = random.within(0.1, 1.0);
        let h_ns = (1e9 * 10f64.powf(random.within(-2.0, 1.0))) as i64;
        let config = agent_model(n, eta, explicit(edges, pins), &start);
        stays_in_its_hull(Loop::new(config, &start), h_ns, 40);
    }
}

#[test]
fn rings_of_two_and_of_even_length_settle_at_every_step() {
    let mut random = Random(6);
    for n in [2, 4, 6, 8, 12] {
        for h_ns in [10_000_000, 100_000_000, 1_000_000_000, 10_000_000_000] {
            let edges = (0..if n == 2 { 1 } else { n }).map(|i| edge(i, (i + 1) % n, 1.0)).collect();
            // Alternating values are what an even ring oscillates in, if it does.
            let mut start = Sample::random(&mut random, n);
            for x in [&mut start.P, &mut start.Q, &mut start.E, &mut start.omega, &mut start.V] {
                x.iter_mut().enumerate().for_each(|(i, x)| *x = if i % 2 == 0 { 1.1 } else { 0.9 });
            }
            let config = agent_model(n, 0.5, explicit(edges, vec![pin(0, 1.0)]), &start);
            let left = stays_in_its_hull(Loop::new(config, &start), h_ns, 1500);
            assert!(left.iter().all(|&left| left < 1e-6), "ring of {n}, {h_ns} ns: {left:?}");
        }
    }
}

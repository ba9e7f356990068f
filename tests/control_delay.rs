//! What must hold on every graph however late the messages are: the capped law keeps everybody in the hull of
//! the start and settles, the estimates of the mean keep their sum and settle, and both together find the mean.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used)]

mod control_support;

use bess_consensus::control::Config;
use bess_consensus::control::communication::ExplicitEdge;
use bess_consensus::control::config::{Channel, Law, VoltagePolicy};
use bess_consensus::control::delay::{History, Quantity, Signals};
use bess_consensus::control::discretisation::{Flow, SignPower};
use bess_consensus::control::estimator::{advance, estimates};
use bess_consensus::control::graph::{Edge, Graph};
use bess_consensus::control::network::{Hearing, Network};
use control_support::*;

/// The longest delay, s.
const LATEST: f64 = 2.0;

/// How the delays of a graph are drawn: none, one for all (then true), one for each edge, some edges without any.
fn delays(random: &mut Random, edges: &mut [ExplicitEdge]) -> bool {
    let kind = random.integer(0, 3);
    let common = random.within(0.0, LATEST);
    for e in edges {
        let own = random.within(0.0, LATEST);
        e.delay_s = Some(match kind {
            0 => 0.0,
            1 => common,
            2 => own,
            _ if random.integer(0, 1) == 0 => 0.0,
            _ => own,
        });
    }
    kind < 2
}

/// A step of 10 ms to 1 s, ns.
fn step_ns(random: &mut Random) -> i64 {
    (1e9 * 10f64.powf(random.within(-2.0, 0.0))) as i64
}

/// An estimator alone, the voltages at rest.
struct Estimator {
    network: Network,
    channel: Channel,
    history: History,
    signals: Signals,
    flow: Flow,
    received_ns: Vec<i64>,
    transfers: Vec<f64>,
    sample: u64,
    h_ns: i64,
}

impl Estimator {
    fn new(n: usize, edges: &[ExplicitEdge], channel: Channel, eta: f64, h_ns: i64) -> Self {
        let of = |e: &ExplicitEdge| Edge {
            delay_ns: e.delay_s.map(|s| (s * 1e9) as i64),
            ..Edge::new(e.a as usize - 1, e.b as usize - 1, e.weight)
        };
        let mut network = Network::new(Graph::new(n, edges.iter().map(of).collect(), vec![0.0; n]));
        network.set_delay(0, &channel, None);
        let edges = network.delays_ns.len();
        let mut history = History::new(n, network.longest_delay_ns() + channel.horizon_ns());
        history.keep_transfers(edges);
        // A gain with which the boundary layer, that the theory is about, reaches beyond all differences here.
        let flow = Flow::new(SignPower::new(Law::FiniteTime, eta), 1e6, h_ns as f64 * 1e-9);
        let (received_ns, transfers) = (vec![i64::MIN; 2 * edges], vec![0.0; edges]);
        Self {
            network,
            channel,
            history,
            signals: Signals::new(n),
            flow,
            received_ns,
            transfers,
            sample: 0,
            h_ns,
        }
    }

    /// The estimates of the mean of `V` now, and a step on.
    fn step(&mut self, V: &[f64]) -> Vec<f64> {
        let now_ns = self.sample as i64 * self.h_ns;
        let mut vbar = V.to_vec();
        estimates(&self.network, &self.transfers, V, &mut vbar);
        self.signals.of_mut(Quantity::MeanV).copy_from_slice(&vbar);
        let last_ns = self.received_ns.clone();
        let now = (now_ns, self.sample);
        let hearing = Hearing { channel: &self.channel, silence_ns: None, mute: &[] };
        self.network.listen(&self.history, now, hearing, &last_ns, &mut self.received_ns);
        let before = self.transfers.clone();
        let Self { network, history, signals, flow, transfers, .. } = self;
        let flow = &*flow;
        advance(network, history, signals, [flow, flow], self.h_ns, &before, transfers);
        self.history.push(now_ns, &self.signals, &before);
        self.sample += 1;
        vbar
    }
}

/// Rounds of the slowest link, each of the longest delay and a step, until the estimates of `V` are all within
/// `left` of the first spread of their mean, and stay there for two rounds. The sum is looked at in every step.
fn rounds_to_the_mean(estimator: &mut Estimator, V: &[f64], left: f64, limit: f64) -> f64 {
    let n = V.len() as f64;
    let mean = V.iter().sum::<f64>() / n;
    let round_ns = estimator.network.longest_delay_ns() + estimator.h_ns;
    let start = spread(V);
    let mut held_ns = 0;
    loop {
        let vbar = estimator.step(V);
        assert!((vbar.iter().sum::<f64>() / n - mean).abs() < 1e-12, "the sum is exact at every instant");
        let worst = vbar.iter().fold(0.0_f64, |w, x| w.max((x - mean).abs()));
        assert!(worst < 2.0 * n.sqrt() * start, "{worst} from {start}");
        held_ns = if worst < left * start { held_ns + estimator.h_ns } else { 0 };
        let rounds = (estimator.sample as f64) * (estimator.h_ns as f64) / round_ns as f64;
        if held_ns > 2 * round_ns {
            return rounds;
        }
        assert!(rounds < limit, "{worst} of {start} is left after {rounds} rounds");
    }
}

/// Rounds in which Metropolis steps lose one e-fold, from power iteration on the weights 1 / (1 + max deg) of a
/// graph without pins: a lower bound of the speed of any edge's share here.
fn rounds_by_theory(n: usize, edges: &[ExplicitEdge]) -> f64 {
    let mut degree = vec![0.0; n];
    let ends: Vec<(usize, usize)> = edges.iter().map(|e| (e.a as usize - 1, e.b as usize - 1)).collect();
    for &(a, b) in &ends {
        degree[a] += 1.0;
        degree[b] += 1.0;
    }
    let mut x: Vec<f64> = (0..n).map(|i| ((i as f64 + 1.0) * 0.618_033_988_7).fract()).collect();
    let mut factor = 0.0;
    for _ in 0..5000 {
        let mean = x.iter().sum::<f64>() / n as f64;
        x.iter_mut().for_each(|x| *x -= mean);
        let before = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        x.iter_mut().for_each(|x| *x /= before);
        let mut y = x.clone();
        for &(a, b) in &ends {
            let f = (x[a] - x[b]) / (1.0 + f64::max(degree[a], degree[b]));
            // A lazy step, so that the eigenvalue nearest to 1 is the largest in magnitude.
            y[a] -= 0.5 * f;
            y[b] += 0.5 * f;
        }
        factor = y.iter().map(|x| x * x).sum::<f64>().sqrt();
        x = y;
    }
    -1.0 / (2.0 * factor - 1.0).ln()
}

/// Where all delays are equal the rounds are Metropolis steps, and their rate is known. Where they are not, links of
/// nearly equal delay that close a cycle ring against each other: circulating transfers, of which hardly anything
/// shows in the estimates, and which fade as slowly as the delays are alike. So the rate is asked for down to
/// 1e-3 of the start only, and beyond that only that the rest goes, too.
#[test]
fn the_estimates_settle_on_1000_graphs_with_delays_up_to_2_s() {
    let mut random = Random(11);
    let mut slowest = [0.0_f64; 3];
    for _ in 0..1000 {
        let n = random.integer(5, 30);
        let (mut edges, _) = random_graph(&mut random, n);
        let equal = delays(&mut random, &mut edges);
        let h_ns = step_ns(&mut random);
        let V: Vec<f64> = random.values(n, -1.0, 1.0).iter().map(|x| 1.0 + 1e-4 * x).collect();
        let theory = rounds_by_theory(n, &edges);
        let eta = random.within(0.1, 0.9);
        let mut estimator = Estimator::new(n, &edges, Channel::default(), eta, h_ns);
        // What the start has of the slowest mode is its norm at most, sqrt(n) of its largest; and the two rounds that
        // it has to hold, and the two until the first messages are back.
        let rounds_for = |left: f64| theory * (n as f64).sqrt().ln() - theory * left.ln() + 5.0;
        if equal {
            let rounds = rounds_to_the_mean(&mut estimator, &V, 1e-6, rounds_for(1e-6));
            slowest[0] = slowest[0].max(rounds / rounds_for(1e-6));
        } else {
            let rounds = rounds_to_the_mean(&mut estimator, &V, 1e-3, rounds_for(1e-3));
            slowest[1] = slowest[1].max(rounds / rounds_for(1e-3));
            let rounds = rounds_to_the_mean(&mut estimator, &V, 1e-6, 1e5);
            slowest[2] = slowest[2].max(rounds / rounds_for(1e-6));
        }
    }
    println!("longest, as a share of the rounds by theory: {slowest:.2?}");
}

#[test]
fn the_estimates_settle_with_late_and_lost_messages() {
    let mut random = Random(12);
    for seed in 0..100 {
        let n = random.integer(5, 20);
        let (mut edges, _) = random_graph(&mut random, n);
        delays(&mut random, &mut edges);
        let channel = Channel { jitter_s: random.within(0.0, 0.5), loss: random.within(0.0, 0.3), seed };
        let V: Vec<f64> = random.values(n, -1.0, 1.0).iter().map(|x| 1.0 + 1e-4 * x).collect();
        let mut estimator = Estimator::new(n, &edges, channel, 0.5, 100_000_000);
        // Nothing is known of the rate.
        rounds_to_the_mean(&mut estimator, &V, 1e-6, 1e5);
    }
}

/// The agent model (5)-(6) under all laws, each edge late by up to 2 s.
fn delayed(random: &mut Random, policy: VoltagePolicy) -> Loop {
    let n = random.integer(5, 30);
    let (mut edges, pins) = random_graph(random, n);
    delays(random, &mut edges);
    let start = Sample::random(random, n);
    let mut config: Config = agent_model(n, random.within(0.1, 0.9), explicit(edges, pins), &start);
    config.voltage_policy = policy;
    config.gains.E = 0.0;
    let mut coupled = Loop::new(config, &start);
    coupled.discharging = false;
    coupled
}

#[test]
fn the_capped_law_keeps_the_hull_and_settles_on_1000_graphs_with_delays_up_to_2_s() {
    let mut random = Random(13);
    for round in 0..1000 {
        let mut coupled = delayed(&mut random, VoltagePolicy::Paper);
        let h_ns = step_ns(&mut random).max(100_000_000);
        let start = coupled.plant.clone();
        let figures = |x: &Sample| {
            let omega = x.omega.iter().fold(0.0_f64, |w, x| w.max((x - 1.0).abs()));
            [spread(&x.P), spread(&x.Q), omega]
        };
        let (before, mut steps) = (figures(&start), 0);
        loop {
            coupled.step(h_ns);
            steps += 1;
            for (leader, x, y) in [
                (start.P[0], &start.P, &coupled.plant.P),
                (start.Q[0], &start.Q, &coupled.plant.Q),
                (1.0, &start.omega, &coupled.plant.omega),
                (1.0, &start.V, &coupled.plant.V),
            ] {
                let low = x.iter().copied().fold(leader, f64::min) - 1e-12;
                let high = x.iter().copied().fold(leader, f64::max) + 1e-12;
                assert!(y.iter().all(|y| (low..=high).contains(y)), "graph {round}, step {steps}");
            }
            let now = figures(&coupled.plant);
            if now.iter().zip(before).all(|(now, before)| *now < 1e-3 * before) {
                break;
            }
            assert!(steps as i64 * h_ns < 10_000_000_000_000, "graph {round}: {now:?} of {before:?} is left");
        }
    }
}

#[test]
fn the_average_voltage_is_found_on_200_graphs_with_delays_up_to_2_s() {
    let mut random = Random(14);
    for round in 0..200 {
        let mut coupled = delayed(&mut random, VoltagePolicy::Average);
        let h_ns = step_ns(&mut random).max(100_000_000);
        let mean = |x: &Sample| (x.V.iter().sum::<f64>() / x.V.len() as f64 - 1.0).abs();
        // Kept for longer than any message is under way.
        let (mut held_ns, mut steps) = (0, 0);
        while held_ns < 10_000_000_000 {
            coupled.step(h_ns);
            steps += 1;
            let now = (spread(&coupled.plant.Q), mean(&coupled.plant));
            held_ns = if now.0 < 1e-4 && now.1 < 1e-4 { held_ns + h_ns } else { 0 };
            assert!(
                coupled.plant.V.iter().all(|V| (V - 1.0).abs() < 10.0),
                "graph {round}: {:?}",
                coupled.plant.V
            );
            assert!(steps as i64 * h_ns < 20_000_000_000_000, "graph {round}: {now:?} after {steps} steps");
        }
    }
}

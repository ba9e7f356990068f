//! What holds of a fleet in parts whatever they are: what each knows, that what is exchanged stays equal and opposite
//! when agents, pins and switches come and go, and that a part goes on where it was kept.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;
mod parts_support;

use bess_consensus::control::communication::{
    Communication, Inside, StepByStep, StepByStepTopology, Weights,
};
use bess_consensus::control::config::{Limits, VoltagePolicy};
use bess_consensus::control::delay::Quantity;
use bess_consensus::control::partition::{Cut, numbers, split};
use bess_consensus::control::{Config, Controller};
use control_support::{Random, edge, explicit, largest_gap, pin, random_graph, scale, spread};
use parts_support::*;

const H_NS: i64 = 20_000_000;
const H_S: f64 = 0.02;

fn with(n: usize, communication: Communication) -> Config {
    let mut config = Config::unit(n, communication);
    config.K_P = (0..n).map(|i| 0.004 * (0.5 + 0.1 * (i % 5) as f64)).collect();
    config.K_Q = (0..n).map(|i| 0.02 * (0.5 + 0.1 * (i % 4) as f64)).collect();
    config.capacity = config.K_P.iter().map(|K| 0.5 / K).collect();
    config.omega_set_start = (0..n).map(|i| 1.0 + 1e-3 * ((i * 5 % 7) as f64 - 3.0) / 3.0).collect();
    config.V_set_start = vec![1.02; n];
    config.exchange_fade_s = 0.5;
    // So little that no limit of the exchange binds.
    config.gains.E = 2e-4;
    config
}

/// Three groups of three on a line, linked step by step.
fn three_clusters() -> Communication {
    let x: [f64; 9] = [0.0, 1.0, 2.5, 22.5, 23.5, 24.7, 44.7, 45.7, 47.7];
    Communication::StepByStep(StepByStep {
        distances: x.iter().map(|a| x.iter().map(|b| (a - b).abs()).collect()).collect(),
        weights: Weights::InverseDistance,
        topologies: vec![StepByStepTopology { name: "a3".into(), inside: Inside::Tree }],
    })
}

/// A path of `n` agents, the last one pinned.
fn path(n: usize) -> Config {
    with(n, explicit((1..n).map(|i| edge(i - 1, i, 1.0)).collect(), vec![pin(n - 1, 1.0)]))
}

/// Any graph, any cut, delays and policies at random: the bits of the whole fleet.
#[test]
fn random_fleets_cut_at_random() {
    let mut random = Random(2026);
    for trial in 0..(60.0 * scale()) as usize {
        let n = random.integer(2, 24);
        let (mut edges, pins) = random_graph(&mut random, n);
        for edge in &mut edges {
            edge.delay_s = (random.integer(0, 3) == 0).then(|| random.within(0.0, 0.1));
        }
        let mut config = with(n, explicit(edges, pins));
        config.eta = random.within(0.1, 1.0);
        config.delay_s = if random.integer(0, 1) == 0 { 0.0 } else { random.within(0.0, 0.1) };
        if random.integer(0, 1) == 0 {
            config.voltage_policy = VoltagePolicy::Average;
        }
        if random.integer(0, 1) == 0 {
            config.limits =
                Limits { P_max: Some(vec![1.0; n]), Q_max: Some(vec![0.3; n]), ..Limits::default() };
        }
        // Every number of parts, without gaps.
        let parts = random.integer(1, n);
        let mut part_of: Vec<u32> = (0..n).map(|i| (i % parts) as u32 + 1).collect();
        for i in (1..n).rev() {
            part_of.swap(i, random.integer(0, i));
        }
        let (mut whole, mut apart) =
            (Fleet::whole(&config, &part_of, H_S), Fleet::apart(&config, &part_of, H_S));
        let switches = on(n);
        for k in 0..150 {
            whole.step(H_NS, &switches);
            apart.step(H_NS, &switches);
            let gap = largest_gap(&whole.answered, &apart.answered);
            let same = same_bits(&whole.answered, &apart.answered);
            assert!(same, "trial {trial}, step {k}: {gap:e} apart, {n} agents, {part_of:?}");
        }
    }
}

/// What one agent measures changes what others say as fast as messages go from neighbour to neighbour, and no faster.
#[test]
fn a_part_knows_nothing_but_its_neighbours() {
    let config = Config { voltage_policy: VoltagePolicy::Average, ..path(6) };
    let part_of = numbers(&config, Cut::Agents);
    let mut calm = Fleet::apart(&config, &part_of, H_S);
    let mut other = calm.clone();
    let (switches, measured) = (on(6), calm.plant.clone());
    for k in 0..12 {
        // The plant carries nothing on: the others measure what they did.
        (calm.plant, other.plant) = (measured.clone(), measured.clone());
        (other.plant.P[0], other.plant.V[0]) = (measured.P[0] + 0.1, measured.V[0] + 0.01);
        other.plant.E[0] = measured.E[0] * 0.999;
        calm.step(H_NS, &switches);
        other.step(H_NS, &switches);
        for i in 0..6 {
            let told = |fleet: &Fleet| {
                fleet.parts[i].outputs().local.values.clone().map(|values| values[0].to_bits())
            };
            // The estimates of the mean pass it on: heard after a step, told of after another one.
            let expected = k >= (2 * i).saturating_sub(1);
            assert_eq!(told(&calm) != told(&other), expected, "agent {} after {} steps", i + 1, k + 1);
        }
    }
    // Nor does what is in the resources of a part name anybody else.
    for (i, part) in split(&config, &part_of, H_S).unwrap().iter().enumerate() {
        let known = &part.part.as_ref().unwrap().agents;
        assert!(known.iter().all(|&a| (a as usize).abs_diff(i + 1) <= 1), "{known:?}");
        let outside = known.iter().position(|&a| a as usize != i + 1).unwrap();
        let own = known.iter().position(|&a| a as usize == i + 1).unwrap();
        assert_eq!(part.K_P[outside], part.K_P[own], "a stand-in");
    }
}

/// Agents at the border leave and come back, one, both and in turns; clusters are switched off and on, one alone and
/// all. What is exchanged is equal and opposite but for the step in which the other side does not know yet.
#[test]
fn what_is_exchanged_stays_equal_and_opposite() {
    let base = || {
        let mut random = Random(7);
        let (edges, pins) = random_graph(&mut random, 9);
        let mut config = with(9, explicit(edges, pins));
        config.gains.E = 0.05;
        config
    };
    let average = Config { voltage_policy: VoltagePolicy::Average, ..base() };
    let ramped = Config { limits: Limits { P_set_rate: Some(vec![0.05; 9]), ..Limits::default() }, ..base() };
    let fading = Config { lost_link_fade_s: Some(0.7), ..base() };
    // Clusters whose leaders come and go with all others.
    let clusters = vec![1, 1, 1, 2, 2, 2, 3, 3, 3];
    let elected = Config { gains: base().gains, ..with(9, three_clusters()) };
    assert_eq!(numbers(&elected, Cut::Clusters), clusters);
    let elected_average = Config { voltage_policy: VoltagePolicy::Average, ..elected.clone() };
    let all = [base(), average, ramped, fading, elected, elected_average];
    for (which, config) in all.into_iter().enumerate() {
        for part_of in [numbers(&config, Cut::Agents), clusters.clone()] {
            let mut fleet = Fleet::apart(&config, &part_of, H_S);
            let mut random = Random(11);
            let (mut switches, mut since) = (on(9), 0);
            let mut off = vec![false; fleet.parts.len()];
            let mut worst_known: f64 = 0.0;
            for k in 0..4000 {
                since += 1;
                // More events than anybody would make, then a quiet end.
                if k < 3000 && random.integer(0, 24) == 0 {
                    let i = random.integer(0, 8);
                    switches.available[i] = !switches.available[i];
                    since = 0;
                }
                if k < 3000 && random.integer(0, 99) == 0 {
                    let p = random.integer(0, off.len() - 1);
                    off[p] = !off[p];
                    since = 0;
                }
                if k == 3000 {
                    switches.available.fill(true);
                    off.fill(false);
                    since = 0;
                }
                fleet.step_with(H_NS, &switches, |p, inputs| inputs.enable = !off[p]);
                // A pin that went, or is back, is known everywhere after as many steps as there are agents.
                if since > 12 {
                    let sum = fleet.P_set().iter().sum::<f64>().abs();
                    if sum > 1e-13 && worst_known < 1e-13 {
                        println!("step {k}, {since} after an event: {sum:e}");
                    }
                    worst_known = worst_known.max(sum);
                }
            }
            assert!(worst_known < 1e-13, "{worst_known:e}, configuration {which}, {part_of:?}");
            let P_set = fleet.P_set();
            assert!(spread(&P_set) > 1e-4, "{P_set:?}: nothing is exchanged");
        }
    }
}

/// The estimates of the mean voltage keep their sum, too, however agents at the border come and go.
#[test]
fn estimates_are_whole_again_after_agents_came_back() {
    let config = Config { voltage_policy: VoltagePolicy::Average, ..path(6) };
    for part_of in [vec![1, 1, 1, 2, 2, 2], numbers(&config, Cut::Agents)] {
        let mut fleet = Fleet::apart(&config, &part_of, H_S);
        let mut switches = on(6);
        for k in 0..6000 {
            switches.available[2] = !(200..300).contains(&k);
            switches.available[3] = !(400..500).contains(&k);
            fleet.step(H_NS, &switches);
        }
        let mean = fleet.plant.V.iter().sum::<f64>() / 6.0;
        assert!((mean - 1.0).abs() < 1e-6, "mean voltage {mean}, {part_of:?}");
    }
}

/// Behind an agent that left nobody hears the virtual leader: those parts find out by themselves and hold; when it is
/// back they go on. Those on the other side never stop.
#[test]
fn who_hears_no_pin_holds_and_goes_on_when_it_is_back() {
    let config = path(7);
    for part_of in [numbers(&config, Cut::Agents), vec![1, 1, 1, 2, 2, 3, 3]] {
        let mut fleet = Fleet::apart(&config, &part_of, H_S);
        let mut switches = on(7);
        let live = |fleet: &Fleet| -> Vec<bool> {
            let mut all = vec![false; 7];
            for p in 0..fleet.parts.len() {
                fleet.own(p).into_iter().for_each(|(place, i)| all[i] = fleet.parts[p].live()[place]);
            }
            all
        };
        (0..100).for_each(|_| fleet.step(H_NS, &switches));
        assert_eq!(live(&fleet), [true; 7]);
        switches.available[4] = false;
        (0..20).for_each(|_| fleet.step(H_NS, &switches));
        assert_eq!(live(&fleet), [false, false, false, false, false, true, true]);
        let held = fleet.omega_set();
        (0..50).for_each(|_| fleet.step(H_NS, &switches));
        assert!(same_bits(&held[..5], &fleet.omega_set()[..5]));
        switches.available[4] = true;
        (0..3000).for_each(|_| fleet.step(H_NS, &switches));
        assert_eq!(live(&fleet), [true; 7]);
        let error = fleet.plant.omega.iter().fold(0.0_f64, |e, omega| e.max((omega - 1.0).abs()));
        assert!(error < 1e-6, "{error:e}");
    }
}

/// Told nothing, a part with a pin restores the frequency of its own agents.
#[test]
fn a_part_alone_goes_on() {
    let config = path(6);
    let mut fleet = Fleet::apart(&config, &[1, 1, 1, 2, 2, 2], H_S);
    fleet.is_deaf = true;
    let switches = on(6);
    let start = fleet.omega_set();
    (0..3000).for_each(|_| fleet.step(H_NS, &switches));
    assert!(same_bits(&start[..3], &fleet.omega_set()[..3]), "no pin: held");
    let p: Vec<f64> = (3..6).map(|i| config.K_P[i] * (fleet.plant.P[i] - fleet.P_set()[i])).collect();
    assert!(spread(&p) < 1e-5, "{p:?}");
}

/// A state put back, or taken to another controller as bytes, goes on with the same bits.
#[test]
fn a_part_goes_on_where_it_was_kept() {
    let config = Config { voltage_policy: VoltagePolicy::Average, delay_s: 0.05, ..path(6) };
    let mut fleet = Fleet::apart(&config, &[1, 1, 1, 2, 2, 2], H_S);
    let mut switches = on(6);
    for k in 0..400 {
        switches.available[2] = !(100..150).contains(&k);
        fleet.step(H_NS, &switches);
    }
    let kept = fleet.clone();
    let mut elsewhere = fleet.clone();
    for (part, config) in elsewhere.parts.iter_mut().zip(split(&config, &[1, 1, 1, 2, 2, 2], H_S).unwrap()) {
        let bytes = postcard::to_stdvec(part.state()).unwrap();
        let mut fresh = Controller::new(config).unwrap();
        fresh.set_state(&postcard::from_bytes(&bytes).unwrap()).unwrap();
        *part = fresh;
    }
    let on_with = |fleet: &mut Fleet| {
        for k in 0..200 {
            let mut switches = switches.clone();
            switches.available[3] = k < 50;
            fleet.step(H_NS, &switches);
        }
        fleet.answered.clone()
    };
    let straight = on_with(&mut fleet);
    assert!(same_bits(&straight, &on_with(&mut elsewhere)));
    // Back where it was after a detour, in the same controllers.
    for (part, kept) in fleet.parts.iter_mut().zip(&kept.parts) {
        part.set_state(kept.state()).unwrap();
    }
    (fleet.plant, fleet.now_ns) = (kept.plant.clone(), kept.now_ns);
    assert!(same_bits(&straight, &on_with(&mut fleet)));
}

/// What the rates do when a message changes is what their tangents say.
#[test]
fn tangents_along_messages() {
    use bess_consensus::control::tangent::Direction;
    let config = Config { voltage_policy: VoltagePolicy::Average, ..path(6) };
    let mut fleet = Fleet::apart(&config, &[1, 1, 1, 2, 2, 2], H_S);
    let switches = on(6);
    (0..40).for_each(|_| fleet.step(H_NS, &switches));
    fleet.tell(&switches);
    for part in &mut fleet.parts {
        let own = part.own_agents();
        for quantity in [Quantity::Omega, Quantity::P, Quantity::V, Quantity::Q, Quantity::Soc] {
            part.refresh(&mut |_| {});
            let mut tangents = part.tangents();
            tangents.inputs.remote.of_mut(quantity)[0] = 1.0;
            part.differentiate(Direction::Knowns, &mut tangents);
            let all = |o: &bess_consensus::control::Outputs| -> Vec<f64> {
                let u = [&o.u_omega, &o.u_P, &o.u_E, &o.u_V, &o.u_Q];
                u.iter().flat_map(|u| own.iter().map(|&i| u[i])).collect()
            };
            let exact = all(&tangents.outputs);
            let moved = |part: &Controller, by: f64| {
                let mut part = part.clone();
                part.inputs_mut().remote.of_mut(quantity)[0] += by;
                part.refresh(&mut |_| {});
                all(part.outputs())
            };
            let d = 1e-7;
            let (up, down) = (moved(part, d), moved(part, -d));
            for (k, exact) in exact.iter().enumerate() {
                let found = (up[k] - down[k]) / (2.0 * d);
                let size = exact.abs().max(1e-3);
                assert!((found - exact).abs() < 1e-4 * size, "{quantity:?} {k}: {found} against {exact}");
            }
            assert!(quantity == Quantity::V || exact.iter().any(|x| x.abs() > 1e-6), "{quantity:?}");
        }
    }
}

/// A part stops in the middle and comes back: the others go on without it, nothing that was exchanged is lost, and in
/// the end all share and the sum of what is exchanged is zero.
#[test]
fn a_part_that_stopped_comes_back() {
    for voltage_policy in [VoltagePolicy::Paper, VoltagePolicy::Average] {
        let communication =
            explicit((1..6).map(|i| edge(i - 1, i, 1.0)).collect(), vec![pin(0, 1.0), pin(5, 1.0)]);
        let config = Config { voltage_policy, ..with(6, communication) };
        let mut fleet = Fleet::apart(&config, &[1, 1, 1, 2, 2, 2], H_S);
        let switches = on(6);
        (0..400).for_each(|_| fleet.step(H_NS, &switches));
        fleet.stopped_ns[1] = Some(fleet.now_ns);
        let held = fleet.omega_set();
        fleet.plant.P_load[0] += 0.3;
        for k in 0..1500 {
            fleet.step(H_NS, &switches);
            let sum = fleet.P_set().iter().sum::<f64>();
            // The step that the other side did not make, before anybody could know, is taken back.
            assert!(sum.abs() < 1e-13 || k == 0, "step {k}: {sum:e}");
        }
        assert!(same_bits(&held[3..], &fleet.omega_set()[3..]));
        let p = |fleet: &Fleet, i: usize| config.K_P[i] * (fleet.plant.P[i] - fleet.P_set()[i]);
        let sharing: Vec<f64> = (0..3).map(|i| p(&fleet, i)).collect();
        assert!(spread(&sharing) < 1e-5, "those who are there share: {sharing:?}");
        fleet.resume(1);
        (0..4000).for_each(|_| fleet.step(H_NS, &switches));
        let sharing: Vec<f64> = (0..6).map(|i| p(&fleet, i)).collect();
        assert!(spread(&sharing) < 1e-5, "{sharing:?}");
        assert!(fleet.P_set().iter().sum::<f64>().abs() < 1e-13);
        let omega = fleet.plant.omega.iter().fold(0.0_f64, |e, omega| e.max((omega - 1.0).abs()));
        assert!(omega < 1e-6, "{omega:e}");
    }
}

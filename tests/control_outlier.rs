//! Wrong messages and the outlier-resilient option on the agent model: what f wrong neighbours can do to the others, and
//! what they cannot.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::told::{MessageFault, MessageFaultKind, Told};
use bess_consensus::control::{Config, Controller};
use control_support::*;

const STEP_NS: i64 = 10_000_000;

/// Everybody with everybody, pinned at agent 1: (n + 1) / 2 - robust.
fn complete(n: usize, start: &Sample, change: impl FnOnce(&mut Config)) -> Loop {
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let edges = pairs.map(|(a, b)| edge(a, b, 0.3 + 0.1 * ((a + 2 * b) % 5) as f64)).collect();
    let mut config = agent_model(n, 0.5, explicit(edges, vec![pin(0, 1.0)]), start);
    config.gains.E = 0.0;
    change(&mut config);
    Loop::new(config, start)
}

fn always(agent: u32, told: Told, value: f64) -> MessageFault {
    let kind = MessageFaultKind::Stuck { value: Some(value) };
    MessageFault { agent, told: Some(told), kind, from_s: 0.0, until_s: None }
}

/// Omega of agents 1 to 6 after 60 s, agent 7 telling 1.04 in the place of its own.
fn others_of_a_liar(filter: u32) -> Vec<f64> {
    let mut start = Sample::random(&mut Random(5), 7);
    start.P = vec![1.0; 7];
    let mut coupled = complete(7, &start, |c| {
        c.outlier_filter = filter;
        c.message_faults = vec![always(7, Told::Omega, 1.04)];
    });
    for _ in 0..6000 {
        coupled.step(STEP_NS);
    }
    coupled.plant.omega[..6].to_vec()
}

#[test]
fn a_wrong_neighbour_is_left_out() {
    let [with, without] = [1, 0].map(others_of_a_liar);
    let off = |omega: &[f64]| omega.iter().fold(0.0, |w: f64, x| w.max((x - 1.0).abs()));
    println!(
        "omega of the others: {:.1e} with outlier_filter = 1, {:.1e} without",
        off(&with),
        off(&without)
    );
    assert!(off(&with) < 1e-9, "{with:?}");
    assert!(off(&without) > 1e-3, "without the filter the lie draws them off: {without:?}");
}

/// Safety, whatever is told and however it moves: what f = 2 wrong ones of 9 tell never draws a right one out of the
/// range in which the right ones and the virtual leader began.
#[test]
fn right_agents_stay_among_right_values() {
    for seed in 1..=20 {
        let mut random = Random(seed);
        let mut start = Sample::random(&mut random, 9);
        // Equal powers share already, so that omega alone moves; nothing but the frequency is lied about.
        start.P = vec![1.0; 9];
        let liars = [random.integer(0, 3), random.integer(4, 8)];
        let mut faults = Vec::new();
        for agent in liars.map(|i| i as u32 + 1) {
            // A new lie every tenth of a second.
            for k in 0..50 {
                let (from_s, until_s) = (0.1 * f64::from(k), Some(0.1 * f64::from(k + 1)));
                faults.push(MessageFault {
                    from_s,
                    until_s,
                    ..always(agent, Told::Omega, random.within(0.5, 1.5))
                });
            }
        }
        let mut coupled = complete(9, &start, |c| {
            (c.outlier_filter, c.message_faults) = (2, faults);
        });
        let right: Vec<usize> = (0..9).filter(|i| !liars.contains(i)).collect();
        let range = |omega: &[f64]| {
            let of = right.iter().map(|&i| omega[i]);
            of.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)))
        };
        let (low, high) = range(&coupled.plant.omega);
        let (low, high) = (low.min(1.0), high.max(1.0));
        for k in 0..500 {
            coupled.step(STEP_NS);
            let now = range(&coupled.plant.omega);
            // Rounding of some hundred sums.
            assert!(now.0 >= low - 1e-12 && now.1 <= high + 1e-12, "seed {seed}, step {k}: {now:?}");
        }
    }
}

#[test]
fn too_few_neighbours_leave_nobody_out() {
    let of = |filter: u32| {
        let (mut coupled, steps) = (line(|c| c.outlier_filter = filter), 300);
        (0..steps).for_each(|_| coupled.step(STEP_NS));
        coupled.plant.omega
    };
    let (filtered, plain) = (of(1), of(0));
    // Another order of the sums, nothing else.
    assert!(largest_gap(&filtered, &plain) < 1e-14);
}

/// 1 - 2 - ... - 5, whose agents have two neighbours at most.
fn line(change: impl FnOnce(&mut Config)) -> Loop {
    let start = Sample::random(&mut Random(8), 5);
    let edges = (0..4).map(|i| edge(i, i + 1, 0.5)).collect();
    let mut config = agent_model(5, 0.5, explicit(edges, vec![pin(0, 1.0)]), &start);
    config.theta_E_s = 1.0;
    config.gains.E = 0.01;
    change(&mut config);
    Loop::new(config, &start)
}

#[test]
fn a_frozen_agent_holds_its_setpoints_and_the_exchange_stays_antisymmetric() {
    let freeze = MessageFault {
        agent: 3,
        told: None,
        kind: MessageFaultKind::Freeze,
        from_s: 1.0,
        until_s: Some(2.0),
    };
    let mut coupled = line(|c| c.message_faults = vec![freeze]);
    let held = |c: &Controller| [c.outputs().omega_set[2], c.outputs().V_set[2], c.outputs().P_set[2]];
    let mut at_freeze = None;
    for k in 0..300 {
        coupled.step(STEP_NS);
        let now = held(&coupled.controller);
        // The step that begins at 1 s is the first that moves nothing.
        match k {
            99 => at_freeze = Some(now),
            100..=199 => assert_eq!(Some(now), at_freeze, "step {k}"),
            _ => {}
        }
        let sum: f64 = coupled.controller.outputs().P_set.iter().sum();
        assert!(sum.abs() < 1e-12, "step {k}: {sum:e}");
    }
    assert_ne!(Some(held(&coupled.controller)), at_freeze, "it goes on afterwards");
}

#[test]
fn who_tells_the_truth_late_is_not_silent_but_who_is_mute_is() {
    // Agent 5 at the end of the line is mute from 1 s on. Its neighbour leaves it out 0.5 s later.
    let mute = MessageFault { agent: 5, told: None, kind: MessageFaultKind::Nan, from_s: 1.0, until_s: None };
    let run = |silence_s: Option<f64>, until: usize| {
        let mut coupled = line(|c| {
            c.message_faults = vec![mute];
            c.silence_s = silence_s;
        });
        (0..until).for_each(|_| coupled.step(STEP_NS));
        coupled.plant
    };
    assert_eq!(run(Some(0.5), 150).omega, run(None, 150).omega, "until then the last message counts");
    assert_ne!(run(Some(0.5), 200).omega, run(None, 200).omega);
}

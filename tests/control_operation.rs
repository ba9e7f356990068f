//! The controller in operation: rollback, plug and play, topology changes, delays, losses.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::config::{Channel, MeasurementFilter, VoltagePolicy};
use bess_consensus::control::told::{MessageFault, MessageFaultKind, Told};
use bess_consensus::control::{Config, Controller, Event, State};
use control_support::*;

fn seven(change: impl FnOnce(&mut Config)) -> (Loop, Sample) {
    let start = Sample::random(&mut Random(11), 7);
    let mut config = agent_model(7, 0.5, two_groups(), &start);
    config.theta_E_s = 1.0;
    config.gains.E = 0.005;
    config.P_exchange_max = vec![1.0; 7];
    change(&mut config);
    (Loop::new(config, &start), start)
}

fn bits(controller: &Controller) -> Vec<u8> {
    postcard::to_allocvec(controller.state()).unwrap()
}

type Change = fn(&mut Config);

/// Some that begin before the rollback and end after it.
fn message_faults() -> Vec<MessageFault> {
    let of = |agent, told, kind| MessageFault { agent, told, kind, from_s: 0.2, until_s: Some(0.6) };
    vec![
        of(2, None, MessageFaultKind::Freeze),
        of(4, Some(Told::Omega), MessageFaultKind::Drift { rate_per_s: 0.01 }),
        of(5, None, MessageFaultKind::Nan),
        of(6, None, MessageFaultKind::Stuck { value: None }),
    ]
}

#[test]
fn rollback_and_repetition_are_bit_identical() {
    let changes: [Change; 8] = [
        |_| {},
        |c| c.delay_s = 0.05,
        |c| c.channel = Channel { jitter_s: 0.03, loss: 0.3, seed: 5 },
        |c| c.measurement_filter = MeasurementFilter { P_s: 0.1, omega_s: 0.05, ..Default::default() },
        |c| {
            c.voltage_policy = VoltagePolicy::Average;
            c.delay_s = 0.05;
            c.limits.P_set_rate = Some(vec![0.3; 7]);
        },
        |c| {
            c.limits.P_max = Some(vec![0.9; 7]);
            c.limits.Q_max = Some(vec![0.4; 7]);
            c.no_circulation = true;
            c.exchange_fade_s = 0.3;
        },
        |c| {
            c.message_faults = message_faults();
            (c.outlier_filter, c.silence_s) = (1, Some(0.1));
        },
        |c| {
            c.message_faults = message_faults();
            c.voltage_policy = VoltagePolicy::Average;
            c.channel = Channel { jitter_s: 0.03, loss: 0.3, seed: 5 };
            (c.delay_s, c.silence_s) = (0.05, Some(0.2));
        },
    ];
    for change in changes {
        let (mut coupled, _) = seven(change);
        for k in 0..40 {
            coupled.controller.inputs_mut().available[2] = !(10..20).contains(&k) && k < 35;
            coupled.step(10_000_000);
        }
        let stored: State = postcard::from_bytes(&bits(&coupled.controller)).unwrap();
        let mut clone = coupled.clone();
        // The rolled-back ones run elsewhere first, through other topologies, and with another tuning.
        let (mut rolled, mut tuned) = (coupled.clone(), coupled.clone());
        let inputs = rolled.controller.inputs_mut();
        (inputs.topology, inputs.available[2], inputs.available[5]) = (2, true, false);
        let parameters = tuned.controller.parameters_mut();
        (parameters.eta, parameters.gain_P, parameters.delay) = (0.7, 0.4, 0.08);
        for _ in 0..7 {
            rolled.step(30_000_000);
            tuned.step(30_000_000);
        }
        for run in [&mut rolled, &mut tuned] {
            run.controller.set_state(&stored).unwrap();
            *run = Loop { controller: run.controller.clone(), ..coupled.clone() };
            assert_eq!(bits(&run.controller), bits(&coupled.controller));
        }
        for k in 0..40 {
            for run in [&mut coupled, &mut clone, &mut rolled, &mut tuned] {
                let inputs = run.controller.inputs_mut();
                (inputs.topology, inputs.available[2]) = (1 + k / 20, k >= 10);
            }
            rolled.tell();
            // A read between steps changes nothing.
            rolled.controller.refresh(&mut |_| {});
            coupled.step(10_000_000);
            for other in [&mut clone, &mut rolled, &mut tuned] {
                other.step(10_000_000);
                assert_eq!(bits(&coupled.controller), bits(&other.controller), "step {k}");
            }
        }
    }
}

#[test]
fn what_was_looked_at_before_the_start_leaves_nothing_behind() {
    let limited: Change = |c| {
        c.limits.P_max = Some(vec![0.9; 7]);
        c.measurement_filter = MeasurementFilter { P_s: 0.1, ..Default::default() };
    };
    let [mut fresh, mut looked_at] = [seven(limited).0, seven(limited).0];
    for P in [0.3, 0.7] {
        looked_at.controller.inputs_mut().P.fill(P);
        looked_at.controller.initialise();
    }
    for coupled in [&mut fresh, &mut looked_at] {
        coupled.tell();
        coupled.controller.initialise();
    }
    for k in 0..3 {
        assert_eq!(bits(&fresh.controller), bits(&looked_at.controller), "step {k}");
        fresh.step(10_000_000);
        looked_at.step(10_000_000);
    }
}

#[test]
fn a_foreign_state_is_refused_and_changes_nothing() {
    let (mut coupled, _) = seven(|_| {});
    coupled.step(10_000_000);
    let before = bits(&coupled.controller);
    let start = Sample::random(&mut Random(3), 4);
    let ring = (0..4).map(|i| edge(i, (i + 1) % 4, 1.0)).collect();
    let foreign = Controller::new(agent_model(4, 0.5, explicit(ring, vec![pin(0, 1.0)]), &start)).unwrap();
    let error = coupled.controller.set_state(foreign.state()).unwrap_err();
    assert!(error.to_string().contains("K_P"), "{error}");
    // As many agents, another graph.
    let ring = (0..7).map(|i| edge(i, (i + 1) % 7, 1.0)).collect();
    let start = Sample::random(&mut Random(3), 7);
    let foreign = Controller::new(agent_model(7, 0.5, explicit(ring, vec![pin(0, 1.0)]), &start)).unwrap();
    let error = coupled.controller.set_state(foreign.state()).unwrap_err();
    assert!(error.to_string().contains("flows"), "{error}");
    coupled.controller.inputs_mut().P[3] = f64::NAN;
    let broken = coupled.controller.state().clone();
    let (mut other, _) = seven(|_| {});
    other.step(10_000_000);
    let error = other.controller.set_state(&broken).unwrap_err();
    assert!(error.to_string().contains("inputs.P[3]"), "{error}");
    assert_eq!(bits(&other.controller), before);
}

#[test]
fn disabled_it_holds_and_enabling_starts_from_there() {
    let (mut coupled, _) = seven(|_| {});
    coupled.step(10_000_000);
    let held = coupled.controller.outputs().clone();
    coupled.controller.inputs_mut().enable = false;
    for _ in 0..10 {
        coupled.step(10_000_000);
        let out = coupled.controller.outputs();
        assert_eq!((&out.omega_set, &out.V_set, &out.P_set), (&held.omega_set, &held.V_set, &held.P_set));
        let inputs = [&out.u_omega, &out.u_P, &out.u_E, &out.u_V, &out.u_Q];
        assert!(inputs.iter().all(|u| u.iter().all(|&u| u == 0.0)));
    }
    coupled.controller.inputs_mut().enable = true;
    coupled.step(1_000_000);
    let out = coupled.controller.outputs();
    for i in 0..7 {
        let expected = held.omega_set[i] + 1e-3 * out.u_omega[i];
        assert!((out.omega_set[i] - expected).abs() < 1e-15, "agent {i} jumped");
    }
}

/// An agent leaves and comes back: the rest agrees without it, P_set sums to zero throughout, and what
/// it holds it holds to the bit.
#[test]
fn an_agent_leaves_and_comes_back() {
    // A gain at which no limit binds, so that every agent has an exchange of its own.
    let (mut coupled, _) = seven(|c| c.gains.E = 1e-4);
    let mut events = Vec::new();
    for _ in 0..20 {
        coupled.step(10_000_000);
    }
    // Agent 3 leads its cluster: the nearest of it to the other.
    coupled.controller.inputs_mut().available[2] = false;
    let held = coupled.controller.outputs().clone();
    assert!(held.P_set[2].abs() > 1e-3, "there is an exchange to hold");
    coupled.tell();
    coupled.controller.refresh(&mut |event| events.push(event));
    assert_eq!(events, [Event::AgentLeft { agent: 3 }, Event::LeaderElected { agent: 2, cluster: 1 }]);
    for _ in 0..6000 {
        coupled.step(10_000_000);
        let out = coupled.controller.outputs();
        assert_eq!(
            (out.omega_set[2], out.V_set[2], out.P_set[2]),
            (held.omega_set[2], held.V_set[2], held.P_set[2])
        );
        assert!(out.P_set.iter().sum::<f64>().abs() < 1e-13);
    }
    let others = |x: &[f64]| spread(&[x[0], x[1], x[3], x[4], x[5], x[6]]);
    assert!(others(&coupled.plant.P) < 1e-9 && others(&coupled.plant.omega) < 1e-9);
    assert!(coupled.controller.outputs().spread_P < 1e-9, "the spread is that of the available agents");
    events.clear();
    coupled.controller.inputs_mut().available[2] = true;
    coupled.controller.refresh(&mut |event| events.push(event));
    assert_eq!(events, [Event::AgentJoined { agent: 3 }, Event::LeaderElected { agent: 3, cluster: 1 }]);
    for _ in 0..6000 {
        coupled.step(10_000_000);
        assert!(coupled.controller.outputs().P_set.iter().sum::<f64>().abs() < 1e-13);
    }
    assert!(spread(&coupled.plant.P) < 1e-9 && spread(&coupled.plant.omega) < 1e-9);
}

#[test]
fn a_graph_in_parts_goes_on_where_it_hears_the_leader() {
    let edges = (0..5).map(|i| edge(i, i + 1, 1.0)).collect();
    let start = Sample::random(&mut Random(12), 6);
    let mut coupled = Loop::new(agent_model(6, 0.5, explicit(edges, vec![pin(0, 1.0)]), &start), &start);
    coupled.step(10_000_000);
    coupled.controller.inputs_mut().available[2] = false;
    let held = coupled.controller.outputs().clone();
    let mut events = Vec::new();
    coupled.controller.refresh(&mut |event| events.push(event));
    let expected =
        [Event::AgentLeft { agent: 3 }, Event::GraphInParts { parts: 2 }, Event::PartHolds { agent: 4 }];
    assert_eq!(events, expected);
    for _ in 0..2000 {
        coupled.step(10_000_000);
    }
    let out = coupled.controller.outputs();
    assert_eq!(out.omega_set[2..], held.omega_set[2..]);
    assert_eq!(out.P_set[3..], held.P_set[3..]);
    assert!((coupled.plant.omega[0] - 1.0).abs() < 1e-9 && (coupled.plant.omega[1] - 1.0).abs() < 1e-9);
    assert!(out.P_set.iter().sum::<f64>().abs() < 1e-9);
    events.clear();
    coupled.controller.inputs_mut().available[2] = true;
    coupled.controller.refresh(&mut |event| events.push(event));
    assert_eq!(events, [Event::AgentJoined { agent: 3 }, Event::GraphWhole]);
}

#[test]
fn topologies_switch_and_unknown_ones_are_refused() {
    let (mut coupled, _) = seven(|_| {});
    let mut events = Vec::new();
    for (number, edges) in [(2, 8), (3, 8), (0, 8), (i32::MIN, 8), (1, 6)] {
        coupled.controller.inputs_mut().topology = number;
        coupled.controller.refresh(&mut |event| events.push(event));
        coupled.controller.refresh(&mut |event| events.push(event));
        assert_eq!(coupled.controller.network().graph.edges().len(), edges, "topology {number}");
    }
    let unknown = |asked| Event::TopologyUnknown { asked, count: 2, kept: 2 };
    let expected = [
        Event::TopologySwitched { topology: 2 },
        unknown(3),
        unknown(0),
        unknown(i32::MIN),
        Event::TopologySwitched { topology: 1 },
    ];
    assert_eq!(events, expected);
    assert_eq!(coupled.controller.outputs().cluster, [1, 1, 1, 2, 2, 2, 2]);
}

#[test]
fn a_delayed_neighbour_is_seen_as_it_was_and_oneself_as_one_is() {
    // Two agents, ramps of slope 1 and -1 in omega told for 1 s, tau = 0.25 s, samples every 0.1 s.
    let start = Sample {
        t: 0.0,
        omega: vec![1.0; 2],
        P: vec![0.0; 2],
        E: vec![0.5; 2],
        V: vec![1.0; 2],
        Q: vec![0.0; 2],
    };
    let mut config = agent_model(2, 1.0, explicit(vec![edge(0, 1, 0.5)], vec![pin(1, 1.0)]), &start);
    config.delay_s = 0.25;
    config.discretisation = bess_consensus::control::config::Discretisation::Explicit;
    let mut controller = enabled(config);
    let ramp = |t: f64| (1.0 + t, 1.0 - t);
    for k in 0..=10 {
        let t = k as f64 * 0.1;
        let inputs = controller.inputs_mut();
        (inputs.omega[0], inputs.omega[1]) = ramp(t);
        inputs.omega_ref = ramp(t).1;
        // What follows at once is what the step will use.
        controller.refresh(&mut |_| {});
        let (own, neighbour) = (ramp(t).0, ramp((t - 0.25).max(0.0)).1);
        let expected = -0.5 * (own - neighbour);
        assert!((controller.outputs().u_omega[0] - expected).abs() < 1e-12, "at {t}");
        controller.step(k * 100_000_000, 100_000_000, &mut |_| {});
        assert!((controller.outputs().u_omega[0] - expected).abs() < 1e-12, "at {t}, in the step");
    }
}

#[test]
fn delays_beyond_all_time_hold_the_first_sample() {
    // Whatever is finite may be set; in nanoseconds it ends at the largest number there is.
    let after = |s: f64| {
        let (mut coupled, _) = seven(|c| {
            c.gains.E = 0.0;
            c.delay_s = s;
            c.channel = Channel { jitter_s: s, loss: 0.2, seed: 3 };
        });
        coupled.now_ns = -20_000_000;
        for _ in 0..20 {
            coupled.step(10_000_000);
        }
        coupled.controller.outputs().clone()
    };
    assert_eq!(after(1e300), after(1e6));
}

#[test]
fn half_a_second_of_delay_with_losses_still_ends_in_consensus() {
    for (channel, bar) in [(Channel::default(), 1e-6), (Channel { jitter_s: 0.2, loss: 0.2, seed: 3 }, 1e-3)]
    {
        let (mut coupled, _) = seven(|c| {
            c.delay_s = 0.5;
            c.theta_min_s = 1.0;
            c.channel = channel;
        });
        for _ in 0..40_000 {
            coupled.step(10_000_000);
            assert!(coupled.controller.outputs().P_set.iter().sum::<f64>().abs() < 1e-12);
        }
        let plant = &coupled.plant;
        let (P, omega) = (spread(&plant.P), spread(&plant.omega));
        println!(
            "tau 0.5 s, loss {}: spread of P {P:.1e}, of omega {omega:.1e}, of E {:.1e}",
            channel.loss,
            spread(&plant.E)
        );
        assert!(P < bar && omega < bar, "{P} {omega}");
    }
}

#[test]
fn no_power_reference_leaves_its_ramp_when_links_end_and_come_back() {
    const RATE: f64 = 0.05;
    for exchange_fade_s in [0.0, 0.5, 2.0] {
        for lost_link_fade_s in [None, Some(0.3)] {
            let (mut coupled, _) = seven(|c| {
                c.limits.P_set_rate = Some(vec![RATE; 7]);
                (c.exchange_fade_s, c.lost_link_fade_s) = (exchange_fade_s, lost_link_fade_s);
            });
            let (mut fastest, mut carried) = (0.0_f64, 0.0_f64);
            for k in 0..6000 {
                let inputs = coupled.controller.inputs_mut();
                inputs.topology = 1 + i32::from((1500..3500).contains(&k));
                inputs.available[4] = !(2500..4500).contains(&k);
                let before = coupled.controller.outputs().P_set.clone();
                coupled.step(10_000_000);
                let after = &coupled.controller.outputs().P_set;
                for (before, after) in before.iter().zip(after) {
                    fastest = fastest.max((after - before).abs() / 0.01);
                }
                let sum: f64 = after.iter().sum();
                assert!(sum.abs() < 1e-12, "sum of P_set {sum:e} in step {k}");
                carried = carried.max(after.iter().fold(0.0, |most, P| P.abs().max(most)));
            }
            assert!(carried > 0.2, "the exchange hardly moved: {carried}");
            assert!(fastest <= RATE * (1.0 + 1e-9), "{fastest} pu/s with a fade of {exchange_fade_s} s");
        }
    }
}

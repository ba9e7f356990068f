//! A fleet in parts that exchange over their links only is the whole fleet with one communication step of delay on
//! those links, to the last bit.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;
mod parts_support;

use bess_consensus::control::Config;
use bess_consensus::control::communication::{Communication, Explicit};
use bess_consensus::control::config::{
    Channel, Discretisation, Law, Limits, MeasurementFilter, SocLimits, VoltagePolicy,
};
use bess_consensus::control::partition::{Cut, numbers, written};
use bess_consensus::control::told::{MessageFault, MessageFaultKind, Told};
use control_support::{largest_gap, two_groups};
use parts_support::*;

const H_NS: i64 = 20_000_000;
const H_S: f64 = 0.02;

/// Seven batteries in two clusters, as in the paper's cases.
fn seven() -> Config {
    let mut config = Config::unit(7, two_groups());
    let table = [1.0, 1.0, 0.8, 0.67, 0.8, 1.0, 0.5];
    config.K_P = table.iter().map(|x| 0.004 * x).collect();
    config.K_Q = table.iter().map(|x| 0.02 * x).collect();
    config.capacity = config.K_P.iter().map(|K| 0.5 / K).collect();
    config.omega_set_start = [1.5, -1.0, 0.5, -1.5, 1.0, -0.5, 0.0].iter().map(|x| 1.0 + 1e-3 * x).collect();
    config.V_set_start = vec![1.02; 7];
    config.exchange_fade_s = 2.0;
    config
}

/// Runs both and compares after every step; what the master sets is that of `at` of the step.
fn compare(config: &Config, part_of: &[u32], steps: usize, at: impl Fn(usize, &mut Switches, &mut Plant)) {
    let mut whole = Fleet::whole(config, part_of, H_S);
    let mut apart = Fleet::apart(config, part_of, H_S);
    let mut switches = on(config.agents());
    for k in 0..steps {
        for fleet in [&mut whole, &mut apart] {
            at(k, &mut switches, &mut fleet.plant);
            fleet.step(H_NS, &switches);
        }
        let (x, y) = (&whole.answered, &apart.answered);
        assert!(same_bits(x, y), "step {k}: {:e} apart, {part_of:?}", largest_gap(x, y));
        assert_eq!(whole.plant, apart.plant);
    }
    let moved = largest_gap(&config.omega_set_start, &whole.omega_set());
    assert!(moved > 1e-5, "{moved:e}: nothing happened");
}

fn cuts(config: &Config) -> [Vec<u32>; 2] {
    [Cut::Clusters, Cut::Agents].map(|cut| numbers(config, cut))
}

#[test]
fn clusters_and_agents_alone_are_the_whole_fleet() {
    for part_of in cuts(&seven()) {
        compare(&seven(), &part_of, 1500, |k, _, plant| {
            if k == 700 {
                plant.P_load[1] += 0.5;
                plant.Q_load[5] += 0.3;
            }
        });
    }
}

#[test]
fn another_topology_dispatch_and_a_late_start() {
    for part_of in cuts(&seven()) {
        compare(&seven(), &part_of, 1500, |k, switches, plant| {
            switches.enable = (50..1300).contains(&k);
            switches.topology = if (400..900).contains(&k) { 2 } else { 1 };
            (switches.dispatch, switches.P_ref) = (k >= 700, -1e-3);
            if k == 1000 {
                plant.P_load[6] -= 0.4;
            }
        });
    }
}

#[test]
fn delays_of_all_kinds() {
    let common = |delay_s: f64| Config { delay_s, ..seven() };
    // Shorter than a step, so that the links between parts alone are late; as long; longer; no whole number of steps.
    for config in [common(0.005), common(0.02), common(0.1), common(0.13)] {
        for part_of in cuts(&config) {
            for voltage_policy in [VoltagePolicy::Paper, VoltagePolicy::Average] {
                let config = Config { voltage_policy, ..config.clone() };
                compare(&config, &part_of, 800, |k, switches, _| {
                    switches.topology = if k >= 500 { 2 } else { 1 };
                });
            }
        }
    }
    let mut own = seven();
    let mut topologies = written(&own);
    for (k, edge) in topologies.iter_mut().flat_map(|topology| &mut topology.edges).enumerate() {
        edge.delay_s = (k % 3 > 0).then_some(0.03 * (k % 5) as f64);
    }
    own.communication = Communication::Explicit(Explicit { topologies });
    own.voltage_policy = VoltagePolicy::Average;
    for part_of in cuts(&own) {
        compare(&own, &part_of, 800, |_, _, _| {});
    }
}

/// Batteries that meet every limit there is.
fn limited() -> Config {
    let mut config = seven();
    config.limits = Limits {
        P_max: Some(vec![1.2, 1.0, 0.8, 1.5, 0.9, 1.1, 0.7]),
        Q_max: Some(vec![0.3; 7]),
        S_max: Some(vec![1.3; 7]),
        omega_set_rate: Some(vec![2e-3; 7]),
        V_set_rate: Some(vec![0.05; 7]),
        P_set_rate: Some(vec![0.02; 7]),
        omega_set_range: Some([0.99, 1.01]),
        V_set_range: Some([0.95, 1.06]),
        SoC: Some(SocLimits { min: 0.1, max: 0.68, taper: 0.03 }),
    };
    config.gains.E = 0.05;
    config
}

#[test]
fn limits_filters_and_the_other_laws() {
    let filtered = |c: &mut Config| {
        c.measurement_filter = MeasurementFilter { omega_s: 0.05, P_s: 0.1, E_s: 1.0, V_s: 0.05, Q_s: 0.1 };
    };
    let options: [&dyn Fn(&mut Config); 6] = [
        &|_| {},
        &|c| c.no_circulation = true,
        &filtered,
        &|c| c.law = Law::FixedTime { alpha: 1.0, beta: 10.0 },
        &|c| c.discretisation = Discretisation::Explicit,
        &|c| c.outlier_filter = 1,
    ];
    for base in [seven(), limited()] {
        for option in options {
            let mut config = base.clone();
            option(&mut config);
            for part_of in cuts(&config) {
                compare(&config, &part_of, 600, |k, _, plant| {
                    if k == 200 {
                        plant.P_load.iter_mut().for_each(|P| *P += 0.2);
                        plant.Q_load[3] += 0.3;
                    }
                });
            }
        }
    }
}

#[test]
fn lost_late_and_wrong_messages() {
    let fault = |agent, told, kind| MessageFault { agent, told, kind, from_s: 2.0, until_s: Some(6.0) };
    let faults = vec![
        fault(3, Some(Told::P), MessageFaultKind::Drift { rate_per_s: 1e-4 }),
        fault(4, Some(Told::Omega), MessageFaultKind::Stuck { value: Some(1.001) }),
        fault(5, None, MessageFaultKind::Nan),
        fault(2, None, MessageFaultKind::Freeze),
    ];
    for voltage_policy in [VoltagePolicy::Paper, VoltagePolicy::Average] {
        for channel in [Channel::default(), Channel { jitter_s: 0.07, loss: 0.2, seed: 5 }] {
            for silence_s in [None, Some(0.5)] {
                for message_faults in [vec![], faults.clone()] {
                    let config = Config { voltage_policy, channel, silence_s, message_faults, ..seven() };
                    for part_of in cuts(&config) {
                        compare(&config, &part_of, 500, |_, _, _| {});
                    }
                }
            }
        }
    }
}

/// An agent that leaves and comes back moves nothing at once but its own neighbours; as long as none of those has
/// links to another part, nobody there could know sooner.
#[test]
fn an_agent_away_from_the_border_comes_and_goes() {
    for base in [seven(), limited(), Config { voltage_policy: VoltagePolicy::Average, ..seven() }] {
        for lost_link_fade_s in [None, Some(1.0)] {
            let config = Config { lost_link_fade_s, ..base.clone() };
            compare(&config, &numbers(&config, Cut::Clusters), 1500, |k, switches, _| {
                switches.available[6] = !(400..900).contains(&k);
                switches.available[0] = !(600..1000).contains(&k);
            });
        }
    }
}

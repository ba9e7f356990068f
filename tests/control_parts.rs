//! A fleet in parts that exchange over their links only is the whole fleet with one communication step of delay on
//! those links, to the last bit.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;
mod parts_support;

use bess_consensus::control::Config;
use bess_consensus::control::config::VoltagePolicy;
use bess_consensus::control::partition::{Cut, numbers};
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

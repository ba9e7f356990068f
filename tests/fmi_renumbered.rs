//! An FMU of many agents numbers them anew inside. From outside nobody can tell: set and get by the user's numbers
//! give what the same law gives that was never renumbered, agent by agent.
#![cfg(feature = "host")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic, reason = "the paper's letters; a test may fail")]

mod control_support;
mod derivative_support;

use bess_consensus::control::communication::{Communication, Explicit, ExplicitTopology};
use bess_consensus::control::order::Order;
use bess_consensus::control::{Config, Controller};
use bess_consensus::fmi::{Instance, Interface, Logger};
use bess_consensus::models::{self, ControllerResource};
use control_support::{Random, edge, pin};
use derivative_support::{read, references};

const AGENTS: usize = 4500;
const STEP_NS: i64 = 10_000_000;
/// Sums are rounded in another order; numbers are of size 1.
const ROUNDING: f64 = 1e-12;
/// Of the eigenvalues, which are found by iteration.
const ITERATION: f64 = 1e-5;

/// A band of agents whose numbers are scattered: every one talks to the next and to the one 40 on, in a second topology
/// 60 on, wide enough for the eigenvalues to be found. Clusters and pins are scattered alike.
fn config() -> Config {
    let mut random = Random(5);
    let mut number: Vec<usize> = (0..AGENTS).collect();
    for i in (1..AGENTS).rev() {
        number.swap(i, random.integer(0, i));
    }
    let mut topology = |name: &str, far: usize| {
        let ends = (0..AGENTS).flat_map(|p| [(p, p + 1), (p, p + far)]).filter(|ends| ends.1 < AGENTS);
        ExplicitTopology {
            name: name.into(),
            edges: ends.map(|(p, q)| edge(number[p], number[q], random.within(0.3, 1.0))).collect(),
            pins: (0..AGENTS).step_by(900).map(|p| pin(number[p], random.within(0.5, 1.0))).collect(),
            clusters: Some((0..AGENTS).map(|i| 1 + (i % 7) as u32).collect()),
            leaders: None,
        }
    };
    let topologies = vec![topology("near", 40), topology("far", 60)];
    Config {
        K_P: random.values(AGENTS, 0.002, 0.006),
        K_Q: random.values(AGENTS, 0.01, 0.03),
        capacity: random.values(AGENTS, 5.0, 20.0),
        P_exchange_max: random.values(AGENTS, 0.02, 1.0),
        omega_set_start: random.values(AGENTS, 0.998, 1.002),
        V_set_start: random.values(AGENTS, 1.0, 1.04),
        exchange_fade_s: 0.05,
        ..Config::unit(AGENTS, Communication::Explicit(Explicit { topologies }))
    }
}

fn instance(config: &Config) -> Instance<models::Controller> {
    let resource = ControllerResource { stop_s: 1.0, step_s: 0.01, config: config.clone() };
    let model = models::Controller::new(resource).unwrap();
    Instance::from_model("many", model, Interface::Structured, Logger::silent()).unwrap()
}

/// Sets both to what is measured before step `k`, every agent by its number outside.
fn measure(k: usize, fmu: &mut Instance<models::Controller>, law: &mut Controller) {
    let mut random = Random(1000 + k as u64);
    let (omega_set, V_set) = (law.outputs().omega_set.clone(), law.outputs().V_set.clone());
    let inputs = law.inputs_mut();
    inputs.P = random.values(AGENTS, 0.0, 1.0);
    inputs.Q = random.values(AGENTS, -0.5, 0.5);
    inputs.E = random.values(AGENTS, 4.0, 6.0);
    inputs.omega = omega_set.iter().map(|omega| omega - random.within(0.0, 4e-3)).collect();
    inputs.V = V_set.iter().map(|V| V - random.within(-1e-2, 1e-2)).collect();
    inputs.enable = k > 0;
    inputs.dispatch = k > 9;
    inputs.P_ref = 1e-4;
    inputs.topology = if k > 5 { 2 } else { 1 };
    for i in (0..AGENTS).step_by(50) {
        inputs.available[i] = !(3..8).contains(&k);
    }
    let inputs = &*inputs;
    for (name, values) in [
        ("P", &inputs.P),
        ("Q", &inputs.Q),
        ("V", &inputs.V),
        ("omega", &inputs.omega),
        ("E", &inputs.E),
        ("P_ref", &vec![inputs.P_ref]),
    ] {
        fmu.set_real(&references(fmu, &[name]), values).unwrap();
    }
    for (name, values) in [
        ("enable", &vec![inputs.enable]),
        ("dispatch", &vec![inputs.dispatch]),
        ("available", &inputs.available),
    ] {
        fmu.set_boolean(&references(fmu, &[name]), values).unwrap();
    }
    fmu.set_integer(&references(fmu, &["topology"]), &[inputs.topology]).unwrap();
}

/// Compares everything that one can see.
fn compare(k: usize, fmu: &mut Instance<models::Controller>, law: &Controller) {
    let out = law.outputs();
    for (name, expected, tolerance) in [
        ("omega_set", &out.omega_set, ROUNDING),
        ("V_set", &out.V_set, ROUNDING),
        ("P_set", &out.P_set, ROUNDING),
        ("Q_set", &out.Q_set, ROUNDING),
        ("u_omega", &out.u_omega, ROUNDING),
        ("u_P", &out.u_P, ROUNDING),
        ("u_E", &out.u_E, ROUNDING),
        ("u_V", &out.u_V, ROUNDING),
        ("u_Q", &out.u_Q, ROUNDING),
        ("spread_P", &vec![out.spread_P], ROUNDING),
        ("spread_Q", &vec![out.spread_Q], ROUNDING),
        ("spread_E", &vec![out.spread_E], ROUNDING),
        ("error_omega", &vec![out.error_omega], ROUNDING),
        ("error_V", &vec![out.error_V], ROUNDING),
        ("lambda_2", &vec![out.lambda_2], ITERATION * out.lambda_2.abs()),
        ("T_P", &vec![out.T_P], ITERATION * out.T_P.abs()),
        ("T_omega", &vec![out.T_omega], ITERATION * out.T_omega.abs()),
    ] {
        let found = read(fmu, &references(fmu, &[name]));
        for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
            assert!((found - expected).abs() <= tolerance, "{name}[{i}], step {k}: {found} not {expected}");
        }
    }
    let mut saturated = vec![false; AGENTS];
    fmu.get_boolean(&references(fmu, &["saturated"]), &mut saturated).unwrap();
    assert_eq!(saturated, out.saturated, "step {k}");
    let mut cluster = vec![0; AGENTS];
    fmu.get_integer(&references(fmu, &["cluster"]), &mut cluster).unwrap();
    assert_eq!(cluster, out.cluster, "step {k}");
}

#[test]
fn many_agents_are_who_they_are_outside_whatever_their_place_inside() {
    let config = config();
    assert_ne!(Order::local(&config), Order::default(), "nothing would be tested");
    let (mut fmu, mut law) = (instance(&config), Controller::new(config.clone()).unwrap());
    // Parameters too are set by the user's numbers.
    let K_P = Random(77).values(AGENTS, 0.002, 0.006);
    fmu.set_real(&references(&fmu, &["K_P"]), &K_P).unwrap();
    law.parameters_mut().K_P.copy_from_slice(&K_P);
    fmu.enter_initialization_mode().unwrap();
    fmu.exit_initialization_mode().unwrap();
    law.initialise();
    let mut saturated = 0;
    for k in 0..14 {
        measure(k, &mut fmu, &mut law);
        law.refresh(&mut |_| {});
        compare(k, &mut fmu, &law);
        fmu.do_step(fmu.time_s(), STEP_NS as f64 * 1e-9).unwrap();
        law.step(k as i64 * STEP_NS, STEP_NS, &mut |_| {});
        law.refresh(&mut |_| {});
        compare(k, &mut fmu, &law);
        saturated += law.outputs().saturated.iter().filter(|s| **s).count();
        if k % 4 == 2 {
            // What another process wrote goes on in an instance of its own.
            let saved = derivative_support::bytes(&fmu);
            let mut other = instance(&config);
            let copy = other.deserialize(&saved).unwrap();
            other.restore(&copy).unwrap();
            fmu = other;
        }
    }
    let moving = law.outputs().u_omega.iter().filter(|u| u.abs() > 1e-6).count();
    assert!(moving > AGENTS / 2 && saturated > 0, "something was compared");
}

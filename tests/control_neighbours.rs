//! Where the graphs are written out, what an agent does follows its neighbours in them and nobody else, at once:
//! the dependencies that the model description declares.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::config::VoltagePolicy;
use bess_consensus::control::{Config, Controller, Outputs};
use control_support::*;

fn rates(outputs: &Outputs, i: usize) -> [f64; 5] {
    [outputs.u_omega[i], outputs.u_P[i], outputs.u_E[i], outputs.u_V[i], outputs.u_Q[i]]
}

#[test]
fn nobody_hears_an_agent_that_is_no_neighbour_in_any_topology() {
    let n = 12;
    let edges: Vec<_> = (0..n).map(|i| edge(i, (i + 1) % n, 0.7)).chain([edge(0, 6, 0.4)]).collect();
    for policy in [VoltagePolicy::Paper, VoltagePolicy::Average] {
        let config =
            Config { voltage_policy: policy, ..Config::unit(n, explicit(edges.clone(), vec![pin(3, 1.0)])) };
        let mut controller = Controller::new(config).unwrap();
        let mut random = Random(5);
        for i in 0..n {
            controller.inputs_mut().P[i] = random.within(0.0, 1.0);
            controller.inputs_mut().E[i] = random.within(0.2, 0.8);
        }
        controller.inputs_mut().enable = true;
        for k in 0..3 {
            controller.step(k * 10_000_000, 10_000_000, &mut |_| {});
        }
        controller.refresh(&mut |_| {});
        let before = controller.outputs().clone();
        for j in 0..n {
            let kept = controller.inputs().clone();
            let inputs = controller.inputs_mut();
            for values in [&mut inputs.P, &mut inputs.Q, &mut inputs.V, &mut inputs.omega, &mut inputs.E] {
                values[j] += 0.1;
            }
            controller.refresh(&mut |_| {});
            for i in 0..n {
                let heard = i == j || controller.topologies().neighbours(i).any(|k| k == j);
                let changed = rates(controller.outputs(), i) != rates(&before, i);
                assert_eq!(changed, heard, "agents {i} and {j}, {policy:?}");
            }
            *controller.inputs_mut() = kept;
        }
    }
}

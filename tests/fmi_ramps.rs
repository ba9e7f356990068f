//! Input and output derivatives of both models: ramps against staircases, rates against differences.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail")]

mod derivative_support;

use bess_consensus::fmi::{Instance, Interface, Model};
use bess_consensus::models::{Controller, Grid};
use derivative_support::*;

fn start<M: Model>(instance: &mut Instance<M>, switches: &[&str]) {
    instance.enter_initialization_mode().unwrap();
    for switch in switches {
        let reference = references(instance, &[switch]);
        instance.set_boolean(&reference, &[true]).unwrap();
    }
    instance.exit_initialization_mode().unwrap();
}

/// Rates of all setpoints and of some loads of the grid, per s.
fn grid_rates(instance: &Instance<Grid>, loads: bool) -> (Vec<u32>, Vec<f64>) {
    let mut random = Scatter(11);
    let (mut moving, mut rates) = (Vec::new(), Vec::new());
    for (group, size, every) in [
        ("omega_set", 2e-3, 1),
        ("V_set", 0.05, 1),
        ("P_set", 0.5, 1),
        ("Q_set", 0.5, 1),
        ("dP_load", 1.0, 9),
        ("dQ_load", 1.0, 9),
    ] {
        if loads || !group.ends_with("_load") {
            moving.extend(references(instance, &[group]).into_iter().step_by(every));
            rates.resize_with(moving.len(), || size * random.next());
        }
    }
    (moving, rates)
}

fn ramp<M: Model>(instance: &mut Instance<M>, references: &[u32], rates: &[f64]) {
    instance.set_real_input_derivatives(references, &vec![1; references.len()], rates).unwrap();
}

fn rates_of<M: Model>(instance: &mut Instance<M>, references: &[u32]) -> Vec<f64> {
    let mut rates = vec![f64::NAN; references.len()];
    instance.get_real_output_derivatives(references, &vec![1; references.len()], &mut rates).unwrap();
    rates
}

fn largest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Scenario, changed keys, switches on.
type Case = (&'static str, &'static [(&'static str, &'static str)], &'static [&'static str]);

const GRIDS: [Case; 4] = [
    ("case1", &[], &[]),
    ("case1", &[("grid.network", "\"sparse\"")], &[]),
    ("case2", &[], &["tie_closed"]),
    ("case1", &[("grid.load_model", "\"constant_power\"")], &[]),
];

/// A staircase through the middles of a straight line is off by the square of its steps.
#[test]
fn a_ramp_is_the_limit_of_staircases_of_second_order() {
    for (name, set, switches) in GRIDS {
        for loads in [false, true] {
            let mut instance = grid(name, set, Interface::Structured);
            start(&mut instance, switches);
            let (moving, rates) = grid_rates(&instance, loads);
            let unknowns = outputs(&instance);
            let from = instance.snapshot().unwrap();
            let begin = read(&mut instance, &moving);
            let at = |t: f64| begin.iter().zip(&rates).map(|(u, du)| u + du * t).collect::<Vec<f64>>();

            ramp(&mut instance, &moving, &rates);
            instance.do_step(0.0, 0.2).unwrap();
            let ramped = read(&mut instance, &unknowns);
            assert!(largest(&read(&mut instance, &moving), &at(0.2)) < 1e-15);

            let errors = [16, 32, 64].map(|steps| {
                instance.restore(&from).unwrap();
                let h = 0.2 / f64::from(steps);
                for k in 0..steps {
                    instance.set_real(&moving, &at((f64::from(k) + 0.5) * h)).unwrap();
                    instance.do_step(f64::from(k) * h, h).unwrap();
                }
                instance.set_real(&moving, &at(0.2)).unwrap();
                largest(&read(&mut instance, &unknowns), &ramped)
            });
            println!("{name} {set:?} loads {loads}: {errors:?}");
            assert!(errors[0] > 1e-6, "the ramp is no trifle");
            for pair in errors.windows(2) {
                let order = (pair[0] / pair[1]).log2();
                assert!((1.9..2.1).contains(&order), "{name} {set:?} loads {loads}: order {order}");
            }

            // Two halves of a ramp are the ramp: the integrator works to 1e-9 or better.
            instance.restore(&from).unwrap();
            for k in 0..2 {
                ramp(&mut instance, &moving, &rates);
                instance.do_step(f64::from(k) * 0.1, 0.1).unwrap();
            }
            assert!(largest(&read(&mut instance, &unknowns), &ramped) < 1e-7);
        }
    }
}

/// The rate at the present point from two steps forward, the error of the first being taken out by the second.
fn forward<M: Model>(
    instance: &mut Instance<M>,
    unknowns: &[u32],
    (moving, rates): (&[u32], &[f64]),
    h: f64,
) -> Vec<f64> {
    let from = instance.snapshot().unwrap();
    let now = read(instance, unknowns);
    let [one, two] = [h, 2.0 * h].map(|h| {
        instance.restore(&from).unwrap();
        ramp(instance, moving, rates);
        instance.do_step(instance.time_s(), h).unwrap();
        let then = read(instance, unknowns);
        then.iter().zip(&now).map(|(then, now)| (then - now) / h).collect::<Vec<f64>>()
    });
    instance.restore(&from).unwrap();
    one.iter().zip(&two).map(|(one, two)| 2.0 * one - two).collect()
}

#[test]
fn rates_of_the_grid_are_those_of_its_next_moments() {
    for (name, set, switches) in GRIDS {
        let mut instance = grid(name, set, Interface::Structured);
        start(&mut instance, switches);
        let (moving, rates) = grid_rates(&instance, true);
        // Off the steady state, so that all states move by themselves too.
        let nudged: Vec<f64> =
            read(&mut instance, &moving).iter().zip(&rates).map(|(u, du)| u + 0.02 * du).collect();
        instance.set_real(&moving, &nudged).unwrap();
        instance.do_step(0.0, 0.03).unwrap();
        ramp(&mut instance, &moving, &rates);
        for group in ["P", "Q", "E", "V", "omega", "bus_V", "bus_angle", "tie_P", "tie_Q"] {
            let unknowns = references(&instance, &[group]);
            let exact = rates_of(&mut instance, &unknowns);
            let found = forward(&mut instance, &unknowns, (&moving, &rates), 2e-5);
            let size = exact.iter().fold(1e-6, |size: f64, rate| size.max(rate.abs()));
            assert!(group.starts_with("tie") && switches.is_empty() || size > 1e-5, "{group} moves");
            let error = largest(&exact, &found) / size;
            println!("{name} {set:?} {group}: {size:.1e}, off by {error:.1e} of it");
            assert!(error < 1e-5, "{name} {set:?} {group}: {error}");
        }
    }
}

fn moving_controller(set: &[(&str, &str)], interface: Interface, h: f64) -> Instance<Controller> {
    let mut instance = controller("case1", set, interface);
    start(&mut instance, &[]);
    let mut random = Scatter(5);
    for k in 0..40 {
        for (group, centre, width) in
            [("P", 2.0, 0.5), ("Q", 0.5, 0.3), ("V", 1.0, 0.02), ("omega", 1.0, 2e-3), ("E", 0.35, 0.02)]
        {
            let references = references(&instance, &[group]);
            let values: Vec<f64> = references.iter().map(|_| centre + width * random.next()).collect();
            instance.set_real(&references, &values).unwrap();
        }
        if k == 0 {
            let enable = references(&instance, &["enable"]);
            match interface {
                Interface::Structured => instance.set_boolean(&enable, &[true]).unwrap(),
                Interface::Portable => instance.set_real(&enable, &[1.0]).unwrap(),
            }
        }
        instance.do_step(instance.time_s(), h).unwrap();
    }
    instance
}

#[test]
fn the_setpoints_move_at_the_rate_u_and_stand_when_disabled() {
    for set in [&[][..], &[("control.delay_s", "0.05")], &[("control.omega_set_range", "[0.9984, 1.0016]")]] {
        let h = 0.01;
        let mut instance = moving_controller(set, Interface::Structured, h);
        for (setpoint, u) in [("omega_set", "u_omega"), ("V_set", "u_V")] {
            let (setpoint, u) = (references(&instance, &[setpoint]), references(&instance, &[u]));
            let rates = rates_of(&mut instance, &setpoint);
            assert_eq!(rates, read(&mut instance, &u));
            assert!(rates.iter().any(|rate| *rate != 0.0));
            let from = instance.snapshot().unwrap();
            let before = read(&mut instance, &setpoint);
            instance.do_step(instance.time_s(), h).unwrap();
            let after = read(&mut instance, &setpoint);
            let moved: Vec<f64> =
                after.iter().zip(&before).map(|(after, before)| (after - before) / h).collect();
            // Rounding of a number near 1, divided by h.
            assert!(largest(&rates, &moved) < 1e-13, "{set:?}");
            instance.restore(&from).unwrap();
        }
        for held in ["P_set", "Q_set"] {
            let held = references(&instance, &[held]);
            assert_eq!(rates_of(&mut instance, &held), [0.0; 7], "until the next step");
        }
        let (enable, all) = (references(&instance, &["enable"]), outputs(&instance));
        instance.set_boolean(&enable, &[false]).unwrap();
        assert!(rates_of(&mut instance, &all).iter().all(|rate| *rate == 0.0), "nothing moves without ramps");
    }
}

#[test]
fn control_inputs_and_diagnostics_follow_the_ramps() {
    // With a boundary layer wider than the steps, and no exchange, whose P_set would jump.
    let base = [("control.theta_min_s", "0.2"), ("control.gains.E", "0")];
    let filter = r#"{ "omega_s": 0.05, "P_s": 0.1, "V_s": 0.02, "Q_s": 0.1 }"#;
    for more in [&[][..], &[("control.delay_s", "0.0531")], &[("control.measurement_filter", filter)]] {
        let set = [&base[..], more].concat();
        let h = 0.01;
        let mut instance = moving_controller(&set, Interface::Structured, h);
        let moving = inputs(&instance);
        let mut random = Scatter(9);
        let sizes =
            [("P", 0.5), ("Q", 0.5), ("V", 0.02), ("omega", 2e-3), ("omega_ref", 1e-3), ("V_ref", 0.01)];
        let mut rates = vec![0.0; moving.len()];
        for (group, size) in sizes {
            for reference in references(&instance, &[group]) {
                let k = moving.iter().position(|r| *r == reference).unwrap();
                rates[k] = size * random.next();
            }
        }
        ramp(&mut instance, &moving, &rates);
        for group in ["u_omega", "u_P", "u_V", "u_Q", "spread_P", "error_omega", "T_P", "T_omega"] {
            let unknowns = references(&instance, &[group]);
            let exact = rates_of(&mut instance, &unknowns);
            let found = forward(&mut instance, &unknowns, (&moving, &rates), 1e-4);
            let size = exact.iter().fold(1e-9, |size: f64, rate| size.max(rate.abs()));
            let error = largest(&exact, &found) / size;
            println!("{more:?} {group}: {size:.1e}, off by {error:.1e} of it");
            assert!(size > 1e-6 && error < 1e-4, "{more:?} {group}: {error}");
        }
    }
}

#[test]
fn the_portable_interface_gives_the_same_derivatives() {
    let [mut one, mut other] =
        [Interface::Structured, Interface::Portable].map(|interface| moving_controller(&[], interface, 0.01));
    let (moving, unknowns) = (inputs(&one), outputs(&one));
    assert_eq!((moving.clone(), unknowns.clone()), (inputs(&other), outputs(&other)));
    let rates: Vec<f64> = (0..moving.len()).map(|k| 1e-3 * (k as f64).sin()).collect();
    for instance in [&mut one, &mut other] {
        ramp(instance, &moving, &rates);
    }
    assert_eq!(rates_of(&mut one, &unknowns), rates_of(&mut other, &unknowns));
    let along = derivative(&mut one, &unknowns, &moving, &rates);
    assert_eq!(along, derivative(&mut other, &unknowns, &moving, &rates));
    assert!(along.iter().any(|rate| *rate != 0.0));
    one.do_step(one.time_s(), 0.01).unwrap();
    other.do_step(other.time_s(), 0.01).unwrap();
    assert_eq!(read(&mut one, &unknowns), read(&mut other, &unknowns));
}

//! Steps and time in the safe core: what a step does, which communication points are taken, that time is counted,
//! and that a failed step is none.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

mod fmi_mock;
#[path = "fmi_mock/instances.rs"]
mod instances;

use bess_consensus::fmi::{Error, Function, ModelError};
use fmi_mock::{REFRESH_FAILS, STEP_FAILS};
use instances::*;

#[test]
fn the_response_is_the_closed_form_for_any_sequence_of_steps() {
    let mut instance = started(3);
    let mut t = 0.0;
    for h in [0.1, 0.01, 0.5, 1e-9, 0.37, 2.0] {
        instance.do_step(t, h).unwrap();
        t += h;
        for i in 1..=3 {
            let goal = 2.0 * f64::from(i);
            let exact = goal + (0.25 - goal) * f64::exp(-t / 0.5);
            let found = real(&mut instance, &format!("x[{i}]"));
            assert!((found - exact).abs() < 1e-12, "x[{i}] at {t}: {found} against {exact}");
        }
    }
}

#[test]
fn communication_points_heal_or_are_refused_with_both_times() {
    let mut instance = mock(1);
    instance.setup_experiment(-3.5, Some(f64::NAN)).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    assert_eq!(instance.time_s(), -3.5);
    instance.do_step(-3.5, 0.1).unwrap();
    instance.do_step(-3.4000000000000004, 0.099_999_999_999_999_78).unwrap();
    instance.do_step(-3.3 + 0.9e-7, 0.1).unwrap();
    assert_eq!(instance.time_ns(), -3_200_000_000);
    instance.do_step(-3.2 - 0.9e-7, 0.1).unwrap();
    assert_eq!(instance.time_ns(), -3_100_000_000);
    assert!(instance.do_step(-3.1 + 1.1e-7, 0.1).is_err(), "more than a millionth of the step and a ns");
    let before = bytes(&instance);
    let message = instance.do_step(-3.0, 0.1).unwrap_err().to_string();
    assert!(message.contains("-3.0 s") && message.contains("-3.1 s"), "{message}");
    for (t, h) in [
        (-3.1, -0.1),
        (-3.1, f64::NAN),
        (-3.1, f64::INFINITY),
        (f64::NAN, 0.1),
        (f64::INFINITY, 0.1),
        (-3.1, 1e11),
        (-3.1, -f64::MIN_POSITIVE),
        (f64::MAX, f64::MAX),
        (-f64::MAX, 0.1),
    ] {
        let error = instance.do_step(t, h).expect_err(&format!("{t} {h}"));
        assert!(error.to_string().starts_with("fmi2DoStep"), "{error}");
    }
    instance.do_step(-3.1, 0.0).unwrap();
    assert_eq!(bytes(&instance), before, "refused steps and steps of no length change nothing");
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        assert!(mock(1).setup_experiment(bad, None).is_err());
    }
}

#[test]
fn ten_hours_of_summed_steps_count_exactly() {
    let mut instance = started(1);
    let (mut t, h) = (0.0, 0.1);
    for _ in 0..360_000 {
        instance.do_step(t, h).unwrap();
        t += h;
    }
    assert_ne!(t, 36_000.0, "the master's own clock is off");
    assert_eq!(instance.time_s(), 36_000.0);
    assert_eq!(instance.model().0.nanoseconds, 36_000_000_000_000);
}

#[test]
fn a_failed_step_leaves_the_state_and_the_instance_usable() {
    let mut instance = started(2);
    instance.do_step(0.0, 0.1).unwrap();
    set_fault(&mut instance, STEP_FAILS);
    let before = bytes(&instance);
    let error = instance.do_step(0.1, 0.1).unwrap_err();
    let source = ModelError::new("the mock was told to fail in step");
    assert_eq!(error, Error::Model { function: Function::DoStep, source });
    assert_eq!(bytes(&instance), before);
    set_fault(&mut instance, REFRESH_FAILS);
    let reference = reference(&instance, "y[1]");
    assert!(instance.get_real(&[reference], &mut [0.0]).is_err());
    assert_eq!(real(&mut instance, "u[1]"), 1.0, "inputs can be read back even so");
    set_fault(&mut instance, 0);
    instance.do_step(0.1, 0.1).unwrap();
    assert_eq!(integer(&mut instance, "steps"), 2);
}

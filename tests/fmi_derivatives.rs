//! Derivatives of a model that is known in closed form: what they are, when they hold, what is refused. Those of
//! the two real models are in the files beside this one.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

mod fmi_mock;

use bess_consensus::fmi::{Error, Instance, Interface, Logger, Snapshot};
use fmi_mock::{DIFFERENTIATE_FAILS, Mock, STEP_FAILS};

const N: usize = 3;

fn started() -> Instance<Mock> {
    let mut instance =
        Instance::from_model("mock", Mock::with(N), Interface::Structured, Logger::silent()).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance
}

fn reference(name: &str) -> u32 {
    started().registry().reference(name).unwrap_or_else(|| panic!("{name}"))
}

fn get(instance: &mut Instance<Mock>, name: &str) -> f64 {
    let mut value = [f64::NAN];
    instance.get_real(&[reference(name)], &mut value).unwrap();
    value[0]
}

fn ramp(instance: &mut Instance<Mock>, name: &str, rate: f64) {
    instance.set_real_input_derivatives(&[reference(name)], &[1], &[rate]).unwrap();
}

fn bytes(instance: &Instance<Mock>) -> Vec<u8> {
    instance.serialize(&instance.snapshot().unwrap()).unwrap()
}

/// x after `t`, from `x`, with gain 2, tau 0.5 and u = `u` + `du` t.
fn exact(x: f64, u: f64, du: f64, t: f64) -> f64 {
    let rest = 2.0 * (u - 0.5 * du);
    rest + 2.0 * du * t + (x - rest) * (-2.0 * t).exp()
}

#[test]
fn directions_add_up_and_states_are_held() {
    let mut instance = started();
    let names = ["y[1]", "y[2]", "total", "x[1]"].map(reference);
    let mut rates = [f64::NAN; 4];
    let knowns = ["u[1]", "u[2]", "u[1]", "gain"].map(reference);
    let before = bytes(&instance);
    instance.get_directional_derivative(&names, &knowns, &[1.0, -2.0, 4.0, 7.0], &mut rates).unwrap();
    assert_eq!(rates, [5.0, -2.0, 3.0, 0.0], "a known that is named twice counts twice");
    instance.get_directional_derivative(&names, &[], &[], &mut rates).unwrap();
    assert_eq!(rates, [0.0; 4], "what was asked before leaves nothing behind");
    assert!(bytes(&instance) == before);
    instance.terminate().unwrap();
    instance.get_directional_derivative(&names, &knowns, &[1.0; 4], &mut rates).unwrap();
}

#[test]
fn an_input_derivative_holds_for_one_step_and_the_input_arrives() {
    let mut instance = started();
    instance.set_real(&[reference("u[2]")], &[1.5]).unwrap();
    ramp(&mut instance, "u[2]", -3.0);
    instance.do_step(0.0, 0.0).unwrap();
    let x = get(&mut instance, "x[2]");
    instance.do_step(0.0, 0.2).unwrap();
    assert!((get(&mut instance, "x[2]") - exact(x, 1.5, -3.0, 0.2)).abs() < 1e-15);
    let u = get(&mut instance, "u[2]");
    assert_eq!(u, 1.5 - 3.0 * 0.2);
    assert_eq!(
        get(&mut instance, "y[2]"),
        get(&mut instance, "x[2]") + u,
        "outputs are of the end of the step"
    );
    let x = get(&mut instance, "x[2]");
    instance.do_step(0.2, 0.2).unwrap();
    assert_eq!(get(&mut instance, "u[2]"), u, "and then it rests");
    assert!((get(&mut instance, "x[2]") - exact(x, u, 0.0, 0.2)).abs() < 1e-15);

    // In whatever order value and derivative were set.
    let [mut one, mut other] = [started(), started()];
    one.set_real(&[reference("u[1]")], &[0.3]).unwrap();
    ramp(&mut one, "u[1]", 2.0);
    ramp(&mut other, "u[1]", 2.0);
    other.set_real(&[reference("u[1]")], &[0.3]).unwrap();
    one.do_step(0.0, 0.1).unwrap();
    other.do_step(0.0, 0.1).unwrap();
    assert!(bytes(&one) == bytes(&other));

    // A derivative of 0 is none; reset forgets.
    let [mut one, mut other] = [started(), started()];
    ramp(&mut one, "u[1]", 0.0);
    one.do_step(0.0, 0.1).unwrap();
    other.do_step(0.0, 0.1).unwrap();
    assert!(bytes(&one) == bytes(&other));
    let mut fresh =
        Instance::from_model("mock", Mock::with(N), Interface::Structured, Logger::silent()).unwrap();
    let born = bytes(&fresh);
    fresh.set_real_input_derivatives(&[reference("u[1]")], &[1], &[1.0]).unwrap();
    fresh.reset().unwrap();
    assert!(bytes(&fresh) == born);
}

#[test]
fn input_derivatives_are_part_of_the_state() {
    let mut instance = started();
    instance.do_step(0.0, 0.1).unwrap();
    ramp(&mut instance, "u[1]", 2.0);
    let early = instance.snapshot().unwrap();
    let saved = instance.serialize(&early).unwrap();
    instance.do_step(0.1, 0.1).unwrap();
    let late = bytes(&instance);
    instance.restore(&early).unwrap();
    assert!(bytes(&instance) == saved);
    instance.do_step(0.1, 0.1).unwrap();
    assert!(bytes(&instance) == late);
    let mut other = started();
    let copy: Snapshot<Mock> = other.deserialize(&saved).unwrap();
    other.restore(&copy).unwrap();
    other.do_step(0.1, 0.1).unwrap();
    assert!(bytes(&other) == late);
}

#[test]
fn output_derivatives_follow_states_and_input_derivatives() {
    let mut instance = started();
    instance.do_step(0.0, 0.3).unwrap();
    ramp(&mut instance, "u[2]", 0.7);
    let x = get(&mut instance, "x[2]");
    let names = ["x[2]", "y[2]", "total"].map(reference);
    let mut rates = [f64::NAN; 3];
    // Once y is read nothing is left to be brought in line.
    get(&mut instance, "y[2]");
    let before = bytes(&instance);
    instance.get_real_output_derivatives(&names, &[1; 3], &mut rates).unwrap();
    let rate = (2.0 * 2.0 - x) / 0.5;
    assert_eq!(rates, [rate, rate + 0.7, 0.7]);
    assert!(bytes(&instance) == before);
}

#[test]
fn refusals_name_the_culprit_and_change_nothing() {
    let mut instance = started();
    ramp(&mut instance, "u[3]", 4.0);
    get(&mut instance, "y[1]");
    let before = bytes(&instance);
    let (u, y) = (reference("u[1]"), reference("y[1]"));
    let mut refused = |words: &[&str], call: &dyn Fn(&mut Instance<Mock>) -> Result<(), Error>| {
        let message = call(&mut instance).expect_err(words[0]).to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message} lacks one of {words:?}");
        assert!(!message.contains('\n'));
        assert!(bytes(&instance) == before, "{message}");
    };
    let directional = |unknown: u32, known: u32, seed: f64| {
        move |i: &mut Instance<Mock>| {
            i.get_directional_derivative(&[unknown], &[u, known], &[1.0, seed], &mut [0.0])
        }
    };
    let as_known = "expected a continuous Real input or a tunable Real parameter";
    refused(&["x[1] is a continuous output", as_known], &directional(y, reference("x[1]"), 1.0));
    refused(&["tau is a fixed parameter", as_known], &directional(y, reference("tau"), 1.0));
    refused(&["mode is of type Integer"], &directional(y, reference("mode"), 1.0));
    refused(&["enable is of type Boolean"], &directional(y, reference("enable"), 1.0));
    refused(&["u[1] is a continuous input; expected a continuous Real output"], &directional(u, u, 1.0));
    refused(&["gain is a tunable parameter"], &directional(reference("gain"), u, 1.0));
    refused(&["steps is of type Integer"], &directional(reference("steps"), u, 1.0));
    refused(&["the derivative of u[1]", "NaN", "finite"], &directional(y, u, f64::NAN));
    refused(&["value reference 99"], &directional(99, u, 1.0));
    refused(&["value reference 99"], &directional(y, 99, 1.0));
    refused(&["2 values for 1"], &|i| i.get_directional_derivative(&[y], &[u], &[1.0, 2.0], &mut [0.0]));

    let inputs = |reference: u32, order: i32, rate: f64| {
        move |i: &mut Instance<Mock>| i.set_real_input_derivatives(&[u, reference], &[1, order], &[9.0, rate])
    };
    refused(&["order 2 of u[2]; expected order 1"], &inputs(reference("u[2]"), 2, 1.0));
    refused(&["order 0 of u[2]"], &inputs(reference("u[2]"), 0, 1.0));
    refused(&["the derivative of u[2] = inf"], &inputs(reference("u[2]"), 1, f64::INFINITY));
    refused(
        &["gain is a tunable parameter; expected a continuous Real input"],
        &inputs(reference("gain"), 1, 1.0),
    );
    refused(&["y[1] is a continuous output"], &inputs(y, 1, 1.0));
    refused(&["mode is of type Integer"], &inputs(reference("mode"), 1, 1.0));
    refused(&["1 values for 2"], &|i| i.set_real_input_derivatives(&[u, u + 1], &[1, 1], &[1.0]));
    refused(&["1 values for 2"], &|i| i.set_real_input_derivatives(&[u, u + 1], &[1], &[1.0, 1.0]));

    let outputs = |reference: u32, order: i32| {
        move |i: &mut Instance<Mock>| {
            i.get_real_output_derivatives(&[y, reference], &[1, order], &mut [0.0; 2])
        }
    };
    refused(&["order 2 of x[1]"], &outputs(reference("x[1]"), 2));
    refused(&["u[1] is a continuous input; expected a continuous Real output"], &outputs(u, 1));
    refused(&["settled is of type Boolean"], &outputs(reference("settled"), 1));

    for (fault, words) in [(DIFFERENTIATE_FAILS, "to fail in differentiate"), (STEP_FAILS, "to fail in step")]
    {
        let mut instance = started();
        ramp(&mut instance, "u[1]", 4.0);
        instance.set_integer(&[reference("fault")], &[fault]).unwrap();
        get(&mut instance, "y[1]");
        let before = bytes(&instance);
        let failed = match fault {
            DIFFERENTIATE_FAILS => directional(y, u, 1.0)(&mut instance),
            _ => instance.do_step(0.0, 0.1),
        };
        assert!(failed.unwrap_err().to_string().contains(words));
        assert!(bytes(&instance) == before, "the ramp is still there");
    }
    let mut instance = started();
    instance.set_real(&[u], &[1e30]).unwrap();
    ramp(&mut instance, "u[1]", 1e30);
    let before = bytes(&instance);
    let message = instance.do_step(0.0, 10.0).unwrap_err().to_string();
    assert!(message.contains("u[1] = 1.1e31 is refused; expected a finite value, at most 1e30"), "{message}");
    assert!(bytes(&instance) == before);
}

#[test]
fn what_is_no_real_variable_stays_none_in_the_portable_interface() {
    let mut instance =
        Instance::from_model("mock", Mock::with(N), Interface::Portable, Logger::silent()).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    let mut rates = [f64::NAN];
    let (u, y) = (reference("u[1]"), reference("y[1]"));
    instance.get_directional_derivative(&[y], &[u], &[3.0], &mut rates).unwrap();
    assert_eq!(rates, [3.0]);
    for (unknown, known, words) in [
        (y, reference("enable"), "enable is a discrete input"),
        (reference("steps"), u, "steps is a discrete output"),
    ] {
        let refused = instance.get_directional_derivative(&[unknown], &[known], &[1.0], &mut rates);
        assert!(refused.unwrap_err().to_string().contains(words));
    }
    assert!(instance.set_real_input_derivatives(&[reference("mode")], &[1], &[1.0]).is_err());
}

//! The 34 symbols from C's side: pointers, call order, values. Instances and their states are in
//! `fmi_c_instances.rs`, what goes wrong in `fmi_c_faults.rs`; what the calls mean is tested in `fmi_instance.rs`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![cfg_attr(miri, feature(c_variadic))]
#![allow(clippy::undocumented_unsafe_blocks, clippy::multiple_unsafe_ops_per_block)]

#[path = "fmi_mock/component.rs"]
mod component;
mod fmi_mock;
#[path = "fmi_mock/importer.rs"]
mod importer;

use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Function, State};
use component::*;
use importer::*;
use std::collections::BTreeSet;
use std::ffi::{CStr, c_char};
use std::ptr::{null, null_mut};

#[test]
fn version_and_platform() {
    let text = |pointer: *const c_char| unsafe { CStr::from_ptr(pointer) }.to_str().unwrap();
    assert_eq!(text(unsafe { fmi2GetVersion() }), "2.0");
    assert_eq!(text(unsafe { fmi2GetTypesPlatform() }), "default");
}

#[test]
fn a_null_component_is_an_error_everywhere_and_free_a_no_op() {
    let mut names: BTreeSet<&str> = harmless_calls().iter().map(|(name, _)| *name).collect();
    for (name, call) in harmless_calls() {
        assert_eq!(call(null_mut()), ERROR, "{name}");
    }
    unsafe { fmi2FreeInstance(null_mut()) };
    names.extend(["fmi2Instantiate", "fmi2FreeInstance", "fmi2GetVersion", "fmi2GetTypesPlatform"]);
    assert_eq!(names, Function::ALL.iter().map(|f| f.name()).collect(), "every function was called");
}

#[test]
fn the_call_order_table_holds_for_every_symbol() {
    let calls = harmless_calls();
    for state in [State::Instantiated, State::Initialization, State::Step, State::Terminated] {
        for (name, call) in &calls {
            let fmu = Fmu::new();
            unsafe {
                if state != State::Instantiated {
                    assert_eq!(fmi2EnterInitializationMode(fmu.c), OK);
                }
                if matches!(state, State::Step | State::Terminated) {
                    assert_eq!(fmi2ExitInitializationMode(fmu.c), OK);
                }
                if state == State::Terminated {
                    assert_eq!(fmi2Terminate(fmu.c), OK);
                }
            }
            let status = call(fmu.c);
            let lines = fmu.lines();
            let turned_away = lines.iter().any(|line| line.text.contains("not allowed in state"));
            let function = Function::ALL.iter().find(|f| f.name() == *name).unwrap();
            assert_eq!(turned_away, !function.is_allowed(state), "{name} in {state}: {lines:?}");
            assert_eq!(lines.len(), usize::from(status != OK), "one line for each refused call: {lines:?}");
            for line in lines {
                assert!(line.text.starts_with(name), "{line:?}");
                assert_eq!(line.status, status);
            }
        }
    }
}

#[test]
fn null_arrays_are_fine_when_empty_and_named_when_not() {
    let fmu = Fmu::started();
    let (vr, value) = (1_u32, 1.0);
    unsafe {
        assert_eq!(fmi2SetReal(fmu.c, null(), 0, null()), OK);
        assert_eq!(fmi2GetReal(fmu.c, null(), 0, null_mut()), OK);
        assert_eq!(fmu.lines(), []);
        assert_eq!(fmi2SetReal(fmu.c, null(), 1, &raw const value), ERROR);
        let line = fmu.line().text;
        assert!(line.contains("fmi2SetReal") && line.contains("vr") && line.contains("NULL"), "{line}");
        assert_eq!(fmi2SetReal(fmu.c, &raw const vr, 1, null()), ERROR);
        assert!(fmu.line().text.contains("argument value is NULL"));
        assert_eq!(fmi2GetReal(fmu.c, &raw const vr, 1, null_mut()), ERROR);
        assert_eq!(fmi2GetInteger(fmu.c, null(), 3, null_mut()), ERROR);
        assert_eq!(fmi2GetBoolean(fmu.c, null(), 3, null_mut()), ERROR);
        assert_eq!(fmi2SetInteger(fmu.c, null(), 3, null()), ERROR);
        assert_eq!(fmi2SetBoolean(fmu.c, null(), 3, null()), ERROR);
        assert_eq!(fmi2SetDebugLogging(fmu.c, 1, 2, null()), ERROR);
        fmu.lines();
        // A length that no array can have, and a pointer into the middle of a number.
        assert_eq!(fmi2GetReal(fmu.c, &raw const vr, usize::MAX, [value].as_mut_ptr()), ERROR);
        assert!(fmu.line().text.contains("longer than the address space"));
        let numbers = [1_u32, 1];
        let crooked = numbers.as_ptr().cast::<u8>().wrapping_add(1).cast::<u32>();
        assert_eq!(fmi2SetReal(fmu.c, crooked, 1, &raw const value), ERROR);
        assert!(fmu.line().text.contains("misaligned"));
        assert_eq!(fmi2GetString(fmu.c, &raw const vr, 1, null_mut()), ERROR);
        assert_eq!(fmi2SetString(fmu.c, &raw const vr, 1, null()), ERROR);
    }
}

#[test]
fn integers_and_booleans_cross_the_border() {
    let fmu = Fmu::started();
    let (mode, enable, settled) = (reference(2, "mode"), reference(2, "enable"), reference(2, "settled"));
    let (two, mut value) = (2, 0);
    unsafe {
        assert_eq!(fmi2SetInteger(fmu.c, &raw const mode, 1, &raw const two), OK);
        assert_eq!(fmi2GetInteger(fmu.c, &raw const mode, 1, &raw mut value), OK);
        assert_eq!(value, 2);
        for (set, expected) in [(0, 0), (1, 1), (-1, 1), (256, 1)] {
            assert_eq!(fmi2SetBoolean(fmu.c, &raw const enable, 1, &raw const set), OK);
            assert_eq!(fmi2GetBoolean(fmu.c, &raw const enable, 1, &raw mut value), OK);
            assert_eq!(value, expected, "{set}");
        }
        assert_eq!(fmi2GetBoolean(fmu.c, &raw const settled, 1, &raw mut value), OK);
        assert_eq!(fmi2SetBoolean(fmu.c, &raw const settled, 1, &raw const value), ERROR);
        assert!(fmu.line().text.contains("settled cannot be set: it is an output"));
    }
}

#[test]
fn derivatives_cross_the_border() {
    let fmu = Fmu::started();
    let (u, x, y, total) =
        (reference(2, "u[1]"), reference(2, "x[1]"), reference(2, "y[1]"), reference(2, "total"));
    let (order, du, mut rate) = (1, 0.5, f64::NAN);
    unsafe {
        let (unknowns, knowns, seeds) = ([y, total, x], [u, u + 1], [2.0, 3.0]);
        let mut rates = [f64::NAN; 3];
        let directional = |unknowns: *const u32, knowns: *const u32, seeds: *const f64, rates: *mut f64| {
            fmi2GetDirectionalDerivative(fmu.c, unknowns, 3, knowns, 2, seeds, rates)
        };
        let (v, k, d) = (unknowns.as_ptr(), knowns.as_ptr(), seeds.as_ptr());
        assert_eq!(directional(v, k, d, rates.as_mut_ptr()), OK);
        assert_eq!(rates, [2.0, 5.0, 0.0]);
        for (argument, v, k, d, rates) in [
            ("vUnknown_ref", null(), k, d, rates.as_mut_ptr()),
            ("vKnown_ref", v, null(), d, rates.as_mut_ptr()),
            ("dvKnown", v, k, null(), rates.as_mut_ptr()),
            ("dvUnknown", v, k, d, null_mut()),
        ] {
            assert_eq!(directional(v, k, d, rates), ERROR);
            let line = fmu.line();
            assert!(line.text.contains(&format!("argument {argument} is NULL")), "{line:?}");
        }
        assert_eq!(fmi2GetDirectionalDerivative(fmu.c, null(), 0, null(), 0, null(), null_mut()), OK);
        assert_eq!(fmi2SetRealInputDerivatives(fmu.c, null(), 0, null(), null()), OK);
        assert_eq!(fmi2GetRealOutputDerivatives(fmu.c, null(), 0, null(), null_mut()), OK);
        assert_eq!(fmi2SetRealInputDerivatives(fmu.c, &raw const u, 1, null(), &raw const du), ERROR);
        assert_eq!(fmi2GetRealOutputDerivatives(fmu.c, &raw const y, 1, null(), &raw mut rate), ERROR);
        fmu.lines();

        assert_eq!(fmi2SetRealInputDerivatives(fmu.c, &raw const u, 1, &raw const order, &raw const du), OK);
        assert_eq!(fmi2GetRealOutputDerivatives(fmu.c, &raw const y, 1, &raw const order, &raw mut rate), OK);
        // x' = (gain u - x) / tau = (2 - 0.25) / 0.5, and y = x + u.
        assert_eq!(rate, 3.5 + 0.5);
        assert_eq!(fmi2DoStep(fmu.c, 0.0, 0.5, 1), OK);
        assert_eq!(fmu.real("u[1]"), 1.25);
    }
}

#[test]
fn status_functions_say_what_is_not_there() {
    let fmu = Fmu::started();
    let (mut real, mut boolean, mut status, mut integer, mut string) = (f64::NAN, 7, 7, 7, null());
    unsafe {
        assert_eq!(fmi2DoStep(fmu.c, 0.0, 0.25, 1), OK);
        assert_eq!(fmi2GetRealStatus(fmu.c, fmi2StatusKind_fmi2LastSuccessfulTime, &raw mut real), OK);
        assert_eq!(real, 0.25);
        assert_eq!(fmi2GetBooleanStatus(fmu.c, fmi2StatusKind_fmi2Terminated, &raw mut boolean), OK);
        assert_eq!(boolean, 0);
        assert_eq!(fmi2GetRealStatus(fmu.c, fmi2StatusKind_fmi2LastSuccessfulTime, null_mut()), ERROR);
        fmu.lines();
        assert_eq!(fmi2GetStatus(fmu.c, fmi2StatusKind_fmi2DoStepStatus, &raw mut status), DISCARD);
        assert_eq!(fmi2GetIntegerStatus(fmu.c, 0, &raw mut integer), DISCARD);
        assert_eq!(fmi2GetStringStatus(fmu.c, fmi2StatusKind_fmi2PendingStatus, &raw mut string), DISCARD);
        assert_eq!(fmi2GetRealStatus(fmu.c, 99, &raw mut real), DISCARD);
        assert_eq!(fmi2GetBooleanStatus(fmu.c, 0, &raw mut boolean), DISCARD);
        assert!(fmu.lines().iter().all(|l| (l.status, l.category.as_str()) == (DISCARD, "logStatusDiscard")));
        assert_eq!(fmi2CancelStep(fmu.c), ERROR);
        assert!(fmu.line().text.contains("no step is in progress"));
    }
}

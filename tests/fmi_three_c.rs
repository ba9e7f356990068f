//! The 75 symbols of FMI 3.0 from C's side, over a mock: pointers, call order, values. Configuration mode and states are in
//! `fmi_three_states.rs`; what the calls mean with the real models is tested in FMPy against FMI 2.0.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![allow(clippy::undocumented_unsafe_blocks, clippy::multiple_unsafe_ops_per_block)]

#[path = "fmi_mock/component3.rs"]
mod component3;
mod fmi_mock;
#[path = "fmi_mock/importer3.rs"]
mod importer3;

use bess_consensus::fmi::three::bindings::*;
use bess_consensus::fmi::three::{Function, State};
use component3::*;
use fmi_mock::resources::Resources;
use fmi_mock::{DIFFERENTIATE_FAILS, REFRESH_FAILS, REFRESH_PANICS, STEP_FAILS, STEP_LOGS, STEP_PANICS};
use importer3::*;
use std::collections::BTreeSet;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

#[test]
fn a_null_instance_is_an_error_everywhere_and_free_a_no_op() {
    assert_eq!(unsafe { CStr::from_ptr(fmi3GetVersion()) }, c"3.0");
    let mut names: BTreeSet<&str> = harmless_calls().iter().map(|(name, _)| *name).collect();
    for (name, call) in harmless_calls() {
        assert_eq!(call(null_mut()), ERROR, "{name}");
    }
    unsafe { fmi3FreeInstance(null_mut()) };
    let others = ["ModelExchange", "CoSimulation", "ScheduledExecution"];
    let others: Vec<String> = others.iter().map(|kind| format!("fmi3Instantiate{kind}")).collect();
    names.extend(others.iter().map(String::as_str));
    names.extend(["fmi3FreeInstance", "fmi3GetVersion"]);
    assert_eq!(names, Function::ALL.iter().map(|f| f.name()).collect(), "every function was called");
}

#[test]
fn the_call_order_table_holds_for_every_symbol() {
    use State::{Configuration, Initialization, Instantiated, Step, Terminated};
    for state in [Instantiated, Configuration, Initialization, Step, Terminated] {
        for (name, call) in harmless_calls() {
            let fmu = Fmu::new();
            unsafe {
                match state {
                    Configuration => assert_eq!(fmi3EnterConfigurationMode(fmu.c), OK),
                    Initialization => {
                        assert_eq!(fmi3EnterInitializationMode(fmu.c, false, 0.0, 0.0, false, 0.0), OK);
                    }
                    Step => fmu.start(),
                    Terminated => {
                        fmu.start();
                        assert_eq!(fmi3Terminate(fmu.c), OK);
                    }
                    _ => {}
                }
            }
            let status = call(fmu.c);
            let lines = fmu.lines();
            let turned_away = lines.iter().any(|line| line.text.contains("not allowed in state"));
            let function = Function::ALL.iter().find(|f| f.name() == name).unwrap();
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
fn what_cannot_be_instantiated_says_why() {
    let (record, resources) = (Record::default(), Resources::new(2));
    let (path, token) = (resources.path().display().to_string(), token(2));
    let refused = |token: &str, path: &str, options, says: &[&str]| {
        assert!(instantiate_with("fmu", token, path, &record, options).is_null());
        let lines = record.lines.take();
        assert!(lines.len() == 1 && says.iter().all(|word| lines[0].text.contains(word)), "{lines:?}");
        assert!(lines[0].text.starts_with("fmi3InstantiateCoSimulation: "), "{lines:?}");
    };
    refused("other", &path, (false, 0), &["instantiationToken is \"other\"", &token]);
    refused(
        &token,
        "/no/such/folder",
        (false, 0),
        &["resourcePath", "/no/such/folder", "no readable folder"],
    );
    refused(&token, "", (false, 0), &["resourcePath"]);
    refused(&token, &path, (true, 0), &["eventModeUsed = true", "hasEventMode is false"]);
    refused(&token, &path, (false, 2), &["nRequiredIntermediateVariables = 2"]);
    let panics = Resources::new(666);
    refused(&token, &panics.path().display().to_string(), (false, 0), &["internal error", "while loading"]);
    let environment = (&raw const record).cast_mut().cast();
    unsafe {
        let name = c"fmu".as_ptr();
        for path in [null(), c"x".as_ptr()] {
            let c = fmi3InstantiateCoSimulation(
                name,
                null(),
                path,
                false,
                true,
                false,
                false,
                null(),
                0,
                environment,
                Some(log),
                None,
            );
            assert!(c.is_null());
        }
        assert!(record.lines.take().iter().all(|line| line.text.contains("instantiationToken is NULL")));
        let c = fmi3InstantiateModelExchange(name, name, name, false, false, environment, Some(log));
        assert!(c.is_null() && record.lines.take()[0].text.contains("no ModelExchange element"));
        let c = fmi3InstantiateScheduledExecution(
            name,
            name,
            name,
            false,
            false,
            environment,
            Some(log),
            None,
            None,
            None,
        );
        assert!(c.is_null() && record.lines.take()[0].text.contains("no ScheduledExecution element"));
        // Neither a name nor a logger is needed.
        let (token, path) = (format!("{{{token}}}\0"), format!("file://{path}\0"));
        let (token, path) = (token.as_ptr().cast(), path.as_ptr().cast());
        let c = fmi3InstantiateCoSimulation(
            null(),
            token,
            path,
            false,
            true,
            false,
            true,
            null(),
            0,
            null_mut(),
            None,
            None,
        );
        assert!(!c.is_null());
        assert_eq!(fmi3DoStep(c, 0.0, 0.0, true, null_mut(), null_mut(), null_mut(), null_mut()), ERROR);
        fmi3FreeInstance(c);
    }
}

#[test]
fn arrays_cross_the_border_whole_and_in_any_order() {
    let fmu = Fmu::started();
    assert_eq!(fmu.set(&["u"], &[3.0, 5.0]), OK);
    assert_eq!(fmu.get(&["u"], 2).unwrap(), [3.0, 5.0]);
    // In order, against it, with a gap, twice, and between what the model does not know.
    assert_eq!(fmu.get(&["u", "x", "y"], 6).unwrap(), [3.0, 5.0, 0.25, 0.25, 3.25, 5.25]);
    assert_eq!(fmu.get(&["y", "u"], 4).unwrap(), [3.25, 5.25, 3.0, 5.0]);
    assert_eq!(fmu.get(&["total", "u", "total"], 4).unwrap(), [8.0, 3.0, 5.0, 8.0]);
    assert_eq!(fmu.get(&["time", "y", "bias", "gain"], 5).unwrap(), [0.0, 3.25, 5.25, 0.0, 2.0]);
    assert_eq!(fmu.set(&["gain", "u"], &[4.0, 1.0, 2.0]), OK);
    assert_eq!(fmu.get(&["u", "gain"], 3).unwrap(), [1.0, 2.0, 4.0]);
    assert_eq!(fmu.get(&[], 0).unwrap(), [0.0; 0]);
    let (mut number, mut truth, mut sizes) = (0, 9_u8, [0; 3]);
    let [mode, enable, settled] = ["mode", "enable", "settled"].map(reference);
    unsafe {
        assert_eq!(fmi3SetInt32(fmu.c, &raw const mode, 1, &raw const number, 1), ERROR);
        assert!(fmu.line().contains("mode = 0 is refused; expected a finite value >= 1 and <= 3"));
        number = 3;
        assert_eq!(fmi3SetInt32(fmu.c, &raw const mode, 1, &raw const number, 1), OK);
        assert_eq!(fmi3GetInt32(fmu.c, &raw const mode, 1, &raw mut number, 1), OK);
        assert_eq!(number, 3);
        for (set, expected) in [(0, 0), (1, 1), (255, 1)] {
            assert_eq!(fmi3SetBoolean(fmu.c, &raw const enable, 1, &raw const set, 1), OK);
            assert_eq!(fmi3GetBoolean(fmu.c, &raw const enable, 1, &raw mut truth, 1), OK);
            assert_eq!(truth, expected, "{set}");
        }
        assert_eq!(fmi3GetBoolean(fmu.c, &raw const settled, 1, &raw mut truth, 1), OK);
        assert_eq!(truth, 0);
        let numbers = ["whose", "m", "n"].map(reference);
        assert_eq!(fmi3GetUInt64(fmu.c, numbers.as_ptr(), 3, sizes.as_mut_ptr(), 3), OK);
        assert_eq!(sizes, [0, 1, 2]);
    }
    assert_eq!(fmu.lines(), []);
}

#[test]
fn a_step_says_that_nothing_else_is_to_be_done() {
    let fmu = Fmu::started();
    assert_eq!(fmu.step(0.0, 0.5), (OK, [false; 3], 0.5));
    // x' = (gain u - x) / tau from 0.25 with u = (1, 2), gain 2, tau 0.5.
    let decay = (-1.0_f64).exp();
    assert_eq!(fmu.get(&["x"], 2).unwrap(), [2.0 - 1.75 * decay, 4.0 - 3.75 * decay]);
    assert_eq!(fmu.get(&["time"], 1).unwrap(), [0.5]);
    fmu.refuses(&["fmi3DoStep", "currentCommunicationPoint is 2.0 s", "stands at 0.5 s"], || {
        fmu.step(2.0, 0.1).0
    });
    fmu.refuses(&["fmi3DoStep", "communicationStepSize = -0.1"], || fmu.step(0.5, -0.1).0);
    fmu.refuses(&["fmi3DoStep", "argument lastSuccessfulTime is NULL"], || unsafe {
        let mut flags = [false; 3];
        let [a, b, c] = &mut flags;
        fmi3DoStep(fmu.c, 0.5, 0.1, true, a, b, c, null_mut())
    });
    fmu.refuses(&["fmi3DoStep", "argument eventHandlingNeeded is NULL"], || unsafe {
        let (mut flags, mut end) = ([false; 2], 0.0);
        let [b, c] = &mut flags;
        fmi3DoStep(fmu.c, 0.5, 0.1, true, null_mut(), b, c, &raw mut end)
    });
}

#[test]
fn refused_values_are_named_and_change_nothing() {
    let fmu = Fmu::started();
    let get = |vr: u32, n: usize, values: usize| unsafe {
        fmi3GetFloat64(fmu.c, &raw const vr, n, [0.0; 9].as_mut_ptr(), values)
    };
    let (u, mode) = (reference("u"), reference("mode"));
    for (says, call) in [
        (&["fmi3SetFloat64", "u[2] = NaN"][..], (&["u"][..], &[1.0, f64::NAN][..])),
        (&["fmi3SetFloat64", "gain = -1", "> 0"], (&["u", "gain"], &[7.0, 8.0, -1.0])),
        (&["fmi3SetFloat64", "nValues = 1; expected 2", "u (2)"], (&["u"], &[1.0])),
        (&["fmi3SetFloat64", "nValues = 3; expected 2"], (&["u"], &[1.0; 3])),
        (&["fmi3SetFloat64", "nValues = 2; expected 0", "no variables"], (&[], &[1.0; 2])),
        (&["fmi3SetFloat64", "x[1] cannot be set: it is an output"], (&["x"], &[1.0; 2])),
        (&["fmi3SetFloat64", "tau cannot be set", "fixed parameter"], (&["u", "tau"], &[1.0; 3])),
        (&["fmi3SetFloat64", "bias cannot be set", "fixed parameter"], (&["u", "bias"], &[1.0; 3])),
        (&["fmi3SetFloat64", "time cannot be set", "independent"], (&["time"], &[1.0])),
        (&["fmi3SetFloat64", "mode is of type Int32", "Float64"], (&["u", "mode"], &[1.0; 3])),
        (&["fmi3SetFloat64", "n is of type UInt64", "Float64"], (&["n"], &[1.0])),
    ] {
        let (names, values) = call;
        fmu.refuses(says, || fmu.set(names, values));
    }
    fmu.refuses(&["fmi3GetFloat64", "value reference 99 (element 0", "expected 0 to 16"], || get(99, 1, 1));
    fmu.refuses(&["fmi3GetFloat64", "mode is of type Int32; expected a variable of type Float64"], || {
        get(mode, 1, 1)
    });
    fmu.refuses(&["fmi3GetFloat64", "nValues = 9; expected 2"], || get(u, 1, 9));
    fmu.refuses(&["fmi3SetUInt64", "n cannot be set", "configuration mode"], || fmu.set_number("n", &[3]));
    fmu.refuses(&["fmi3SetUInt64", "whose cannot be set", "fixed parameter"], || {
        fmu.set_number("whose", &[1])
    });
    unsafe {
        let one = 1.0;
        fmu.refuses(&["fmi3SetFloat64", "argument valueReferences is NULL"], || {
            fmi3SetFloat64(fmu.c, null(), 1, &raw const one, 1)
        });
        fmu.refuses(&["fmi3SetFloat64", "argument values is NULL"], || {
            fmi3SetFloat64(fmu.c, &raw const u, 1, null(), 2)
        });
        fmu.refuses(&["fmi3GetFloat64", "longer than the address space"], || get(u, usize::MAX, 1));
        fmu.refuses(&["fmi3GetInt8", "u is of type Float64; expected a variable of type Int8"], || {
            fmi3GetInt8(fmu.c, &raw const u, 1, [0; 2].as_mut_ptr(), 2)
        });
        fmu.refuses(&["fmi3SetString", "u is of type Float64; expected a variable of type String"], || {
            fmi3SetString(fmu.c, &raw const u, 1, null(), 2)
        });
        fmu.refuses(&["fmi3GetClock", "value reference 77"], || {
            fmi3GetClock(fmu.c, [77_u32].as_ptr(), 1, null_mut())
        });
        fmu.refuses(&["fmi3EnterEventMode", "hasEventMode is false"], || fmi3EnterEventMode(fmu.c));
        fmu.refuses(&["fmi3SetTime", "model exchange"], || fmi3SetTime(fmu.c, 1.0));
    }
}

#[test]
fn what_goes_wrong_in_the_model_is_told_and_a_panic_stays_inside() {
    let fmu = Fmu::started();
    fmu.set_fault(STEP_FAILS);
    fmu.refuses(&["fmi3DoStep: the mock was told to fail in step"], || fmu.step(0.0, 0.1).0);
    fmu.set_fault(REFRESH_FAILS);
    fmu.refuses(&["fmi3GetFloat64: the mock was told to fail in refresh"], || {
        fmu.get(&["u", "y"], 4).unwrap_err()
    });
    fmu.set_fault(STEP_LOGS);
    assert_eq!(fmu.step(0.0, 0.1).0, OK);
    let lines = fmu.lines();
    let found: Vec<_> = lines.iter().map(|l| (l.status, l.category.as_str(), l.text.as_str())).collect();
    let expected = [
        (OK, "logEvents", "an event at 0 s, 100%s sure"),
        (fmi3Status_fmi3Warning, "logStatusWarning", "a warning"),
    ];
    assert_eq!(found, expected);
    for fault in [STEP_PANICS, REFRESH_PANICS] {
        let fmu = Fmu::started();
        fmu.set_fault(fault);
        let status =
            if fault == STEP_PANICS { fmu.step(0.0, 0.1).0 } else { fmu.get(&["y"], 2).unwrap_err() };
        assert_eq!(status, FATAL);
        assert!(fmu.line().contains("internal error"));
        assert_eq!(fmu.step(0.0, 0.1).0, FATAL);
        let line = fmu.lines().remove(0);
        assert_eq!((line.status, line.category.as_str()), (FATAL, "logStatusFatal"));
        assert!(line.text.starts_with("fmi3DoStep: this instance is unusable"));
    }
}

#[test]
fn a_logger_that_calls_back_is_turned_away() {
    let fmu = Fmu::started();
    *fmu.record.call_back.borrow_mut() = Some(fmu.c);
    assert_eq!(fmu.set(&["u"], &[f64::NAN; 2]), ERROR);
    *fmu.record.call_back.borrow_mut() = None;
    assert_eq!(*fmu.record.call_back_status.borrow(), Some(ERROR));
    assert_eq!(fmu.step(0.0, 0.1).0, OK);
}

#[test]
fn derivatives_of_arrays_cross_the_border() {
    let fmu = Fmu::started();
    let [u, x, y, total, enable] = ["u", "x", "y", "total", "enable"].map(reference);
    let directional = |unknowns: &[u32], knowns: &[u32], seeds: &[f64], rates: &mut [f64]| unsafe {
        let (v, nv, k, nk) = (unknowns.as_ptr(), unknowns.len(), knowns.as_ptr(), knowns.len());
        let (d, nd, r, nr) = (seeds.as_ptr(), seeds.len(), rates.as_mut_ptr(), rates.len());
        fmi3GetDirectionalDerivative(fmu.c, v, nv, k, nk, d, nd, r, nr)
    };
    let mut rates = [f64::NAN; 5];
    assert_eq!(directional(&[y, total, x], &[u], &[2.0, 3.0], &mut rates), OK);
    assert_eq!(rates, [2.0, 3.0, 5.0, 0.0, 0.0]);
    fmu.refuses(&["fmi3GetDirectionalDerivative", "nSeed = 1; expected 2"], || {
        directional(&[y], &[u], &[1.0], &mut [0.0; 2])
    });
    fmu.refuses(&["fmi3GetDirectionalDerivative", "nSensitivity = 1; expected 2"], || {
        directional(&[y], &[u], &[1.0; 2], &mut [0.0])
    });
    fmu.refuses(
        &["fmi3GetDirectionalDerivative", "u is a continuous input; expected a continuous Float64"],
        || directional(&[u], &[u], &[1.0; 2], &mut [0.0; 2]),
    );
    fmu.refuses(&["fmi3GetDirectionalDerivative", "enable is of type Boolean"], || {
        directional(&[y], &[enable], &[1.0], &mut [0.0; 2])
    });
    fmu.refuses(&["fmi3GetAdjointDerivative", "providesAdjointDerivatives is false"], || unsafe {
        fmi3GetAdjointDerivative(fmu.c, null(), 0, null(), 0, null(), 0, null_mut(), 0)
    });
    let output = |order: i32, rates: &mut [f64]| unsafe {
        fmi3GetOutputDerivatives(fmu.c, &raw const x, 1, &raw const order, rates.as_mut_ptr(), rates.len())
    };
    let mut rates = [f64::NAN; 2];
    assert_eq!(output(1, &mut rates), OK);
    // x' = (gain u - x) / tau with u = (1, 2).
    assert_eq!(rates, [3.5, 7.5]);
    fmu.refuses(&["fmi3GetOutputDerivatives", "order 2 of x; expected order 1"], || output(2, &mut [0.0; 2]));
    fmu.refuses(&["fmi3GetOutputDerivatives", "nValues = 1; expected 2"], || output(1, &mut [0.0]));
    fmu.set_fault(DIFFERENTIATE_FAILS);
    fmu.refuses(&["fmi3GetOutputDerivatives: the mock was told to fail"], || output(1, &mut [0.0; 2]));
}

//! What goes wrong, from C's side: log lines, the panic fence, errors of the model, a logger that calls back.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![cfg_attr(miri, feature(c_variadic))]
#![allow(clippy::undocumented_unsafe_blocks, clippy::multiple_unsafe_ops_per_block)]

#[path = "fmi_mock/component.rs"]
mod component;
mod fmi_mock;
#[path = "fmi_mock/importer.rs"]
mod importer;

use bess_consensus::fmi::bindings::*;
use component::*;
use fmi_mock::{REFRESH_PANICS, STEP_FAILS, STEP_LOGS, STEP_PANICS};
use importer::*;
use std::ffi::c_char;
use std::ptr::{null, null_mut};

#[test]
fn lines_arrive_through_percent_s_with_a_known_category() {
    let fmu = Fmu::started();
    fmu.set_fault(STEP_LOGS);
    assert_eq!(unsafe { fmi2DoStep(fmu.c, 0.0, 0.5, 1) }, OK);
    let line = |status, category: &str, text: &str| Line {
        instance: "fmu".into(),
        status,
        category: category.into(),
        format: "%s".into(),
        text: text.into(),
    };
    let event = line(OK, "logEvents", "an event at 0 s, 100%s sure");
    let warning = line(fmi2Status_fmi2Warning, "logStatusWarning", "a warning");
    assert_eq!(fmu.lines(), [event.clone(), warning.clone()]);

    let mut t = 0.5;
    let mut after = |on: i32, categories: &[*const c_char]| {
        let pointer = if categories.is_empty() { null() } else { categories.as_ptr() };
        assert_eq!(unsafe { fmi2SetDebugLogging(fmu.c, on, categories.len(), pointer) }, OK);
        fmu.lines();
        assert_eq!(unsafe { fmi2DoStep(fmu.c, t, 0.5, 1) }, OK);
        t += 0.5;
        fmu.lines().into_iter().map(|line| line.category).collect::<Vec<_>>()
    };
    assert_eq!(after(0, &[]), [""; 0]);
    assert_eq!(after(1, &[]), ["logEvents", "logStatusWarning"]);
    assert_eq!(after(1, &[c"logEvents".as_ptr()]), ["logEvents"]);
    assert_eq!(after(1, &[c"logStatusWarning".as_ptr(), c"nonsense".as_ptr()]), ["logStatusWarning"]);
    assert_eq!(after(1, &[null()]), [""; 0]);
    assert_eq!(after(1, &[c"logAll".as_ptr()]), ["logEvents", "logStatusWarning"]);
    assert_eq!(after(0, &[c"logAll".as_ptr()]), [""; 0]);
    assert_eq!(unsafe { fmi2DoStep(fmu.c, 77.0, 0.5, 1) }, ERROR);
    let refused = fmu.line();
    assert_eq!((refused.status, refused.category.as_str()), (ERROR, "logStatusError"));
    assert!(refused.text.contains("77.0 s") && refused.text.contains("4.0 s"), "{refused:?}");
}

#[test]
fn a_panic_is_fenced_and_poisons_only_its_own_instance() {
    for (fault, call) in [
        (STEP_PANICS, (|fmu: &Fmu| unsafe { fmi2DoStep(fmu.c, 0.0, 0.1, 1) }) as fn(&Fmu) -> fmi2Status),
        (REFRESH_PANICS, |fmu| unsafe {
            // y[1]
            fmi2GetReal(fmu.c, [5].as_ptr(), 1, [0.0].as_mut_ptr())
        }),
    ] {
        let (fmu, other) = (Fmu::started(), Fmu::started());
        let mut state = null_mut();
        assert_eq!(unsafe { fmi2GetFMUstate(fmu.c, &raw mut state) }, OK);
        fmu.set_fault(fault);
        assert_eq!(call(&fmu), FATAL);
        let line = fmu.line();
        assert_eq!((line.status, line.category.as_str()), (FATAL, "logStatusFatal"));
        assert!(line.text.contains("the mock was told to panic"), "{line:?}");
        for (name, call) in harmless_calls() {
            let expected = if name == "fmi2FreeFMUstate" { OK } else { FATAL };
            assert_eq!(call(fmu.c), expected, "{name}");
        }
        assert_eq!(unsafe { fmi2FreeFMUstate(fmu.c, &raw mut state) }, OK);
        assert!(state.is_null());
        assert_eq!(unsafe { fmi2DoStep(other.c, 0.0, 0.1, 1) }, OK);
    }
}

#[test]
fn a_model_error_is_an_error_and_terminate_comes_after_it() {
    let fmu = Fmu::started();
    fmu.set_fault(STEP_FAILS);
    unsafe {
        assert_eq!(fmi2DoStep(fmu.c, 0.0, 0.1, 1), ERROR);
        assert_eq!(fmu.line().text, "fmi2DoStep: the mock was told to fail in step");
        assert_eq!(fmi2Terminate(fmu.c), OK);
        assert_eq!(fmi2Terminate(fmu.c), OK);
        assert_eq!(fmi2Reset(fmu.c), OK);
        start(fmu.c);
        assert_eq!(fmi2DoStep(fmu.c, 0.0, 0.1, 1), OK);
    }
}

#[test]
fn a_logger_that_calls_back_is_turned_away() {
    let fmu = Fmu::started();
    *fmu.record.call_back.borrow_mut() = Some(fmu.c);
    assert_eq!(unsafe { fmi2DoStep(fmu.c, 5.0, 0.1, 1) }, ERROR);
    *fmu.record.call_back.borrow_mut() = None;
    assert_eq!(*fmu.record.call_back_status.borrow(), Some(ERROR));
    assert_eq!(unsafe { fmi2DoStep(fmu.c, 0.0, 0.1, 1) }, OK, "and was not freed under its own feet");
}

//! The 34 symbols from C's side: pointers, fence, logger, states. What the calls mean is tested in
//! `fmi_instance.rs`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![cfg_attr(miri, feature(c_variadic))]
#![allow(clippy::undocumented_unsafe_blocks, clippy::multiple_unsafe_ops_per_block)]

mod fmi_mock;
#[path = "fmi_mock/importer.rs"]
mod importer;

use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Function, Instance, Interface, Logger, State};
use fmi_mock::resources::Resources;
use fmi_mock::{Mock, REFRESH_PANICS, STEP_FAILS, STEP_LOGS, STEP_PANICS};
use importer::*;
use std::collections::BTreeSet;
use std::ffi::{CStr, c_char};
use std::ptr::{null, null_mut};
use std::rc::Rc;

bess_consensus::export_fmi2!(Mock);

const OK: fmi2Status = fmi2Status_fmi2OK;
const ERROR: fmi2Status = fmi2Status_fmi2Error;
const FATAL: fmi2Status = fmi2Status_fmi2Fatal;
const DISCARD: fmi2Status = fmi2Status_fmi2Discard;

fn guid(n: usize, interface: Interface) -> String {
    Instance::from_model("", Mock::with(n), interface, Logger::silent()).unwrap().guid().to_string()
}

fn reference(n: usize, name: &str) -> u32 {
    let instance = Instance::from_model("", Mock::with(n), Interface::Structured, Logger::silent()).unwrap();
    instance.registry().reference(name).unwrap()
}

/// A component with two lags and its record; freed at the end.
struct Fmu {
    c: fmi2Component,
    record: Rc<Record>,
    _resources: Resources,
}

impl Fmu {
    fn new() -> Self {
        let resources = Resources::new(2);
        let record = Rc::new(Record::default());
        let callbacks = callbacks(&record);
        let c =
            instantiate("fmu", &guid(2, Interface::Structured), &resources.uri(), &raw const callbacks, true);
        assert!(!c.is_null(), "{:?}", record.lines);
        Fmu { c, record, _resources: resources }
    }

    fn started() -> Self {
        let fmu = Self::new();
        start(fmu.c);
        fmu
    }

    fn set_fault(&self, fault: i32) {
        let vr = reference(2, "fault");
        assert_eq!(unsafe { fmi2SetInteger(self.c, &raw const vr, 1, &raw const fault) }, OK);
    }

    fn real(&self, name: &str) -> f64 {
        let (vr, mut value) = (reference(2, name), f64::NAN);
        assert_eq!(unsafe { fmi2GetReal(self.c, &raw const vr, 1, &raw mut value) }, OK);
        value
    }

    /// The lines since the last time.
    fn lines(&self) -> Vec<Line> {
        self.record.lines.take()
    }

    fn line(&self) -> Line {
        let mut lines = self.lines();
        assert_eq!(lines.len(), 1, "{lines:?}");
        lines.remove(0)
    }
}

impl Drop for Fmu {
    fn drop(&mut self) {
        unsafe { fmi2FreeInstance(self.c) };
    }
}

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
fn instantiation_says_what_is_wrong() {
    let resources = Resources::new(2);
    let good = guid(2, Interface::Structured);
    let empty = tempfile::tempdir().unwrap();
    let empty_uri = format!("file://{}", empty.path().display());
    let panics = Resources::new(666);
    let uri = resources.uri();
    for (guid, location, words) in [
        ("00000000-0000-0000-0000-000000000000", uri.as_str(), &["fmuGUID", good.as_str(), "00000000-"][..]),
        ("", &uri, &["fmuGUID", &good]),
        (&good, "", &["fmuResourceLocation", "empty", "file:///path/to/resources"]),
        (&good, "https://host/x", &["https://host/x", "scheme"]),
        (&good, "file:///nowhere/at/all", &["/nowhere/at/all", "no readable folder"]),
        (&good, &empty_uri, &["n.txt"]),
        (&good, &panics.uri(), &["internal error", "panic while loading"]),
    ] {
        let record = Record::default();
        let functions = callbacks(&record);
        assert!(instantiate("name", guid, location, &raw const functions, false).is_null());
        let lines = record.lines.take();
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert_eq!(
            (lines[0].instance.as_str(), lines[0].format.as_str(), lines[0].status),
            ("name", "%s", ERROR)
        );
        for word in words {
            assert!(
                lines[0].text.starts_with("fmi2Instantiate") && lines[0].text.contains(word),
                "{lines:?}"
            );
        }
        // The same with nobody to tell.
        assert!(instantiate("name", guid, location, null(), false).is_null());
    }
    let record = Record::default();
    let functions = callbacks(&record);
    unsafe {
        let null_strings = fmi2Instantiate(null(), 1, null(), null(), &raw const functions, 0, 0);
        assert!(null_strings.is_null());
        let model_exchange = fmi2Instantiate(null(), 0, null(), null(), &raw const functions, 0, 0);
        assert!(model_exchange.is_null());
    }
    let lines = record.lines.take();
    assert!(lines[0].instance == "Mock" && lines[0].text.contains("fmuGUID is NULL"), "{lines:?}");
    assert!(lines[1].text.contains("fmuType = 0") && lines[1].text.contains("fmi2CoSimulation"), "{lines:?}");
}

#[test]
fn callbacks_and_logger_may_be_null() {
    let resources = Resources::new(2);
    let no_logger = fmi2CallbackFunctions {
        logger: None,
        allocateMemory: None,
        freeMemory: None,
        stepFinished: None,
        componentEnvironment: null_mut(),
    };
    for functions in [null(), &raw const no_logger] {
        for interface in [Interface::Structured, Interface::Portable] {
            let c = instantiate("x", &guid(2, interface), &resources.uri(), functions, true);
            assert!(!c.is_null());
            start(c);
            unsafe {
                assert_eq!(fmi2SetReal(c, [u32::MAX].as_ptr(), 1, [1.0].as_ptr()), ERROR);
                assert_eq!(fmi2DoStep(c, 0.0, 0.1, 1), OK);
                fmi2FreeInstance(c);
            }
        }
    }
    let braces = format!("{{{}}}", guid(2, Interface::Structured));
    let c = instantiate("x", &braces, &resources.uri(), null(), true);
    assert!(!c.is_null(), "importers that put braces around the GUID are let in");
    unsafe { fmi2FreeInstance(c) };
}

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

#[test]
fn states_are_deep_copies_that_travel_between_instances() {
    let (fmu, other) = (Fmu::started(), Fmu::new());
    let (mut state, mut size) = (null_mut(), 0);
    unsafe {
        assert_eq!(fmi2DoStep(fmu.c, 0.0, 0.1, 0), OK);
        assert_eq!(fmi2GetFMUstate(fmu.c, &raw mut state), OK);
        let x = fmu.real("x[1]");
        assert_eq!(fmi2DoStep(fmu.c, 0.1, 0.1, 0), OK);
        let later = fmu.real("x[1]");
        assert_ne!(x, later);
        assert_eq!(fmi2SerializedFMUstateSize(fmu.c, state, &raw mut size), OK);
        let mut bytes = vec![0_i8; size];
        assert_eq!(fmi2SerializeFMUstate(fmu.c, state, bytes.as_mut_ptr().cast(), size - 1), ERROR);
        assert!(fmu.line().text.contains(&format!("at least {size}")));
        assert_eq!(fmi2SerializeFMUstate(fmu.c, state, bytes.as_mut_ptr().cast(), size), OK);

        let kept = state;
        assert_eq!(fmi2GetFMUstate(fmu.c, &raw mut state), OK, "over the state it holds");
        assert_eq!(state, kept);
        assert_eq!(fmi2DeSerializeFMUstate(fmu.c, bytes.as_ptr().cast(), size, &raw mut state), OK);
        assert_eq!(fmi2SetFMUstate(fmu.c, state), OK);
        assert_eq!(fmu.real("x[1]"), x);
        assert_eq!(fmi2DoStep(fmu.c, 0.1, 0.1, 0), OK);
        assert_eq!(fmu.real("x[1]").to_bits(), later.to_bits());

        let mut copy = null_mut();
        assert_eq!(fmi2DeSerializeFMUstate(other.c, bytes.as_ptr().cast(), size, &raw mut copy), OK);
        assert_eq!(fmi2SetFMUstate(other.c, copy), OK);
        assert_eq!(fmi2DoStep(other.c, 0.1, 0.1, 0), OK);
        assert_eq!(other.real("x[1]").to_bits(), later.to_bits());

        bytes[size / 2] ^= 4;
        let mut none = null_mut();
        assert_eq!(fmi2DeSerializeFMUstate(other.c, bytes.as_ptr().cast(), size, &raw mut none), ERROR);
        assert!(other.line().text.contains("damaged"));
        assert!(none.is_null());
        assert_eq!(fmi2DeSerializeFMUstate(other.c, null(), size, &raw mut none), ERROR);
        assert_eq!(fmi2DeSerializeFMUstate(other.c, null(), 0, &raw mut none), ERROR);
        assert_eq!(fmi2SetFMUstate(other.c, null_mut()), ERROR);
        assert_eq!(fmi2GetFMUstate(other.c, null_mut()), ERROR);
        assert_eq!(fmi2SerializedFMUstateSize(other.c, state, null_mut()), ERROR);
        assert_eq!(fmi2SerializeFMUstate(other.c, state, null_mut(), size), ERROR);
        for place in [&raw mut state, &raw mut copy] {
            assert_eq!(fmi2FreeFMUstate(fmu.c, place), OK);
            assert!((*place).is_null());
            assert_eq!(fmi2FreeFMUstate(fmu.c, place), OK, "once more, now with a pointer to NULL");
        }
        assert_eq!(fmi2FreeFMUstate(fmu.c, null_mut()), OK);
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

/// A component on its way to another thread.
struct Handle(fmi2Component);
unsafe impl Send for Handle {}

#[test]
fn many_instances_with_one_name_live_on_any_thread() {
    let count = if cfg!(miri) { 3 } else { 200 };
    let resources = Resources::new(2);
    let guid = guid(2, Interface::Structured);
    let mut living: Vec<fmi2Component> =
        (0..count).map(|_| instantiate("same", &guid, &resources.uri(), null(), false)).collect();
    for (k, c) in living.iter().enumerate() {
        start(*c);
        let u = k as f64;
        assert_eq!(unsafe { fmi2SetReal(*c, [1].as_ptr(), 1, &raw const u) }, OK);
    }
    let last = Handle(living.pop().unwrap());
    let value = std::thread::spawn(move || {
        let last = last;
        let mut value = 0.0;
        unsafe {
            assert_eq!(fmi2DoStep(last.0, 0.0, 0.5, 1), OK);
            assert_eq!(fmi2GetReal(last.0, [3].as_ptr(), 1, &raw mut value), OK);
            fmi2FreeInstance(last.0);
        }
        value
    })
    .join()
    .unwrap();
    let exact = |u: f64| 2.0 * u + (0.25 - 2.0 * u) * f64::exp(-1.0);
    assert!((value - exact(f64::from(count - 1))).abs() < 1e-12);
    for (k, c) in living.into_iter().enumerate().rev() {
        let mut value = 0.0;
        unsafe {
            assert_eq!(fmi2DoStep(c, 0.0, 0.5, 1), OK);
            assert_eq!(fmi2GetReal(c, [3].as_ptr(), 1, &raw mut value), OK);
            fmi2FreeInstance(c);
        }
        assert!((value - exact(k as f64)).abs() < 1e-12, "instance {k}");
    }
}

//! Instances from C's side: how they begin, that they do not know each other, their states as bytes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![cfg_attr(miri, feature(c_variadic))]
#![allow(clippy::undocumented_unsafe_blocks, clippy::multiple_unsafe_ops_per_block)]

#[path = "fmi_mock/component.rs"]
mod component;
mod fmi_mock;
#[path = "fmi_mock/importer.rs"]
mod importer;

use bess_consensus::fmi::Interface;
use bess_consensus::fmi::bindings::*;
use component::*;
use fmi_mock::resources::Resources;
use importer::*;
use std::ptr::{null, null_mut};

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

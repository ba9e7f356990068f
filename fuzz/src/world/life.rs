//! From fmi2Instantiate to fmi2FreeInstance.

use super::{INSTANCES, Live, World};
use crate::log::Log;
use crate::verdict::Verdict;
use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Function, State};
use std::ffi::{CStr, CString};
use std::ptr::null;
use std::rc::Rc;

/// Start times, s; the last ones are refused.
const STARTS: [f64; 10] = [0.0, 0.0, 0.0, -5.0, 1e6, 9e9, -9e9, f64::NAN, f64::INFINITY, 1e300];

impl World<'_> {
    pub(super) fn inquire(&mut self) {
        self.tally.count(Function::GetVersion, fmi2Status_fmi2OK);
        self.tally.count(Function::GetTypesPlatform, fmi2Status_fmi2OK);
        // SAFETY: both take nothing and return a static string.
        let [version, types] = unsafe {
            let functions = &self.subject.functions;
            [(functions.get_version)(), (functions.get_types_platform)()].map(|text| CStr::from_ptr(text))
        };
        assert_eq!((version, types), (c"2.0", c"default"));
    }

    /// Instance `k` from everything that it takes.
    pub(super) fn instantiate_well(&mut self, k: usize, export: usize) {
        self.free_instance(k);
        self.tally.count(Function::Instantiate, fmi2Status_fmi2OK);
        let given = &self.subject.exports[export];
        let guid = CString::new(given.guid.as_str()).expect("hexadecimal digits");
        let log = Rc::new(Log::default());
        let heard = !self.choices.once_in(16);
        let callbacks = fmi2CallbackFunctions {
            logger: if heard { log.callbacks().logger } else { None },
            ..log.callbacks()
        };
        let pointer = if heard || self.choices.once_in(2) { &raw const callbacks } else { null() };
        // SAFETY: C strings, and callbacks whose logger and environment outlive the instance.
        let c = unsafe {
            let location = given.location.as_ptr();
            let on = self.choices.any::<bool>().into();
            (self.subject.functions.instantiate)(c"fuzz".as_ptr(), 1, guid.as_ptr(), location, pointer, 0, on)
        };
        assert!(!c.is_null(), "{}: {:?}", self.subject.name, log.take());
        let state = Some(State::Instantiated);
        self.live[k] = Some(Live { c, log, heard, export, state, ramped: false, known: None, size: 0 });
    }

    /// Well or with one argument wrong, which must give NULL and one line.
    pub(super) fn instantiate(&mut self, k: usize) {
        let export = self.exports[self.choices.below(2)];
        if self.choices.once_in(2) {
            return self.instantiate_well(k % INSTANCES, export);
        }
        self.tally.count(Function::Instantiate, fmi2Status_fmi2Error);
        let given = &self.subject.exports[export];
        let guid = CString::new(given.guid.as_str()).expect("hexadecimal digits");
        let noise: Vec<u8> = (0..self.choices.below(24)).map(|_| self.choices.any::<u8>().max(1)).collect();
        let noise = CString::new(noise).expect("no NUL");
        let log = Log::default();
        let callbacks = log.callbacks();
        let (mut kind, mut id, mut location) = (1, guid.as_ptr(), given.location.as_ptr());
        let word = match self.choices.below(9) {
            0 => {
                kind = self.choices.of(&[0, 2, u32::MAX]);
                "fmuType"
            }
            1 => {
                id = null();
                "fmuGUID"
            }
            2 => {
                id = c"{8c4e810f-3df3-4a00-8276-176fa3c9f000}".as_ptr();
                "fmuGUID"
            }
            3 => {
                id = noise.as_ptr();
                "fmuGUID"
            }
            4 => {
                location = null();
                "fmuResourceLocation"
            }
            5 => {
                location =
                    self.choices.of(&[c"", c"file:", c"https://host/x", c"file:///no/such/folder"]).as_ptr();
                "fmuResourceLocation"
            }
            6 => {
                location = noise.as_ptr();
                "fmi2Instantiate"
            }
            // A folder that is there and has no resources.
            7 => {
                location = c"file:///".as_ptr();
                "fmi2Instantiate"
            }
            _ => {
                (kind, id, location) = (1, null(), null());
                "fmuGUID"
            }
        };
        let name = self.choices.of(&[c"fuzz".as_ptr(), c"".as_ptr(), c"\xff\xfe".as_ptr(), null()]);
        let functions = if self.choices.once_in(8) { null() } else { &raw const callbacks };
        // SAFETY: NULL or C strings, and callbacks that live through the call.
        let c = unsafe { (self.subject.functions.instantiate)(name, kind, id, location, functions, 0, 1) };
        let lines = log.take();
        assert!(c.is_null(), "{}: instantiated in spite of a wrong {word}", self.subject.name);
        if !functions.is_null() {
            let [line] = &lines[..] else { panic!("fmi2Instantiate wrote {lines:?}; expected one line") };
            let sound = line.text.starts_with("fmi2Instantiate: ") && line.text.contains(word);
            assert!(sound && line.status == fmi2Status_fmi2Error, "{line:?}; expected {word}");
        }
    }

    pub(super) fn free_instance(&mut self, k: usize) {
        self.tally.count(Function::FreeInstance, fmi2Status_fmi2OK);
        let c = self.live[k].as_ref().map_or(std::ptr::null_mut(), |live| live.c);
        // SAFETY: NULL or a component that is not used again.
        unsafe { (self.subject.functions.free_instance)(c) };
        self.live[k] = None;
    }

    pub(super) fn set_debug_logging(&mut self, k: usize) {
        let known = [c"logAll", c"logEvents", c"logStatusError", c"logStatusWarning"];
        let mut categories: Vec<fmi2String> = Vec::new();
        for _ in 0..self.choices.below(4) {
            categories.push(match self.choices.below(6) {
                0 => null(),
                1 => c"logNothing\n".as_ptr(),
                _ => self.choices.of(&known).as_ptr(),
            });
        }
        let fault = self.fault(1);
        let verdict = fault.verdict(categories.len(), &["categories"]).unwrap_or(Verdict::Accept);
        let on = self.choices.of(&[0, 1, -1]);
        self.check(k, Function::SetDebugLogging, verdict, |functions, c| {
            let n = fault.count(categories.len());
            // SAFETY: an array of that length, of NULL and C strings, or one that the callee must see through.
            unsafe { (functions.set_debug_logging)(c, on, n, fault.read(0, &categories)) }
        });
    }

    pub(super) fn setup_experiment(&mut self, k: usize) {
        let start = self.choices.of(&STARTS);
        let stop = self.choices.of(&[10.0, -1.0, f64::NAN, f64::INFINITY]);
        let (defined, tolerance) = (self.choices.any::<bool>().into(), self.choices.not_finite());
        let verdict = match start.abs() < 9.2e9 {
            true => Verdict::Accept,
            false => Verdict::refuse([&format!("startTime = {start:?}"), "expected"]),
        };
        self.check(k, Function::SetupExperiment, verdict, |functions, c| {
            // SAFETY: numbers only.
            unsafe { (functions.setup_experiment)(c, 1, tolerance, start, defined, stop) }
        });
    }

    pub(super) fn enter(&mut self, k: usize) {
        let accepted = self.check(k, Function::EnterInitializationMode, Verdict::Accept, |functions, c| {
            // SAFETY: a component or NULL.
            unsafe { (functions.enter_initialization_mode)(c) }
        });
        self.move_on(k, accepted, State::Initialization);
    }

    pub(super) fn exit(&mut self, k: usize) {
        let verdict = self.up_to_the_model(k);
        let accepted = self.check(k, Function::ExitInitializationMode, verdict, |functions, c| {
            // SAFETY: a component or NULL.
            unsafe { (functions.exit_initialization_mode)(c) }
        });
        self.move_on(k, accepted, State::Step);
    }

    pub(super) fn terminate(&mut self, k: usize) {
        let accepted = self.check(k, Function::Terminate, Verdict::Accept, |functions, c| {
            // SAFETY: a component or NULL.
            unsafe { (functions.terminate)(c) }
        });
        self.move_on(k, accepted, State::Terminated);
    }

    pub(super) fn reset(&mut self, k: usize) {
        // Whatever has happened, even with forged contents, reset leads back.
        let accepted = self.check(k, Function::Reset, Verdict::Accept, |functions, c| {
            // SAFETY: a component or NULL.
            unsafe { (functions.reset)(c) }
        });
        if let (true, Some(live)) = (accepted, &mut self.live[k]) {
            (live.state, live.ramped) = (Some(State::Instantiated), false);
        }
    }

    /// A change of state, where it is known at all.
    fn move_on(&mut self, k: usize, accepted: bool, state: State) {
        if let (true, Some(live)) = (accepted, &mut self.live[k])
            && live.state.is_some()
        {
            live.state = Some(state);
        }
    }
}

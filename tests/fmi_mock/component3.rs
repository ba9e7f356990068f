//! The mock behind the 75 symbols of FMI 3.0, and one instance of it with the record of what its logger was told. To be
//! included beside `importer3.rs`.
#![allow(dead_code, reason = "each test uses its part")]

use super::fmi_mock::Mock;
use super::fmi_mock::resources::Resources;
use super::importer3::*;
use bess_consensus::fmi::Logger;
use bess_consensus::fmi::three::Instance;
use bess_consensus::fmi::three::bindings::*;
use std::ptr::null_mut;
use std::rc::Rc;

bess_consensus::export_fmi3!(Mock);

pub const OK: fmi3Status = fmi3Status_fmi3OK;
pub const ERROR: fmi3Status = fmi3Status_fmi3Error;
pub const FATAL: fmi3Status = fmi3Status_fmi3Fatal;

pub fn in_process(n: usize) -> Instance<Mock> {
    Instance::from_model("", Mock::with(n), Logger::silent()).unwrap()
}

pub fn token(n: usize) -> String {
    in_process(n).token().to_string()
}

pub fn reference(name: &str) -> u32 {
    in_process(2).reference(name).unwrap_or_else(|| panic!("{name}"))
}

/// An instance with two lags and its record; freed at the end.
pub struct Fmu {
    pub c: fmi3Instance,
    pub record: Rc<Record>,
    pub resources: Resources,
}

impl Fmu {
    pub fn new() -> Self {
        let resources = Resources::new(2);
        let record = Rc::new(Record::default());
        let path = format!("{}/", resources.path().display());
        let c = instantiate("fmu", &token(2), &path, &record);
        assert!(!c.is_null(), "{:?}", record.lines);
        Fmu { c, record, resources }
    }

    pub fn started() -> Self {
        let fmu = Self::new();
        fmu.start();
        fmu
    }

    pub fn start(&self) {
        unsafe {
            assert_eq!(fmi3EnterInitializationMode(self.c, false, 0.0, 0.0, false, 0.0), OK);
            assert_eq!(fmi3ExitInitializationMode(self.c), OK);
        }
    }

    pub fn step(&self, t: f64, h: f64) -> (fmi3Status, [bool; 3], f64) {
        let (mut flags, mut end) = ([true; 3], f64::NAN);
        let [a, b, c] = &mut flags;
        let status = unsafe { fmi3DoStep(self.c, t, h, true, a, b, c, &raw mut end) };
        (status, flags, end)
    }

    pub fn get(&self, names: &[&str], length: usize) -> Result<Vec<f64>, fmi3Status> {
        let references: Vec<u32> = names.iter().map(|name| reference(name)).collect();
        let mut values = vec![f64::NAN; length];
        let (vr, n) = (references.as_ptr(), references.len());
        match unsafe { fmi3GetFloat64(self.c, vr, n, values.as_mut_ptr(), length) } {
            OK => Ok(values),
            status => {
                assert!(values.iter().all(|value| value.is_nan()), "a refused call writes nothing");
                Err(status)
            }
        }
    }

    pub fn set(&self, names: &[&str], values: &[f64]) -> fmi3Status {
        let references: Vec<u32> = names.iter().map(|name| reference(name)).collect();
        let (vr, n) = (references.as_ptr(), references.len());
        unsafe { fmi3SetFloat64(self.c, vr, n, values.as_ptr(), values.len()) }
    }

    pub fn set_number(&self, name: &str, values: &[u64]) -> fmi3Status {
        let vr = reference(name);
        unsafe { fmi3SetUInt64(self.c, &raw const vr, 1, values.as_ptr(), values.len()) }
    }

    pub fn set_fault(&self, fault: i32) {
        let vr = reference("fault");
        assert_eq!(unsafe { fmi3SetInt32(self.c, &raw const vr, 1, &raw const fault, 1) }, OK);
    }

    pub fn configure(&self, name: &str, size: u64) {
        unsafe {
            assert_eq!(fmi3EnterConfigurationMode(self.c), OK);
            assert_eq!(self.set_number(name, &[size]), OK, "{:?}", self.lines());
            assert_eq!(fmi3ExitConfigurationMode(self.c), OK);
        }
    }

    /// The serialised state.
    pub fn state(&self) -> Vec<u8> {
        let (mut state, mut size) = (null_mut(), 0);
        unsafe {
            assert_eq!(fmi3GetFMUState(self.c, &raw mut state), OK, "{:?}", self.lines());
            assert_eq!(fmi3SerializedFMUStateSize(self.c, state, &raw mut size), OK);
            let mut bytes = vec![0; size];
            assert_eq!(fmi3SerializeFMUState(self.c, state, bytes.as_mut_ptr(), size), OK);
            assert_eq!(fmi3FreeFMUState(self.c, &raw mut state), OK);
            assert!(state.is_null());
            bytes
        }
    }

    /// The lines since the last time.
    pub fn lines(&self) -> Vec<Line> {
        self.record.lines.take()
    }

    pub fn line(&self) -> String {
        let mut lines = self.lines();
        assert_eq!(lines.len(), 1, "{lines:?}");
        lines.remove(0).text
    }

    /// What must come of a refused call: an error, one line that begins with the function's name and has these words in
    /// it, and the same state to the bit.
    pub fn refuses(&self, says: &[&str], call: impl FnOnce() -> fmi3Status) {
        let before = self.state();
        assert_eq!(call(), ERROR, "{says:?}");
        let lines = self.lines();
        assert_eq!(lines.len(), 1, "{lines:?}");
        let line = &lines[0];
        assert_eq!((line.status, line.category.as_str()), (ERROR, "logStatusError"));
        assert!(line.text.starts_with(says[0]), "{line:?} does not begin with {}", says[0]);
        for words in says {
            assert!(line.text.contains(words), "{line:?} does not say {words}");
        }
        assert!(!line.text.contains("fmi2"), "{line:?}");
        assert!(self.state() == before, "{says:?} has changed the state");
    }
}

impl Drop for Fmu {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.c) };
    }
}

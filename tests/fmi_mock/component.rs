//! The mock behind its 34 symbols, and one component of it with the record of what its logger was told. To be
//! included beside `importer.rs`.
#![allow(dead_code, reason = "each test uses its part")]

use super::fmi_mock::Mock;
use super::fmi_mock::resources::Resources;
use super::importer::*;
use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Instance, Interface, Logger};
use std::rc::Rc;

bess_consensus::export_fmi2!(Mock);

pub const OK: fmi2Status = fmi2Status_fmi2OK;
pub const ERROR: fmi2Status = fmi2Status_fmi2Error;
pub const FATAL: fmi2Status = fmi2Status_fmi2Fatal;
pub const DISCARD: fmi2Status = fmi2Status_fmi2Discard;

pub fn guid(n: usize, interface: Interface) -> String {
    Instance::from_model("", Mock::with(n), interface, Logger::silent()).unwrap().guid().to_string()
}

pub fn reference(n: usize, name: &str) -> u32 {
    let instance = Instance::from_model("", Mock::with(n), Interface::Structured, Logger::silent()).unwrap();
    instance.registry().reference(name).unwrap()
}

/// A component with two lags and its record; freed at the end.
pub struct Fmu {
    pub c: fmi2Component,
    pub record: Rc<Record>,
    _resources: Resources,
}

impl Fmu {
    pub fn new() -> Self {
        let resources = Resources::new(2);
        let record = Rc::new(Record::default());
        let callbacks = callbacks(&record);
        let c =
            instantiate("fmu", &guid(2, Interface::Structured), &resources.uri(), &raw const callbacks, true);
        assert!(!c.is_null(), "{:?}", record.lines);
        Fmu { c, record, _resources: resources }
    }

    pub fn started() -> Self {
        let fmu = Self::new();
        start(fmu.c);
        fmu
    }

    pub fn set_fault(&self, fault: i32) {
        let vr = reference(2, "fault");
        assert_eq!(unsafe { fmi2SetInteger(self.c, &raw const vr, 1, &raw const fault) }, OK);
    }

    pub fn real(&self, name: &str) -> f64 {
        let (vr, mut value) = (reference(2, name), f64::NAN);
        assert_eq!(unsafe { fmi2GetReal(self.c, &raw const vr, 1, &raw mut value) }, OK);
        value
    }

    /// The lines since the last time.
    pub fn lines(&self) -> Vec<Line> {
        self.record.lines.take()
    }

    pub fn line(&self) -> Line {
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

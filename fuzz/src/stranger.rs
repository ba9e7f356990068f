//! A living state of another FMU, to be offered where one's own is expected.

use crate::subject::Subject;
use bess_consensus::fmi::bindings::*;
use std::ffi::CString;
use std::ptr::{null, null_mut};

/// An instance of another FMU with one state taken of it.
pub struct Stranger<'a> {
    subject: &'a Subject,
    c: fmi2Component,
    state: fmi2FMUstate,
}

impl<'a> Stranger<'a> {
    /// Out of the first export of this FMU.
    pub fn of(subject: &'a Subject) -> Self {
        let export = &subject.exports[0];
        let guid = CString::new(export.guid.as_str()).expect("hexadecimal digits");
        let mut state = null_mut();
        // SAFETY: C strings, no callbacks, and a place for the state.
        let c = unsafe {
            let location = export.location.as_ptr();
            let c = (subject.functions.instantiate)(
                c"stranger".as_ptr(),
                1,
                guid.as_ptr(),
                location,
                null(),
                0,
                0,
            );
            assert!(!c.is_null());
            assert_eq!((subject.functions.get_fmu_state)(c, &raw mut state), fmi2Status_fmi2OK);
            c
        };
        Self { subject, c, state }
    }

    /// The state.
    pub fn state(&self) -> fmi2FMUstate {
        self.state
    }
}

impl Drop for Stranger<'_> {
    fn drop(&mut self) {
        // SAFETY: both are alive and not used again.
        unsafe {
            (self.subject.functions.free_fmu_state)(self.c, &raw mut self.state);
            (self.subject.functions.free_instance)(self.c);
        }
    }
}

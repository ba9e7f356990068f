//! The importer's logger: keeps the lines of one instance until somebody asks.

use bess_consensus::fmi::bindings::*;
use std::cell::RefCell;
use std::ffi::{CStr, c_char, c_void};

/// One call of the logger.
#[derive(Clone, Debug)]
pub struct Line {
    /// fmi2Status of the line.
    pub status: fmi2Status,
    /// Its category.
    pub category: String,
    /// Its text.
    pub text: String,
}

/// What the logger was told; its address is the componentEnvironment.
#[derive(Default)]
pub struct Log(RefCell<Vec<Line>>);

impl Log {
    /// The lines since the last time.
    pub fn take(&self) -> Vec<Line> {
        self.0.take()
    }

    /// The callbacks of an importer that writes here. `self` must outlive the instance.
    pub fn callbacks(&self) -> fmi2CallbackFunctions {
        fmi2CallbackFunctions {
            logger: function(),
            allocateMemory: None,
            freeMemory: None,
            stepFinished: None,
            componentEnvironment: std::ptr::from_ref(self).cast_mut().cast(),
        }
    }
}

/// # Safety
/// `environment` points to a living [`Log`], the other pointers to C strings.
unsafe fn receive(
    environment: *mut c_void,
    status: fmi2Status,
    category: *const c_char,
    format: *const c_char,
    text: *const c_char,
) {
    // SAFETY: as promised by the caller.
    let (log, [category, format, text]) =
        unsafe { (&*environment.cast::<Log>(), [category, format, text].map(|s| CStr::from_ptr(s))) };
    assert_eq!(format, c"%s", "a message must not be its own format");
    let [category, text] = [category, text].map(|s| s.to_string_lossy().into_owned());
    log.0.borrow_mut().push(Line { status, category, text });
}

/// A logger with the one variadic argument that the FMU passes. Stable Rust cannot define a variadic function; on
/// x86-64 and aarch64 Linux this argument arrives where a fixed one would.
#[cfg(not(miri))]
unsafe extern "C" fn logger(
    environment: *mut c_void,
    _name: *const c_char,
    status: fmi2Status,
    category: *const c_char,
    format: *const c_char,
    text: *const c_char,
) {
    // SAFETY: the FMU hands back the environment and gives C strings (FMI 2.0.1, section 2.1.5).
    unsafe { receive(environment, status, category, format, text) }
}

#[cfg(not(miri))]
fn function() -> fmi2CallbackLogger {
    // SAFETY: a function pointer of the same size; see `logger` for the call.
    unsafe { std::mem::transmute::<*const c_void, fmi2CallbackLogger>(logger as *const c_void) }
}

#[cfg(miri)]
unsafe extern "C" fn logger(
    environment: *mut c_void,
    _name: *const c_char,
    status: fmi2Status,
    category: *const c_char,
    format: *const c_char,
    mut arguments: ...
) {
    // SAFETY: as above, and the format asks for one string.
    unsafe {
        let text = arguments.next_arg::<*const c_char>();
        receive(environment, status, category, format, text)
    }
}

#[cfg(miri)]
fn function() -> fmi2CallbackLogger {
    Some(logger)
}

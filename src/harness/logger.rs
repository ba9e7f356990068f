//! Where an FMU's log lines arrive, through the C shim `logger.c`. Lines are kept for the error that
//! may follow; nothing is printed here.

use crate::fmi::bindings::{fmi2CallbackLogger, fmi2ComponentEnvironment};
use std::collections::VecDeque;
use std::ffi::CStr;
use std::os::raw::{c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

/// How many lines are kept.
const KEPT: usize = 8;

/// One line of an FMU's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// The participant's name.
    pub instance: String,
    /// fmi2Status of the line.
    pub status: u32,
    /// One of the FMU's categories.
    pub category: String,
    /// The text.
    pub message: String,
}

/// Takes every log line of an FMU as it comes, on the thread that calls the FMU (or another one, if
/// the FMU breaks the standard).
pub type LogTarget = dyn Fn(&LogLine) + Send + Sync;

/// The log of one instance; the FMU's `componentEnvironment` points at it.
pub(super) struct LogStore {
    target: Option<std::sync::Arc<LogTarget>>,
    kept: Mutex<VecDeque<LogLine>>,
}

impl LogStore {
    pub fn new(target: Option<std::sync::Arc<LogTarget>>) -> Self {
        Self { target, kept: Mutex::new(VecDeque::with_capacity(KEPT)) }
    }

    fn receive(&self, line: LogLine) {
        if let Some(target) = &self.target {
            target(&line);
        }
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() == KEPT {
            kept.pop_front();
        }
        kept.push_back(line);
    }

    /// The kept lines for an error, oldest first; they are told once.
    pub fn take(&self) -> Vec<String> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.drain(..).map(|line| format!("[{}] {}", line.category, line.message)).collect()
    }
}

unsafe extern "C" {
    fn bess_logger(
        environment: fmi2ComponentEnvironment,
        instance_name: *const c_char,
        status: u32,
        category: *const c_char,
        message: *const c_char,
        ...
    );
}

/// The callback to hand to an FMU; `componentEnvironment` must point at a [`LogStore`].
pub(super) fn callback() -> fmi2CallbackLogger {
    Some(bess_logger)
}

/// Called by the C shim with the formatted message.
///
/// # Safety
/// `environment` is NULL or points at the [`LogStore`] of a living instance; the strings are NULL or
/// C strings that live through the call.
#[unsafe(no_mangle)]
unsafe extern "C" fn bess_logger_receive(
    environment: fmi2ComponentEnvironment,
    instance_name: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    if environment.is_null() {
        return;
    }
    // SAFETY: not NULL, and slave.rs hands out pointers at the boxed LogStore only, which it frees
    // after the instance. LogStore is Sync, so a shared reference is fine even from another thread.
    let store = unsafe { &*environment.cast::<LogStore>() };
    // SAFETY: by the caller's promise.
    let (instance, category, message) = unsafe { (text(instance_name), text(category), text(message)) };
    // A panic of the target must not unwind into C.
    let _ = catch_unwind(AssertUnwindSafe(|| {
        store.receive(LogLine {
            instance,
            status: status as u32,
            category,
            message: message.trim_end().to_owned(),
        });
    }));
}

/// # Safety
/// `pointer` is NULL or a C string that lives through this call.
unsafe fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // SAFETY: not NULL, so by the caller's promise a C string.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(store: &LogStore, message: &CStr) {
        let environment = std::ptr::from_ref(store).cast_mut().cast();
        // SAFETY: a living store and C strings; the format has the two arguments it names.
        unsafe {
            bess_logger(
                environment,
                c"one".as_ptr(),
                3,
                c"logStatusError".as_ptr(),
                message.as_ptr(),
                7,
                0.5,
            );
        }
    }

    #[test]
    fn the_shim_formats_and_the_store_keeps_the_last_lines() {
        let store = LogStore::new(None);
        for _ in 0..KEPT {
            log(&store, c"old");
        }
        log(&store, c"agent %d at %.2f\n");
        let lines = store.take();
        assert_eq!(lines.len(), KEPT);
        assert_eq!(lines.last().unwrap(), "[logStatusError] agent 7 at 0.50");
        assert!(store.take().is_empty());
    }

    #[test]
    fn a_panicking_target_stays_on_this_side() {
        let store = LogStore::new(Some(std::sync::Arc::new(|_: &LogLine| panic!("from the target"))));
        log(&store, c"x");
    }

    #[test]
    fn a_line_without_environment_is_dropped() {
        // SAFETY: NULL is an allowed environment.
        unsafe {
            bess_logger_receive(std::ptr::null_mut(), std::ptr::null(), 0, std::ptr::null(), std::ptr::null())
        };
    }
}

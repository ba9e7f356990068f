//! The C side of FMI 3.0: its 75 functions, generic over the model. They turn pointers into slices and results into a
//! status, and do nothing else; what they mean is in [`super::instance`].
//!
//! As in FMI 2.0 every call on an instance goes through one door, `enter`: NULL check, guard against calls from within
//! the importer's logger, call order, panic fence, error to logger, status. No globals, no thread-locals.

mod absent;
mod derivatives;
mod lifecycle;
mod logger;
mod states;
mod stepping;
mod values;

pub use absent::*;
pub use derivatives::*;
pub use lifecycle::*;
pub use states::*;
pub use stepping::*;
pub use values::*;

use super::bindings::{
    fmi3Instance, fmi3Status, fmi3Status_fmi3Error, fmi3Status_fmi3Fatal, fmi3Status_fmi3OK,
};
use super::call_order::Function;
use super::error::{Error, Outcome, Reason};
use super::instance::Instance;
use crate::fmi::logging::Category;
use crate::fmi::model::Model;
use crate::fmi::shell::{discard, panic_message, pointer_fault};
use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// What an `fmi3Instance` points to.
struct Component<M: Model> {
    /// Whether a call is under way. A second one (out of a logger callback, or from another thread
    /// against the standard) is turned away instead of meeting a half-changed instance.
    busy: AtomicBool,
    instance: UnsafeCell<Instance<M>>,
}

/// The door. `body` runs with the instance, if `function` is allowed now.
///
/// # Safety
/// `c` is NULL or comes from [`instantiate_co_simulation`] for the same `M` and has not been freed.
unsafe fn enter<M: Model>(
    c: fmi3Instance,
    function: Function,
    body: impl FnOnce(&mut Instance<M>) -> Outcome<()>,
) -> fmi3Status {
    // SAFETY: as promised by the caller.
    let Some(component) = (unsafe { c.cast::<Component<M>>().as_ref() }) else {
        return fmi3Status_fmi3Error;
    };
    if component.busy.swap(true, Ordering::Acquire) {
        return fmi3Status_fmi3Error;
    }
    // SAFETY: `busy` was false and is true now, so that nobody else holds this reference.
    let instance = unsafe { &mut *component.instance.get() };
    let outcome = catch_unwind(AssertUnwindSafe(|| instance.allow(function).and_then(|()| body(instance))));
    let status = match outcome {
        Ok(Ok(())) => fmi3Status_fmi3OK,
        Ok(Err(reason)) => report(instance, &reason.of(function)),
        Err(payload) => {
            instance.poison();
            report(instance, &Reason::Panic { message: panic_message(payload) }.of(function))
        }
    };
    component.busy.store(false, Ordering::Release);
    status
}

/// One line for the importer's logger, and the status.
fn report<M: Model>(instance: &mut Instance<M>, error: &Error) -> fmi3Status {
    let (category, status) = match error.reason {
        Reason::Poisoned | Reason::Panic { .. } => (Category::Fatal, fmi3Status_fmi3Fatal),
        _ => (Category::Error, fmi3Status_fmi3Error),
    };
    let written =
        catch_unwind(AssertUnwindSafe(|| instance.logger().write(category, format_args!("{error}"))));
    match written {
        Ok(()) => status,
        Err(payload) => {
            instance.poison();
            discard(payload);
            fmi3Status_fmi3Fatal
        }
    }
}

fn null_or_worse(argument: &'static str, found: &'static str) -> Reason {
    Reason::Pointer { argument, found, expected: "an array with as many elements as given" }
}

/// An array of the importer; NULL is fine where there is nothing to read.
///
/// # Safety
/// `pointer` is NULL or points to `length` readable elements, unchanged during `'a`.
unsafe fn array<'a, T>(argument: &'static str, pointer: *const T, length: usize) -> Outcome<&'a [T]> {
    if length == 0 {
        return Ok(&[]);
    }
    match pointer_fault(pointer, length) {
        Some(found) => Err(null_or_worse(argument, found)),
        // SAFETY: not NULL, aligned, no longer than the address space; readable as the caller promises.
        None => Ok(unsafe { std::slice::from_raw_parts(pointer, length) }),
    }
}

/// An array of the importer to write to.
///
/// # Safety
/// `pointer` is NULL or points to `length` writable elements that nobody else uses during `'a`.
unsafe fn array_mut<'a, T>(argument: &'static str, pointer: *mut T, length: usize) -> Outcome<&'a mut [T]> {
    if length == 0 {
        return Ok(&mut []);
    }
    match pointer_fault(pointer, length) {
        Some(found) => Err(null_or_worse(argument, found)),
        // SAFETY: not NULL, aligned, no longer than the address space; writable as the caller promises.
        None => Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) }),
    }
}

/// Whether a result can be written through a pointer of the importer.
fn check_target<T>(argument: &'static str, pointer: *mut T) -> Outcome<()> {
    match pointer_fault(pointer, 1) {
        Some(found) => Err(Reason::Pointer { argument, found, expected: "where to write the result" }),
        None => Ok(()),
    }
}

/// Writes a result through a pointer of the importer.
///
/// # Safety
/// `pointer` is NULL or writable.
unsafe fn write_to<T>(argument: &'static str, pointer: *mut T, value: T) -> Outcome<()> {
    check_target(argument, pointer)?;
    // SAFETY: not NULL and aligned; writable as the caller promises.
    unsafe { pointer.write(value) };
    Ok(())
}

//! The C side: the 34 functions of FMI 2.0 co-simulation, generic over the model. They turn pointers
//! into slices and results into a status, and do nothing else; what they mean is in
//! [`super::instance`].
//!
//! Every call on an instance goes through one door, `enter`: NULL check, guard against calls from
//! within the importer's logger, call order, panic fence, error to logger, status. No globals, no
//! thread-locals.

mod derivatives;
mod lifecycle;
mod states;
mod stepping;
mod values;

pub use derivatives::*;
pub use lifecycle::*;
pub use states::*;
pub use stepping::*;
pub use values::*;

use super::bindings::{
    fmi2Component, fmi2Status, fmi2Status_fmi2Error, fmi2Status_fmi2Fatal, fmi2Status_fmi2OK,
};
use super::call_order::Function;
use super::error::Error;
use super::instance::Instance;
use super::logging::Category;
use super::model::Model;
use std::any::Any;
use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// What an `fmi2Component` points to.
struct Component<M: Model> {
    /// Whether a call is under way. A second one (out of a logger callback, or from another thread
    /// against the standard) is turned away instead of meeting a half-changed instance.
    busy: AtomicBool,
    instance: UnsafeCell<Instance<M>>,
}

/// The door. `body` runs with the instance, if `function` is allowed now.
///
/// # Safety
/// `c` is NULL or comes from [`instantiate`] for the same `M` and has not been freed.
unsafe fn enter<M: Model>(
    c: fmi2Component,
    function: Function,
    body: impl FnOnce(&mut Instance<M>) -> Result<(), Error>,
) -> fmi2Status {
    // SAFETY: as promised by the caller.
    let Some(component) = (unsafe { c.cast::<Component<M>>().as_ref() }) else {
        return fmi2Status_fmi2Error;
    };
    if component.busy.swap(true, Ordering::Acquire) {
        return fmi2Status_fmi2Error;
    }
    // SAFETY: `busy` was false and is true now, so that nobody else holds this reference.
    let instance = unsafe { &mut *component.instance.get() };
    let outcome = catch_unwind(AssertUnwindSafe(|| instance.allow(function).and_then(|()| body(instance))));
    let status = match outcome {
        Ok(Ok(())) => fmi2Status_fmi2OK,
        Ok(Err(error)) => report(instance, &error),
        Err(payload) => {
            instance.poison();
            report(instance, &Error::Panic { function, message: panic_message(payload) })
        }
    };
    component.busy.store(false, Ordering::Release);
    status
}

/// One line for the importer's logger, and the status.
fn report<M: Model>(instance: &mut Instance<M>, error: &Error) -> fmi2Status {
    let category = match error {
        Error::Poisoned { .. } | Error::Panic { .. } => Category::Fatal,
        Error::Unavailable { .. } => Category::Discard,
        _ => Category::Error,
    };
    let written =
        catch_unwind(AssertUnwindSafe(|| instance.logger().write(category, format_args!("{error}"))));
    match written {
        Ok(()) => category.status(),
        Err(payload) => {
            instance.poison();
            discard(payload);
            fmi2Status_fmi2Fatal
        }
    }
}

/// What a panic said.
pub(in crate::fmi) fn panic_message(payload: Box<dyn Any + Send>) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_owned());
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
    discard(payload);
    text.unwrap_or_else(|| "panic without a message".to_owned())
}

/// Drops what a panic carried; should that panic again, it is leaked.
pub(in crate::fmi) fn discard(payload: Box<dyn Any + Send>) {
    if let Err(second) = catch_unwind(AssertUnwindSafe(|| drop(payload))) {
        std::mem::forget(second);
    }
}

/// Why this pointer to `length` elements cannot be followed, if it cannot.
pub(in crate::fmi) fn pointer_fault<T>(pointer: *const T, length: usize) -> Option<&'static str> {
    if pointer.is_null() {
        Some("NULL")
    } else if !pointer.is_aligned() {
        Some("misaligned")
    } else if length.checked_mul(size_of::<T>()).is_none_or(|bytes| bytes > isize::MAX as usize) {
        Some("longer than the address space")
    } else {
        None
    }
}

/// An array of the importer; NULL is fine where there is nothing to read.
///
/// # Safety
/// `pointer` is NULL or points to `length` readable elements, unchanged during `'a`.
unsafe fn array<'a, T>(
    function: Function,
    argument: &'static str,
    pointer: *const T,
    length: usize,
) -> Result<&'a [T], Error> {
    if length == 0 {
        return Ok(&[]);
    }
    if let Some(found) = pointer_fault(pointer, length) {
        return Err(Error::Pointer {
            function,
            argument,
            found,
            expected: "an array with as many elements as given",
        });
    }
    // SAFETY: not NULL, aligned, no longer than the address space; readable as the caller promises.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// An array of the importer to write to.
///
/// # Safety
/// `pointer` is NULL or points to `length` writable elements that nobody else uses during `'a`.
unsafe fn array_mut<'a, T>(
    function: Function,
    argument: &'static str,
    pointer: *mut T,
    length: usize,
) -> Result<&'a mut [T], Error> {
    if length == 0 {
        return Ok(&mut []);
    }
    if let Some(found) = pointer_fault(pointer, length) {
        return Err(Error::Pointer {
            function,
            argument,
            found,
            expected: "an array with as many elements as given",
        });
    }
    // SAFETY: not NULL, aligned, no longer than the address space; writable as the caller promises.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
}

/// Writes a result through a pointer of the importer.
///
/// # Safety
/// `pointer` is NULL or writable.
unsafe fn write_to<T>(
    function: Function,
    argument: &'static str,
    pointer: *mut T,
    value: T,
) -> Result<(), Error> {
    if let Some(found) = pointer_fault(pointer, 1) {
        return Err(Error::Pointer { function, argument, found, expected: "where to write the result" });
    }
    // SAFETY: not NULL and aligned; writable as the caller promises.
    unsafe { pointer.write(value) };
    Ok(())
}

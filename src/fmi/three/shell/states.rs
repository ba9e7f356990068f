//! FMU states across C: an `fmi3FMUState` is a boxed [`Handle`].

use super::{array, array_mut, enter, write_to};
use crate::fmi::model::Model;
use crate::fmi::shell::{fnv, pointer_fault};
use crate::fmi::three::bindings::{fmi3Byte, fmi3FMUState, fmi3Instance, fmi3Status};
use crate::fmi::three::call_order::Function;
use crate::fmi::three::error::{Outcome, Reason};
use crate::fmi::three::instance::Instance;
use crate::fmi::three::state::Snapshot;

/// A snapshot behind a mark. A master that couples several of these FMUs may mix up their states; the mark comes
/// first, so that it can be looked at before anything is known about what follows.
#[repr(C)]
struct Handle<M: Model> {
    mark: u64,
    snapshot: Snapshot<M>,
}

impl<M: Model> Handle<M> {
    /// Standard, model and version: what decides how a snapshot lies in memory.
    const MARK: u64 = fnv(
        M::IDENTIFIER.as_bytes(),
        fnv(env!("CARGO_PKG_VERSION").as_bytes(), fnv(b"FMI 3.0", 0xcbf2_9ce4_8422_2325)),
    );
}

/// Whether there is a state, and that it is one of this model.
///
/// # Safety
/// `state` is NULL or comes from [`get_fmu_state`] or [`deserialize_fmu_state`], of whatever model, and has not been
/// freed.
unsafe fn is_given<M: Model>(state: fmi3FMUState) -> Outcome<bool> {
    if state.is_null() {
        return Ok(false);
    }
    // SAFETY: not NULL, so a living handle, whose first member is the mark.
    if unsafe { state.cast::<u64>().read() } == Handle::<M>::MARK {
        return Ok(true);
    }
    let (argument, found) = ("FMUState", "a state of another FMU");
    let expected = "one that fmi3GetFMUState or fmi3DeserializeFMUState of this FMU made";
    Err(Reason::Pointer { argument, found, expected })
}

/// The snapshot behind a state.
///
/// # Safety
/// As [`is_given`].
unsafe fn snapshot<'a, M: Model>(state: fmi3FMUState) -> Outcome<&'a Snapshot<M>> {
    // SAFETY: as promised by the caller.
    if unsafe { is_given::<M>(state) }? {
        // SAFETY: a living handle of this model.
        return Ok(unsafe { &(*state.cast::<Handle<M>>()).snapshot });
    }
    let expected = "a state from fmi3GetFMUState or fmi3DeserializeFMUState";
    Err(Reason::Pointer { argument: "FMUState", found: "NULL", expected })
}

/// Hands a snapshot out: into the state that `place` already holds, or as a new one.
///
/// # Safety
/// `place` is NULL or writable, and holds what [`is_given`] takes.
unsafe fn hand_out<M: Model>(
    place: *mut fmi3FMUState,
    make: impl FnOnce() -> Outcome<Snapshot<M>>,
) -> Outcome<()> {
    if let Some(found) = pointer_fault(place, 1) {
        return Err(Reason::Pointer { argument: "FMUState", found, expected: "where to write the state" });
    }
    // SAFETY: not NULL, readable as promised by the caller.
    let present = unsafe { place.read() };
    // SAFETY: as promised by the caller.
    let overwrites = unsafe { is_given::<M>(present) }?;
    let snapshot = make()?;
    if overwrites {
        // SAFETY: a living handle of this model, which nobody else uses.
        unsafe { (*present.cast::<Handle<M>>()).snapshot = snapshot };
    } else {
        let made = Box::new(Handle { mark: Handle::<M>::MARK, snapshot });
        // SAFETY: not NULL, writable as promised by the caller.
        unsafe { place.write(Box::into_raw(made).cast()) };
    }
    Ok(())
}

/// fmi3GetFMUState.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `state` is NULL or points to NULL or to a living state.
pub unsafe extern "C" fn get_fmu_state<M: Model>(c: fmi3Instance, state: *mut fmi3FMUState) -> fmi3Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        unsafe { hand_out(state, || instance.snapshot()) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::GetFMUState, body) }
}

/// fmi3SetFMUState.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `state` is NULL or a living state.
pub unsafe extern "C" fn set_fmu_state<M: Model>(c: fmi3Instance, state: fmi3FMUState) -> fmi3Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let snapshot = unsafe { snapshot(state) }?;
        instance.restore(snapshot)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::SetFMUState, body) }
}

/// fmi3FreeFMUState; NULL, or a pointer to NULL, is no error.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `state` is NULL or points to NULL or to a living state.
pub unsafe extern "C" fn free_fmu_state<M: Model>(c: fmi3Instance, state: *mut fmi3FMUState) -> fmi3Status {
    let body = |_: &mut Instance<M>| {
        if pointer_fault(state, 1).is_some() {
            return Ok(());
        }
        // SAFETY: not NULL, readable as promised by the caller.
        let present = unsafe { state.read() };
        // SAFETY: NULL or a living state, as promised by the caller.
        if unsafe { is_given::<M>(present) }? {
            // SAFETY: made by Box::into_raw in `hand_out` for this model, and out of reach from now on.
            unsafe {
                state.write(std::ptr::null_mut());
                drop(Box::from_raw(present.cast::<Handle<M>>()));
            }
        }
        Ok(())
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::FreeFMUState, body) }
}

/// fmi3SerializedFMUStateSize.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `state` is NULL or a living state; `size` is NULL or writable.
pub unsafe extern "C" fn serialized_fmu_state_size<M: Model>(
    c: fmi3Instance,
    state: fmi3FMUState,
    size: *mut usize,
) -> fmi3Status {
    let body = |_: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let snapshot: &Snapshot<M> = unsafe { snapshot(state) }?;
        let found = snapshot.serialized_size()?;
        // SAFETY: as promised by the caller.
        unsafe { write_to("size", size, found) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::SerializedFMUStateSize, body) }
}

/// fmi3SerializeFMUState.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `state` is NULL or a living state; `bytes` is NULL or has `size` bytes.
pub unsafe extern "C" fn serialize_fmu_state<M: Model>(
    c: fmi3Instance,
    state: fmi3FMUState,
    bytes: *mut fmi3Byte,
    size: usize,
) -> fmi3Status {
    let body = |_: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let snapshot: &Snapshot<M> = unsafe { snapshot(state) }?;
        // SAFETY: as promised by the caller.
        let out = unsafe { array_mut("serializedState", bytes, size) }?;
        snapshot.serialize_into(out)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::SerializeFMUState, body) }
}

/// fmi3DeserializeFMUState.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `bytes` is NULL or has `size` bytes; `state` is NULL or points to NULL
/// or to a living state.
pub unsafe extern "C" fn deserialize_fmu_state<M: Model>(
    c: fmi3Instance,
    bytes: *const fmi3Byte,
    size: usize,
    state: *mut fmi3FMUState,
) -> fmi3Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let bytes = unsafe { array("serializedState", bytes, size) }?;
        // SAFETY: as promised by the caller.
        unsafe { hand_out(state, || instance.deserialize(bytes)) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::DeserializeFMUState, body) }
}

//! FMU states across C: a `fmi2FMUstate` is a boxed [`Handle`].

use super::{array, array_mut, enter, pointer_fault, write_to};
use crate::fmi::bindings::{fmi2Byte, fmi2Component, fmi2FMUstate, fmi2Status};
use crate::fmi::call_order::Function;
use crate::fmi::error::Error;
use crate::fmi::instance::Instance;
use crate::fmi::model::Model;
use crate::fmi::state::Snapshot;

/// A snapshot behind a mark. A master that couples several of these FMUs may mix up their states; the mark comes
/// first, so that it can be looked at before anything is known about what follows.
#[repr(C)]
struct Handle<M: Model> {
    mark: u64,
    snapshot: Snapshot<M>,
}

impl<M: Model> Handle<M> {
    /// Model and version: what decides how a snapshot lies in memory.
    const MARK: u64 =
        fnv(M::IDENTIFIER.as_bytes(), fnv(env!("CARGO_PKG_VERSION").as_bytes(), 0xcbf2_9ce4_8422_2325));
}

/// FNV-1a, 64 bits.
pub(in crate::fmi) const fn fnv(mut bytes: &[u8], mut hash: u64) -> u64 {
    while let [first, rest @ ..] = bytes {
        hash = (hash ^ *first as u64).wrapping_mul(0x0100_0000_01b3);
        bytes = rest;
    }
    hash
}

/// Whether there is a state, and that it is one of this model.
///
/// # Safety
/// `state` is NULL or comes from [`get_fmu_state`] or [`deserialize_fmu_state`], of whatever model, and has not been
/// freed.
unsafe fn is_given<M: Model>(function: Function, state: fmi2FMUstate) -> Result<bool, Error> {
    if state.is_null() {
        return Ok(false);
    }
    // SAFETY: not NULL, so a living handle, whose first member is the mark.
    if unsafe { state.cast::<u64>().read() } == Handle::<M>::MARK {
        return Ok(true);
    }
    let (argument, found) = ("FMUstate", "a state of another FMU");
    let expected = "one that fmi2GetFMUstate or fmi2DeSerializeFMUstate of this FMU made";
    Err(Error::Pointer { function, argument, found, expected })
}

/// The snapshot behind a state.
///
/// # Safety
/// As [`is_given`].
unsafe fn snapshot<'a, M: Model>(function: Function, state: fmi2FMUstate) -> Result<&'a Snapshot<M>, Error> {
    // SAFETY: as promised by the caller.
    if unsafe { is_given::<M>(function, state) }? {
        // SAFETY: a living handle of this model.
        return Ok(unsafe { &(*state.cast::<Handle<M>>()).snapshot });
    }
    let expected = "a state from fmi2GetFMUstate or fmi2DeSerializeFMUstate";
    Err(Error::Pointer { function, argument: "FMUstate", found: "NULL", expected })
}

/// Hands a snapshot out: into the state that `place` already holds, or as a new one.
///
/// # Safety
/// `place` is NULL or writable, and holds what [`is_given`] takes.
unsafe fn hand_out<M: Model>(
    function: Function,
    place: *mut fmi2FMUstate,
    make: impl FnOnce() -> Result<Snapshot<M>, Error>,
) -> Result<(), Error> {
    if let Some(found) = pointer_fault(place, 1) {
        return Err(Error::Pointer {
            function,
            argument: "FMUstate",
            found,
            expected: "where to write the state",
        });
    }
    // SAFETY: not NULL, readable as promised by the caller.
    let present = unsafe { place.read() };
    // SAFETY: as promised by the caller.
    let overwrites = unsafe { is_given::<M>(function, present) }?;
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

/// fmi2GetFMUstate.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `state` is NULL or points to NULL or to a living state.
pub unsafe extern "C" fn get_fmu_state<M: Model>(c: fmi2Component, state: *mut fmi2FMUstate) -> fmi2Status {
    let function = Function::GetFmuState;
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        unsafe { hand_out(function, state, || instance.snapshot()) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2SetFMUstate.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `state` is NULL or a living state.
pub unsafe extern "C" fn set_fmu_state<M: Model>(c: fmi2Component, state: fmi2FMUstate) -> fmi2Status {
    let function = Function::SetFmuState;
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let snapshot = unsafe { snapshot(function, state) }?;
        instance.restore(snapshot)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2FreeFMUstate; NULL, or a pointer to NULL, is no error.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `state` is NULL or points to NULL or to a living state.
pub unsafe extern "C" fn free_fmu_state<M: Model>(c: fmi2Component, state: *mut fmi2FMUstate) -> fmi2Status {
    let function = Function::FreeFmuState;
    let body = |_: &mut Instance<M>| {
        if pointer_fault(state, 1).is_some() {
            return Ok(());
        }
        // SAFETY: not NULL, readable as promised by the caller.
        let present = unsafe { state.read() };
        // SAFETY: NULL or a living state, as promised by the caller.
        if unsafe { is_given::<M>(function, present) }? {
            // SAFETY: made by Box::into_raw in `hand_out` for this model, and out of reach from now on.
            unsafe {
                state.write(std::ptr::null_mut());
                drop(Box::from_raw(present.cast::<Handle<M>>()));
            }
        }
        Ok(())
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2SerializedFMUstateSize.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `state` is NULL or a living state; `size` is NULL or writable.
pub unsafe extern "C" fn serialized_fmu_state_size<M: Model>(
    c: fmi2Component,
    state: fmi2FMUstate,
    size: *mut usize,
) -> fmi2Status {
    let function = Function::SerializedFmuStateSize;
    let body = |_: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let snapshot: &Snapshot<M> = unsafe { snapshot(function, state) }?;
        let found = snapshot.serialized_size().map_err(Error::format(function))?;
        // SAFETY: as promised by the caller.
        unsafe { write_to(function, "size", size, found) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2SerializeFMUstate.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `state` is NULL or a living state; `bytes` is NULL or has `size` bytes.
pub unsafe extern "C" fn serialize_fmu_state<M: Model>(
    c: fmi2Component,
    state: fmi2FMUstate,
    bytes: *mut fmi2Byte,
    size: usize,
) -> fmi2Status {
    let function = Function::SerializeFmuState;
    let body = |_: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let snapshot: &Snapshot<M> = unsafe { snapshot(function, state) }?;
        // SAFETY: as promised by the caller; c_char and u8 have the same layout.
        let out = unsafe { array_mut(function, "serializedState", bytes.cast::<u8>(), size) }?;
        snapshot.serialize_into(out).map(|_| ()).map_err(Error::format(function))
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2DeSerializeFMUstate.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `bytes` is NULL or has `size` bytes; `state` is NULL or points to NULL
/// or to a living state.
pub unsafe extern "C" fn deserialize_fmu_state<M: Model>(
    c: fmi2Component,
    bytes: *const fmi2Byte,
    size: usize,
    state: *mut fmi2FMUstate,
) -> fmi2Status {
    let function = Function::DeSerializeFmuState;
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller; c_char and u8 have the same layout.
        let bytes = unsafe { array(function, "serializedState", bytes.cast::<u8>(), size) }?;
        // SAFETY: as promised by the caller.
        unsafe { hand_out(function, state, || instance.deserialize(bytes)) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

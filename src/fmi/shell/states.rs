//! FMU states across C: a `fmi2FMUstate` is a boxed [`Snapshot`].

use super::{array, array_mut, enter, pointer_fault, write_to};
use crate::fmi::bindings::{fmi2Byte, fmi2Component, fmi2FMUstate, fmi2Status};
use crate::fmi::call_order::Function;
use crate::fmi::error::Error;
use crate::fmi::instance::Instance;
use crate::fmi::model::Model;
use crate::fmi::state::Snapshot;

/// The snapshot behind a state.
///
/// # Safety
/// `state` is NULL or comes from [`get_fmu_state`] or [`deserialize_fmu_state`] for the same `M` and
/// has not been freed.
unsafe fn snapshot<'a, M: Model>(function: Function, state: fmi2FMUstate) -> Result<&'a Snapshot<M>, Error> {
    let null = Error::Pointer {
        function,
        argument: "FMUstate",
        found: "NULL",
        expected: "a state from fmi2GetFMUstate or fmi2DeSerializeFMUstate",
    };
    // SAFETY: as promised by the caller.
    unsafe { state.cast::<Snapshot<M>>().as_ref() }.ok_or(null)
}

/// Hands a snapshot out: into the state that `place` already holds, or as a new one.
///
/// # Safety
/// `place` is NULL or writable, and holds NULL or a living state as in [`snapshot`].
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
    let made = make()?;
    // SAFETY: not NULL; what it holds is as promised by the caller, and nobody else uses it.
    match unsafe { place.read().cast::<Snapshot<M>>().as_mut() } {
        Some(present) => *present = made,
        // SAFETY: not NULL, writable as promised by the caller.
        None => unsafe { place.write(Box::into_raw(Box::new(made)).cast()) },
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
    let body = |_: &mut Instance<M>| {
        if pointer_fault(state, 1).is_none() {
            // SAFETY: not NULL, and holds NULL or a living state as promised by the caller.
            let present = unsafe { state.replace(std::ptr::null_mut()) }.cast::<Snapshot<M>>();
            if !present.is_null() {
                // SAFETY: made by Box::into_raw in `hand_out` and out of reach from now on.
                drop(unsafe { Box::from_raw(present) });
            }
        }
        Ok(())
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::FreeFmuState, body) }
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

//! fmi2DoStep and the status functions. Steps are computed within the call: never fmi2Pending, so
//! that there is nothing to cancel and no pending status.

use super::{enter, write_to};
use crate::fmi::bindings::{
    fmi2Boolean, fmi2Component, fmi2False, fmi2Integer, fmi2Real, fmi2Status, fmi2StatusKind,
    fmi2StatusKind_fmi2LastSuccessfulTime, fmi2StatusKind_fmi2Terminated, fmi2String,
};
use crate::fmi::call_order::Function;
use crate::fmi::error::Error;
use crate::fmi::instance::Instance;
use crate::fmi::model::Model;

/// fmi2DoStep.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
pub unsafe extern "C" fn do_step<M: Model>(
    c: fmi2Component,
    current_communication_point: fmi2Real,
    communication_step_size: fmi2Real,
    _no_set_fmu_state_prior_to_current_point: fmi2Boolean,
) -> fmi2Status {
    let body =
        |instance: &mut Instance<M>| instance.do_step(current_communication_point, communication_step_size);
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::DoStep, body) }
}

/// fmi2CancelStep: an error, because no step is ever in progress.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
pub unsafe extern "C" fn cancel_step<M: Model>(c: fmi2Component) -> fmi2Status {
    let function = Function::CancelStep;
    let reason = "no step is in progress; fmi2DoStep always completes before it returns";
    let body = |_: &mut Instance<M>| Err(Error::Unsupported { function, reason });
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

const SYNCHRONOUS: &str = "fmi2DoStep always completes before it returns; only fmi2LastSuccessfulTime and fmi2Terminated are available";

/// A status that does not exist here: fmi2Discard.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
unsafe fn unavailable<M: Model>(c: fmi2Component, function: Function) -> fmi2Status {
    let body = |_: &mut Instance<M>| Err(Error::Unavailable { function, reason: SYNCHRONOUS });
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2GetStatus: fmi2Discard.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
pub unsafe extern "C" fn get_status<M: Model>(
    c: fmi2Component,
    _kind: fmi2StatusKind,
    _value: *mut fmi2Status,
) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { unavailable::<M>(c, Function::GetStatus) }
}

/// fmi2GetRealStatus: the end of the last step for fmi2LastSuccessfulTime, else fmi2Discard.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `value` is NULL or writable.
pub unsafe extern "C" fn get_real_status<M: Model>(
    c: fmi2Component,
    kind: fmi2StatusKind,
    value: *mut fmi2Real,
) -> fmi2Status {
    let function = Function::GetRealStatus;
    let body = |instance: &mut Instance<M>| {
        if kind != fmi2StatusKind_fmi2LastSuccessfulTime {
            return Err(Error::Unavailable { function, reason: SYNCHRONOUS });
        }
        // SAFETY: as promised by the caller.
        unsafe { write_to(function, "value", value, instance.time_s()) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2GetIntegerStatus: fmi2Discard.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
pub unsafe extern "C" fn get_integer_status<M: Model>(
    c: fmi2Component,
    _kind: fmi2StatusKind,
    _value: *mut fmi2Integer,
) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { unavailable::<M>(c, Function::GetIntegerStatus) }
}

/// fmi2GetBooleanStatus: false for fmi2Terminated (the FMU never ends a simulation), else fmi2Discard.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `value` is NULL or writable.
pub unsafe extern "C" fn get_boolean_status<M: Model>(
    c: fmi2Component,
    kind: fmi2StatusKind,
    value: *mut fmi2Boolean,
) -> fmi2Status {
    let function = Function::GetBooleanStatus;
    let body = |_: &mut Instance<M>| {
        if kind != fmi2StatusKind_fmi2Terminated {
            return Err(Error::Unavailable { function, reason: SYNCHRONOUS });
        }
        // SAFETY: as promised by the caller.
        unsafe { write_to(function, "value", value, fmi2False as fmi2Boolean) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2GetStringStatus: fmi2Discard.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
pub unsafe extern "C" fn get_string_status<M: Model>(
    c: fmi2Component,
    _kind: fmi2StatusKind,
    _value: *mut fmi2String,
) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { unavailable::<M>(c, Function::GetStringStatus) }
}

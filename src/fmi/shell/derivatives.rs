//! fmi2GetDirectionalDerivative, fmi2SetRealInputDerivatives, fmi2GetRealOutputDerivatives: pointers into
//! slices and nothing else.

use super::{array, array_mut, enter};
use crate::fmi::bindings::{fmi2Component, fmi2Integer, fmi2Real, fmi2Status, fmi2ValueReference};
use crate::fmi::call_order::Function;
use crate::fmi::instance::Instance;
use crate::fmi::model::Model;

/// fmi2SetRealInputDerivatives.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `vr`, `order` and `value` are NULL or have `nvr` elements.
pub unsafe extern "C" fn set_real_input_derivatives<M: Model>(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    order: *const fmi2Integer,
    value: *const fmi2Real,
) -> fmi2Status {
    let function = Function::SetRealInputDerivatives;
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let references = unsafe { array(function, "vr", vr, nvr) }?;
        // SAFETY: as promised by the caller.
        let orders = unsafe { array(function, "order", order, nvr) }?;
        // SAFETY: as promised by the caller.
        let values = unsafe { array(function, "value", value, nvr) }?;
        instance.set_real_input_derivatives(references, orders, values)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2GetRealOutputDerivatives.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `vr`, `order` and `value` are NULL or have `nvr` elements.
pub unsafe extern "C" fn get_real_output_derivatives<M: Model>(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    order: *const fmi2Integer,
    value: *mut fmi2Real,
) -> fmi2Status {
    let function = Function::GetRealOutputDerivatives;
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let references = unsafe { array(function, "vr", vr, nvr) }?;
        // SAFETY: as promised by the caller.
        let orders = unsafe { array(function, "order", order, nvr) }?;
        // SAFETY: as promised by the caller.
        let values = unsafe { array_mut(function, "value", value, nvr) }?;
        instance.get_real_output_derivatives(references, orders, values)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2GetDirectionalDerivative.
///
/// # Safety
/// `c` as for fmi2FreeInstance; `unknown` and `dv_unknown` are NULL or have `n_unknown` elements, `known` and
/// `dv_known` are NULL or have `n_known`.
pub unsafe extern "C" fn get_directional_derivative<M: Model>(
    c: fmi2Component,
    unknown: *const fmi2ValueReference,
    n_unknown: usize,
    known: *const fmi2ValueReference,
    n_known: usize,
    dv_known: *const fmi2Real,
    dv_unknown: *mut fmi2Real,
) -> fmi2Status {
    let function = Function::GetDirectionalDerivative;
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let unknowns = unsafe { array(function, "vUnknown_ref", unknown, n_unknown) }?;
        // SAFETY: as promised by the caller.
        let knowns = unsafe { array(function, "vKnown_ref", known, n_known) }?;
        // SAFETY: as promised by the caller.
        let seeds = unsafe { array(function, "dvKnown", dv_known, n_known) }?;
        // SAFETY: as promised by the caller.
        let results = unsafe { array_mut(function, "dvUnknown", dv_unknown, n_unknown) }?;
        instance.get_directional_derivative(unknowns, knowns, seeds, results)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

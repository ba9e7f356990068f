//! fmi3GetDirectionalDerivative, fmi3GetOutputDerivatives and the dependencies of variables: pointers into slices.

use super::{array, array_mut, enter, write_to};
use crate::fmi::model::Model;
use crate::fmi::three::bindings::{
    fmi3DependencyKind, fmi3DependencyKind_fmi3Dependent, fmi3Float64, fmi3Instance, fmi3Int32, fmi3Status,
    fmi3ValueReference,
};
use crate::fmi::three::call_order::Function;
use crate::fmi::three::error::Reason;
use crate::fmi::three::instance::Instance;

/// fmi3GetDirectionalDerivative.
///
/// # Safety
/// `c` as for fmi3FreeInstance; each pointer is NULL or has as many elements as the number after it says.
#[allow(clippy::too_many_arguments, reason = "the standard's signature")]
pub unsafe extern "C" fn get_directional_derivative<M: Model>(
    c: fmi3Instance,
    unknowns: *const fmi3ValueReference,
    n_unknowns: usize,
    knowns: *const fmi3ValueReference,
    n_knowns: usize,
    seed: *const fmi3Float64,
    n_seed: usize,
    sensitivity: *mut fmi3Float64,
    n_sensitivity: usize,
) -> fmi3Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let unknowns = unsafe { array("unknowns", unknowns, n_unknowns) }?;
        // SAFETY: as promised by the caller.
        let knowns = unsafe { array("knowns", knowns, n_knowns) }?;
        // SAFETY: as promised by the caller.
        let seeds = unsafe { array("seed", seed, n_seed) }?;
        // SAFETY: as promised by the caller.
        let results = unsafe { array_mut("sensitivity", sensitivity, n_sensitivity) }?;
        instance.get_directional_derivative(unknowns, knowns, seeds, results)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::GetDirectionalDerivative, body) }
}

/// fmi3GetOutputDerivatives.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `vr` and `orders` are NULL or have `n` elements, `values` is NULL or has `n_values`.
pub unsafe extern "C" fn get_output_derivatives<M: Model>(
    c: fmi3Instance,
    vr: *const fmi3ValueReference,
    n: usize,
    orders: *const fmi3Int32,
    values: *mut fmi3Float64,
    n_values: usize,
) -> fmi3Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let references = unsafe { array("valueReferences", vr, n) }?;
        // SAFETY: as promised by the caller.
        let orders = unsafe { array("orders", orders, n) }?;
        // SAFETY: as promised by the caller.
        let values = unsafe { array_mut("values", values, n_values) }?;
        instance.get_output_derivatives(references, orders, values)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::GetOutputDerivatives, body) }
}

/// fmi3GetNumberOfVariableDependencies.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `n` is NULL or writable.
pub unsafe extern "C" fn get_number_of_variable_dependencies<M: Model>(
    c: fmi3Instance,
    vr: fmi3ValueReference,
    n: *mut usize,
) -> fmi3Status {
    let function = Function::GetNumberOfVariableDependencies;
    let body = |instance: &mut Instance<M>| {
        let found = instance.dependencies(function, vr)?.len();
        // SAFETY: as promised by the caller.
        unsafe { write_to("nDependencies", n, found) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi3GetVariableDependencies.
///
/// # Safety
/// `c` as for fmi3FreeInstance; each array is NULL or has `n` elements.
pub unsafe extern "C" fn get_variable_dependencies<M: Model>(
    c: fmi3Instance,
    dependent: fmi3ValueReference,
    elements: *mut usize,
    independents: *mut fmi3ValueReference,
    elements_of_independents: *mut usize,
    kinds: *mut fmi3DependencyKind,
    n: usize,
) -> fmi3Status {
    let function = Function::GetVariableDependencies;
    let body = |instance: &mut Instance<M>| {
        let found = instance.dependencies(function, dependent)?;
        if found.len() != n {
            let expected = format!("{}, as fmi3GetNumberOfVariableDependencies says", found.len());
            return Err(Reason::argument("nDependencies", n, expected));
        }
        // SAFETY: as promised by the caller.
        let elements = unsafe { array_mut("elementIndicesOfDependent", elements, n) }?;
        // SAFETY: as promised by the caller.
        let independents = unsafe { array_mut("independents", independents, n) }?;
        // SAFETY: as promised by the caller.
        let others = unsafe { array_mut("elementIndicesOfIndependents", elements_of_independents, n) }?;
        // SAFETY: as promised by the caller.
        let kinds = unsafe { array_mut("dependencyKinds", kinds, n) }?;
        kinds.fill(fmi3DependencyKind_fmi3Dependent);
        let places = elements.iter_mut().zip(independents).zip(others);
        for (((element, independent), other), one) in places.zip(found) {
            (*element, *independent, *other) = (one.element, one.independent, one.independent_element);
        }
        Ok(())
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

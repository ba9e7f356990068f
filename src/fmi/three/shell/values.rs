//! fmi3Get... and fmi3Set... of the types that this FMU has, and of those that it has not.

use super::{array, array_mut, enter};
use crate::fmi::model::Model;
use crate::fmi::three::bindings::{
    fmi3Boolean, fmi3Float64, fmi3Instance, fmi3Int32, fmi3Status, fmi3UInt64, fmi3ValueReference,
};
use crate::fmi::three::call_order::Function;
use crate::fmi::three::instance::Instance;

macro_rules! getter {
    ($doc:literal, $name:ident, $function:ident, $type:ty, $as:ty) => {
        #[doc = $doc]
        ///
        /// # Safety
        /// `c` as for fmi3FreeInstance; `vr` is NULL or has `n` elements, `values` is NULL or has `n_values`.
        pub unsafe extern "C" fn $name<M: Model>(
            c: fmi3Instance,
            vr: *const fmi3ValueReference,
            n: usize,
            values: *mut $type,
            n_values: usize,
        ) -> fmi3Status {
            let body = |instance: &mut Instance<M>| {
                // SAFETY: as promised by the caller.
                let references = unsafe { array("valueReferences", vr, n) }?;
                // SAFETY: as promised by the caller; both types have the same layout.
                let values = unsafe { array_mut("values", values.cast::<$as>(), n_values) }?;
                instance.$name(references, values)
            };
            // SAFETY: as promised by the caller.
            unsafe { enter(c, Function::$function, body) }
        }
    };
}

macro_rules! setter {
    ($doc:literal, $name:ident, $function:ident, $type:ty, $as:ty, $set:ident) => {
        #[doc = $doc]
        ///
        /// # Safety
        /// `c` as for fmi3FreeInstance; `vr` is NULL or has `n` elements, `values` is NULL or has `n_values`.
        pub unsafe extern "C" fn $name<M: Model>(
            c: fmi3Instance,
            vr: *const fmi3ValueReference,
            n: usize,
            values: *const $type,
            n_values: usize,
        ) -> fmi3Status {
            let body = |instance: &mut Instance<M>| {
                // SAFETY: as promised by the caller.
                let references = unsafe { array("valueReferences", vr, n) }?;
                // SAFETY: as promised by the caller; both types have the same layout.
                let values = unsafe { array("values", values.cast::<$as>(), n_values) }?;
                instance.$set(references, values)
            };
            // SAFETY: as promised by the caller.
            unsafe { enter(c, Function::$function, body) }
        }
    };
}

getter!("fmi3GetFloat64.", get_float64, GetFloat64, fmi3Float64, f64);
getter!("fmi3GetInt32.", get_int32, GetInt32, fmi3Int32, i32);
getter!("fmi3GetUInt64.", get_uint64, GetUInt64, fmi3UInt64, u64);
getter!("fmi3GetBoolean.", get_boolean, GetBoolean, fmi3Boolean, u8);
setter!("fmi3SetFloat64.", set_float64, SetFloat64, fmi3Float64, f64, set_float64);
setter!("fmi3SetInt32.", set_int32, SetInt32, fmi3Int32, i32, set_int32);
setter!("fmi3SetUInt64.", set_uint64, SetUInt64, fmi3UInt64, u64, set_uint64);
// Read as bytes: what C writes there need not be 0 or 1.
setter!("fmi3SetBoolean: all but 0 is true.", set_boolean, SetBoolean, fmi3Boolean, u8, set_boolean_bytes);

/// fmi3Get... and fmi3Set... of a type that no variable has: fine as long as it asks for nothing.
///
/// # Safety
/// `c` as for fmi3FreeInstance; `vr` is NULL or has `n` elements.
pub unsafe fn no_such_type<M: Model>(
    c: fmi3Instance,
    function: Function,
    vr: *const fmi3ValueReference,
    n: usize,
) -> fmi3Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let references = unsafe { array("valueReferences", vr, n) }?;
        instance.refuse_type(function, references)
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

//! fmi2GetXXX, fmi2SetXXX and what has no values here: strings.

use super::{array, array_mut, enter};
use crate::fmi::bindings::{
    fmi2Boolean, fmi2Component, fmi2Integer, fmi2Real, fmi2Status, fmi2String, fmi2ValueReference,
};
use crate::fmi::call_order::Function;
use crate::fmi::error::Error;
use crate::fmi::instance::Instance;
use crate::fmi::model::Model;

macro_rules! getter {
    ($doc:literal, $name:ident, $function:ident, $type:ty) => {
        #[doc = $doc]
        ///
        /// # Safety
        /// `c` as for fmi2FreeInstance; `vr` and `value` are NULL or have `nvr` elements.
        pub unsafe extern "C" fn $name<M: Model>(
            c: fmi2Component,
            vr: *const fmi2ValueReference,
            nvr: usize,
            value: *mut $type,
        ) -> fmi2Status {
            let body = |instance: &mut Instance<M>| {
                // SAFETY: as promised by the caller.
                let references = unsafe { array(Function::$function, "vr", vr, nvr) }?;
                // SAFETY: as promised by the caller.
                let values = unsafe { array_mut(Function::$function, "value", value, nvr) }?;
                instance.$name(references, values)
            };
            // SAFETY: as promised by the caller.
            unsafe { enter(c, Function::$function, body) }
        }
    };
}

macro_rules! setter {
    ($doc:literal, $name:ident, $function:ident, $type:ty, $set:expr) => {
        #[doc = $doc]
        ///
        /// # Safety
        /// `c` as for fmi2FreeInstance; `vr` and `value` are NULL or have `nvr` elements.
        pub unsafe extern "C" fn $name<M: Model>(
            c: fmi2Component,
            vr: *const fmi2ValueReference,
            nvr: usize,
            value: *const $type,
        ) -> fmi2Status {
            let body = |instance: &mut Instance<M>| {
                // SAFETY: as promised by the caller.
                let references = unsafe { array(Function::$function, "vr", vr, nvr) }?;
                // SAFETY: as promised by the caller.
                let values = unsafe { array(Function::$function, "value", value, nvr) }?;
                $set(instance, references, values)
            };
            // SAFETY: as promised by the caller.
            unsafe { enter(c, Function::$function, body) }
        }
    };
}

getter!("fmi2GetReal.", get_real, GetReal, fmi2Real);
getter!("fmi2GetInteger.", get_integer, GetInteger, fmi2Integer);
getter!("fmi2GetBoolean.", get_boolean, GetBoolean, fmi2Boolean);
setter!("fmi2SetReal.", set_real, SetReal, fmi2Real, Instance::<M>::set_real);
setter!("fmi2SetInteger.", set_integer, SetInteger, fmi2Integer, Instance::<M>::set_integer);
setter!(
    "fmi2SetBoolean: all but 0 is true.",
    set_boolean,
    SetBoolean,
    fmi2Boolean,
    |instance: &mut Instance<M>, references, values| {
        instance.set_boolean_from(references, values, |value: fmi2Boolean| value != 0)
    }
);

/// A call that is fine as long as it asks for nothing.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
unsafe fn only_empty<M: Model>(
    c: fmi2Component,
    function: Function,
    length: usize,
    reason: &'static str,
) -> fmi2Status {
    let body = |_: &mut Instance<M>| match length {
        0 => Ok(()),
        _ => Err(Error::Unsupported { function, reason }),
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

const NO_STRINGS: &str = "this FMU has no String variables; expected an empty array";

/// fmi2GetString: there are no String variables.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
pub unsafe extern "C" fn get_string<M: Model>(
    c: fmi2Component,
    _vr: *const fmi2ValueReference,
    nvr: usize,
    _value: *mut fmi2String,
) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { only_empty::<M>(c, Function::GetString, nvr, NO_STRINGS) }
}

/// fmi2SetString: there are no String variables.
///
/// # Safety
/// `c` as for fmi2FreeInstance.
pub unsafe extern "C" fn set_string<M: Model>(
    c: fmi2Component,
    _vr: *const fmi2ValueReference,
    nvr: usize,
    _value: *const fmi2String,
) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { only_empty::<M>(c, Function::SetString, nvr, NO_STRINGS) }
}

//! fmi3DoStep. A step is computed within the call and never ends early.

use super::{check_target, enter, write_to};
use crate::fmi::model::Model;
use crate::fmi::three::bindings::{fmi3Boolean, fmi3Float64, fmi3Instance, fmi3Status};
use crate::fmi::three::call_order::Function;
use crate::fmi::three::instance::Instance;

/// fmi3DoStep. No event waits to be handled, nothing asks for an end, and the step goes to where it was to go.
///
/// # Safety
/// `c` as for fmi3FreeInstance; the four pointers are NULL or writable.
#[allow(clippy::too_many_arguments, reason = "the standard's signature")]
pub unsafe extern "C" fn do_step<M: Model>(
    c: fmi3Instance,
    current_communication_point: fmi3Float64,
    communication_step_size: fmi3Float64,
    _no_set_fmu_state_prior_to_current_point: fmi3Boolean,
    event_handling_needed: *mut fmi3Boolean,
    terminate_simulation: *mut fmi3Boolean,
    early_return: *mut fmi3Boolean,
    last_successful_time: *mut fmi3Float64,
) -> fmi3Status {
    let body = |instance: &mut Instance<M>| {
        let flags = [
            ("eventHandlingNeeded", event_handling_needed),
            ("terminateSimulation", terminate_simulation),
            ("earlyReturn", early_return),
        ];
        for (name, flag) in flags {
            check_target(name, flag)?;
        }
        check_target("lastSuccessfulTime", last_successful_time)?;
        let end_s = instance.do_step(current_communication_point, communication_step_size)?;
        for (name, flag) in flags {
            // SAFETY: as promised by the caller.
            unsafe { write_to(name, flag, false) }?;
        }
        // SAFETY: as promised by the caller.
        unsafe { write_to("lastSuccessfulTime", last_successful_time, end_s) }
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::DoStep, body) }
}

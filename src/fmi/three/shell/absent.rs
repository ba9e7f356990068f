//! What FMI 3.0 has and this FMU has no use for: model exchange, scheduled execution, events, clocks, adjoint
//! derivatives. Every function is there and says so in the log.

use super::enter;
use super::lifecycle::refuse;
use super::logger::from_callback;
use crate::fmi::model::Model;
use crate::fmi::three::bindings::{
    fmi3Instance, fmi3InstanceEnvironment, fmi3LogMessageCallback, fmi3Status,
};
use crate::fmi::three::call_order::Function;
use crate::fmi::three::error::Reason;
use crate::fmi::three::instance::Instance;

/// Why there is nothing behind a function.
fn reason(function: Function) -> &'static str {
    match function {
        Function::InstantiateModelExchange => {
            "modelDescription.xml has no ModelExchange element; expected fmi3InstantiateCoSimulation"
        }
        Function::InstantiateScheduledExecution => {
            "modelDescription.xml has no ScheduledExecution element; expected fmi3InstantiateCoSimulation"
        }
        Function::EnterEventMode
        | Function::EnterStepMode
        | Function::EvaluateDiscreteStates
        | Function::UpdateDiscreteStates => {
            "hasEventMode is false in modelDescription.xml; inputs are set between steps, in step mode"
        }
        Function::GetIntervalDecimal
        | Function::GetIntervalFraction
        | Function::GetShiftDecimal
        | Function::GetShiftFraction
        | Function::SetIntervalDecimal
        | Function::SetIntervalFraction
        | Function::SetShiftDecimal
        | Function::SetShiftFraction
        | Function::ActivateModelPartition => "this FMU has no clocks",
        Function::GetAdjointDerivative => {
            "providesAdjointDerivatives is false in modelDescription.xml; expected fmi3GetDirectionalDerivative"
        }
        _ => "this function is for model exchange; this FMU is for co-simulation, expected fmi3DoStep",
    }
}

/// A function with nothing behind it: an error, with its reason in the log.
///
/// # Safety
/// `c` as for fmi3FreeInstance.
pub unsafe fn absent<M: Model>(c: fmi3Instance, function: Function) -> fmi3Status {
    let body = |_: &mut Instance<M>| Err(Reason::Unsupported(reason(function)));
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// An interface type that there is not: NULL, with its reason in the log.
///
/// # Safety
/// `log_message` is NULL or callable.
pub unsafe fn no_such_interface(
    function: Function,
    environment: fmi3InstanceEnvironment,
    log_message: fmi3LogMessageCallback,
) -> fmi3Instance {
    // SAFETY: as promised by the caller.
    let mut logger = unsafe { from_callback(log_message, environment, true) };
    refuse(&mut logger, function, Reason::Unsupported(reason(function)))
}

//! From fmi3InstantiateCoSimulation to fmi3FreeInstance.

use super::logger::from_callback;
use super::{Component, array, enter};
use crate::fmi::logging::{Category, Logger};
use crate::fmi::model::Model;
use crate::fmi::resource_location;
use crate::fmi::shell::{discard, panic_message, text};
use crate::fmi::three::bindings::{
    fmi3Boolean, fmi3Float64, fmi3Instance, fmi3InstanceEnvironment, fmi3IntermediateUpdateCallback,
    fmi3LogMessageCallback, fmi3Status, fmi3String, fmi3ValueReference,
};
use crate::fmi::three::call_order::Function;
use crate::fmi::three::error::{Outcome, Reason};
use crate::fmi::three::instance::Instance;
use std::cell::UnsafeCell;
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// fmi3GetVersion.
pub extern "C" fn get_version() -> *const c_char {
    c"3.0".as_ptr()
}

/// What an importer hands over when it instantiates.
struct Request<'a> {
    token: Option<&'a CStr>,
    path: Option<&'a CStr>,
    event_mode: bool,
    intermediate: usize,
}

/// fmi3InstantiateCoSimulation; NULL, with a log line, when something is wrong.
///
/// # Safety
/// The strings are NULL or end in NUL; `log_message` is NULL or stays callable until the instance is freed.
#[allow(clippy::too_many_arguments, reason = "the standard's signature")]
pub unsafe extern "C" fn instantiate_co_simulation<M: Model>(
    instance_name: fmi3String,
    instantiation_token: fmi3String,
    resource_path: fmi3String,
    _visible: fmi3Boolean,
    logging_on: fmi3Boolean,
    event_mode_used: fmi3Boolean,
    _early_return_allowed: fmi3Boolean,
    _required_intermediate_variables: *const fmi3ValueReference,
    n_required_intermediate_variables: usize,
    instance_environment: fmi3InstanceEnvironment,
    log_message: fmi3LogMessageCallback,
    _intermediate_update: fmi3IntermediateUpdateCallback,
) -> fmi3Instance {
    // SAFETY: as promised by the caller, for all three pointers.
    let (name, token, path) =
        unsafe { (text(instance_name), text(instantiation_token), text(resource_path)) };
    // SAFETY: as promised by the caller.
    let mut logger = unsafe { from_callback(log_message, instance_environment, logging_on) };
    let request =
        Request { token, path, event_mode: event_mode_used, intermediate: n_required_intermediate_variables };
    let made = catch_unwind(AssertUnwindSafe(|| {
        let name = name.map(CStr::to_string_lossy).filter(|name| !name.is_empty());
        load::<M>(&name.unwrap_or(M::IDENTIFIER.into()), &request)
    }));
    let reason = match made {
        Ok(Ok(mut instance)) => {
            *instance.logger() = logger;
            let component = Component { busy: AtomicBool::new(false), instance: UnsafeCell::new(instance) };
            return Box::into_raw(Box::new(component)).cast();
        }
        Ok(Err(reason)) => reason,
        Err(payload) => Reason::Panic { message: panic_message(payload) },
    };
    refuse(&mut logger, Function::InstantiateCoSimulation, reason)
}

/// NULL, with a log line.
pub(super) fn refuse(logger: &mut Logger, function: Function, reason: Reason) -> fmi3Instance {
    let error = reason.of(function);
    let written = catch_unwind(AssertUnwindSafe(|| logger.write(Category::Error, format_args!("{error}"))));
    if let Err(payload) = written {
        discard(payload);
    }
    std::ptr::null_mut()
}

/// Checks the arguments, reads the model and compares the token.
fn load<M: Model>(name: &str, request: &Request<'_>) -> Outcome<Instance<M>> {
    let null = |argument, expected| Reason::Pointer { argument, found: "NULL", expected };
    if request.event_mode {
        let expected = "false, because hasEventMode is false in modelDescription.xml";
        return Err(Reason::argument("eventModeUsed", "true", expected));
    }
    if request.intermediate > 0 {
        let expected = "0, because providesIntermediateUpdate is false in modelDescription.xml";
        return Err(Reason::argument("nRequiredIntermediateVariables", request.intermediate, expected));
    }
    let token = null("instantiationToken", "the instantiationToken of modelDescription.xml");
    let given = request.token.ok_or(token)?.to_string_lossy();
    let path = request.path.ok_or(null("resourcePath", "the path of the unpacked resources folder"))?;
    let folder = folder(path)?;
    if !folder.is_dir() {
        let found = path.to_string_lossy();
        return Err(Reason::Load(format!(
            "resourcePath \"{found}\": {} is no readable folder",
            folder.display()
        )));
    }
    let model = M::load_shapeable(&folder)?;
    let instance = Instance::from_model(name, model, Logger::silent())?;
    let expected = instance.token();
    if given.trim_start_matches('{').trim_end_matches('}') != expected.to_string() {
        return Err(Reason::Load(format!(
            "instantiationToken is \"{given}\", but the resources in {} make it {expected}; expected \
             modelDescription.xml, shared library and resources of one export",
            folder.display()
        )));
    }
    Ok(instance)
}

/// FMI 3.0 hands over a path; importers that grew up with FMI 2.0 a URI.
fn folder(path: &CStr) -> Outcome<PathBuf> {
    if path.to_bytes().starts_with(b"file:") {
        return resource_location::to_path(path.to_bytes()).map_err(Reason::Load);
    }
    match path.to_str() {
        Ok(path) => Ok(PathBuf::from(path)),
        Err(_) => Err(Reason::argument("resourcePath", path.to_string_lossy(), "UTF-8")),
    }
}

/// fmi3FreeInstance; NULL is no error.
///
/// # Safety
/// `c` is NULL or comes from [`instantiate_co_simulation`] for the same `M` and has not been freed.
pub unsafe extern "C" fn free_instance<M: Model>(c: fmi3Instance) {
    let pointer = c.cast::<Component<M>>();
    // SAFETY: as promised by the caller.
    let Some(component) = (unsafe { pointer.as_ref() }) else { return };
    // An instance freed from within its own call (a logger callback) is leaked, not pulled away.
    if component.busy.swap(true, Ordering::Acquire) {
        return;
    }
    // SAFETY: made by Box::into_raw in `instantiate_co_simulation`, freed only here, nobody else is using it.
    let owned = unsafe { Box::from_raw(pointer) };
    if let Err(payload) = catch_unwind(AssertUnwindSafe(|| drop(owned))) {
        discard(payload);
    }
}

/// fmi3SetDebugLogging.
///
/// # Safety
/// As [`free_instance`]; `categories` is NULL or has `n` strings, each NULL or ending in NUL.
pub unsafe extern "C" fn set_debug_logging<M: Model>(
    c: fmi3Instance,
    logging_on: fmi3Boolean,
    n: usize,
    categories: *const fmi3String,
) -> fmi3Status {
    let function = Function::SetDebugLogging;
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let names = unsafe { array("categories", categories, n) }?;
        // SAFETY: as promised by the caller; a NULL counts as an unknown category.
        let names = names.iter().map(|name| unsafe { text(*name) }.unwrap_or(c"NULL"));
        instance.logger().set_debug_logging_by(function.name(), logging_on, names);
        Ok(())
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi3EnterInitializationMode.
///
/// # Safety
/// As [`free_instance`].
pub unsafe extern "C" fn enter_initialization_mode<M: Model>(
    c: fmi3Instance,
    _tolerance_defined: fmi3Boolean,
    _tolerance: fmi3Float64,
    start_time: fmi3Float64,
    stop_time_defined: fmi3Boolean,
    stop_time: fmi3Float64,
) -> fmi3Status {
    let stop = stop_time_defined.then_some(stop_time);
    let body = |instance: &mut Instance<M>| instance.enter_initialization_mode(start_time, stop);
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::EnterInitializationMode, body) }
}

macro_rules! plain {
    ($($doc:literal, $name:ident = $function:ident;)*) => { $(
        #[doc = $doc]
        ///
        /// # Safety
        /// As [`free_instance`].
        pub unsafe extern "C" fn $name<M: Model>(c: fmi3Instance) -> fmi3Status {
            // SAFETY: as promised by the caller.
            unsafe { enter(c, Function::$function, Instance::<M>::$name) }
        }
    )* };
}

plain! {
    "fmi3ExitInitializationMode.", exit_initialization_mode = ExitInitializationMode;
    "fmi3EnterConfigurationMode.", enter_configuration_mode = EnterConfigurationMode;
    "fmi3ExitConfigurationMode.", exit_configuration_mode = ExitConfigurationMode;
    "fmi3Terminate.", terminate = Terminate;
    "fmi3Reset.", reset = Reset;
}

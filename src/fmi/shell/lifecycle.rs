//! From fmi2Instantiate to fmi2FreeInstance.

use super::{Component, array, discard, enter, panic_message};
use crate::fmi::bindings::{
    fmi2Boolean, fmi2CallbackFunctions, fmi2Component, fmi2Real, fmi2Status, fmi2String, fmi2Type,
    fmi2Type_fmi2CoSimulation,
};
use crate::fmi::call_order::Function;
use crate::fmi::error::Error;
use crate::fmi::guid::Guid;
use crate::fmi::instance::Instance;
use crate::fmi::logging::{Category, Logger, from_callbacks};
use crate::fmi::lookup::{Interface, Registry};
use crate::fmi::model::Model;
use crate::fmi::resource_location;
use std::cell::UnsafeCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// fmi2GetTypesPlatform.
pub extern "C" fn get_types_platform() -> *const c_char {
    c"default".as_ptr()
}

/// fmi2GetVersion.
pub extern "C" fn get_version() -> *const c_char {
    c"2.0".as_ptr()
}

/// fmi2Instantiate; NULL, with a log line, when something is wrong.
///
/// # Safety
/// The strings are NULL or end in NUL; `functions` is NULL or valid, and its logger stays callable
/// until the instance is freed.
pub unsafe extern "C" fn instantiate<M: Model>(
    instance_name: fmi2String,
    fmu_type: fmi2Type,
    guid: fmi2String,
    resource_location: fmi2String,
    functions: *const fmi2CallbackFunctions,
    _visible: fmi2Boolean,
    logging_on: fmi2Boolean,
) -> fmi2Component {
    // SAFETY: as promised by the caller, for all four pointers.
    let (name, guid, location) = unsafe { (text(instance_name), text(guid), text(resource_location)) };
    let fallback = CString::new(M::IDENTIFIER).unwrap_or_default();
    let name = name.filter(|name| !name.is_empty()).unwrap_or(&fallback);
    // SAFETY: as promised by the caller.
    let mut logger = unsafe { from_callbacks(functions, name, logging_on != 0) };
    let made = catch_unwind(AssertUnwindSafe(|| load::<M>(fmu_type, guid, location)));
    let error = match made {
        Ok(Ok((model, registry, guid))) => {
            let name = name.to_string_lossy();
            let made = catch_unwind(AssertUnwindSafe(|| {
                Instance::from_parts(&name, model, registry, guid, Logger::silent())
            }));
            match made {
                Ok(mut instance) => {
                    *instance.logger() = logger;
                    let component =
                        Component { busy: AtomicBool::new(false), instance: UnsafeCell::new(instance) };
                    return Box::into_raw(Box::new(component)).cast();
                }
                Err(payload) => {
                    Error::Panic { function: Function::Instantiate, message: panic_message(payload) }
                }
            }
        }
        Ok(Err(error)) => error,
        Err(payload) => Error::Panic { function: Function::Instantiate, message: panic_message(payload) },
    };
    let written = catch_unwind(AssertUnwindSafe(|| logger.write(Category::Error, format_args!("{error}"))));
    if let Err(payload) = written {
        discard(payload);
    }
    std::ptr::null_mut()
}

/// # Safety
/// `pointer` is NULL or a string that ends in NUL and lives during `'a`.
pub(in crate::fmi) unsafe fn text<'a>(pointer: fmi2String) -> Option<&'a CStr> {
    // SAFETY: not NULL, else as promised by the caller.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
}

/// Checks the arguments, reads the model and recognises the interface by its GUID.
fn load<M: Model>(
    fmu_type: fmi2Type,
    given: Option<&CStr>,
    location: Option<&CStr>,
) -> Result<(M, Registry<M>, Guid), Error> {
    let function = Function::Instantiate;
    let null = |argument, expected| Error::Pointer { function, argument, found: "NULL", expected };
    let refused = |reason: String| Error::Load { function, reason };
    if fmu_type != fmi2Type_fmi2CoSimulation {
        let found = fmu_type.to_string();
        let expected = "1 (fmi2CoSimulation), the only type of this FMU".to_owned();
        return Err(Error::Argument { function, argument: "fmuType", found, expected });
    }
    let given = given.ok_or(null("fmuGUID", "the guid of modelDescription.xml"))?.to_string_lossy();
    let location = location.ok_or(null("fmuResourceLocation", "the URI of the unpacked resources folder"))?;
    let folder = resource_location::to_path(location.to_bytes()).map_err(refused)?;
    if !folder.is_dir() {
        let text = location.to_string_lossy();
        return Err(refused(format!(
            "fmuResourceLocation \"{text}\": {} is no readable folder",
            folder.display()
        )));
    }
    let model = M::load(&folder).map_err(Error::model(function))?;
    let mut registry =
        Registry::new(&model, Interface::Structured).map_err(|error| refused(error.to_string()))?;
    let structured = Guid::of(&registry, &model);
    let given = given.trim_start_matches('{').trim_end_matches('}');
    if given == structured.to_string() {
        return Ok((model, registry, structured));
    }
    registry.interface = Interface::Portable;
    let portable = Guid::of(&registry, &model);
    if given == portable.to_string() {
        return Ok((model, registry, portable));
    }
    Err(refused(format!(
        "fmuGUID is \"{given}\", but the resources in {} make it {structured} (portable: {portable}); expected \
         modelDescription.xml, shared library and resources of one export",
        folder.display()
    )))
}

/// fmi2FreeInstance; NULL is no error.
///
/// # Safety
/// `c` is NULL or comes from [`instantiate`] for the same `M` and has not been freed.
pub unsafe extern "C" fn free_instance<M: Model>(c: fmi2Component) {
    let pointer = c.cast::<Component<M>>();
    // SAFETY: as promised by the caller.
    let Some(component) = (unsafe { pointer.as_ref() }) else { return };
    // An instance freed from within its own call (a logger callback) is leaked, not pulled away.
    if component.busy.swap(true, Ordering::Acquire) {
        return;
    }
    // SAFETY: made by Box::into_raw in `instantiate`, freed only here, nobody else is using it.
    let owned = unsafe { Box::from_raw(pointer) };
    if let Err(payload) = catch_unwind(AssertUnwindSafe(|| drop(owned))) {
        discard(payload);
    }
}

/// fmi2SetDebugLogging.
///
/// # Safety
/// As [`free_instance`]; `categories` is NULL or has `n` strings, each NULL or ending in NUL.
pub unsafe extern "C" fn set_debug_logging<M: Model>(
    c: fmi2Component,
    logging_on: fmi2Boolean,
    n: usize,
    categories: *const fmi2String,
) -> fmi2Status {
    let function = Function::SetDebugLogging;
    let body = |instance: &mut Instance<M>| {
        // SAFETY: as promised by the caller.
        let names = unsafe { array(function, "categories", categories, n) }?;
        // SAFETY: as promised by the caller; a NULL counts as an unknown category.
        let names = names.iter().map(|name| unsafe { text(*name) }.unwrap_or(c"NULL"));
        instance.logger().set_debug_logging(logging_on != 0, names);
        Ok(())
    };
    // SAFETY: as promised by the caller.
    unsafe { enter(c, function, body) }
}

/// fmi2SetupExperiment.
///
/// # Safety
/// As [`free_instance`].
pub unsafe extern "C" fn setup_experiment<M: Model>(
    c: fmi2Component,
    _tolerance_defined: fmi2Boolean,
    _tolerance: fmi2Real,
    start_time: fmi2Real,
    stop_time_defined: fmi2Boolean,
    stop_time: fmi2Real,
) -> fmi2Status {
    let stop = (stop_time_defined != 0).then_some(stop_time);
    let body = |instance: &mut Instance<M>| instance.setup_experiment(start_time, stop);
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::SetupExperiment, body) }
}

/// fmi2EnterInitializationMode.
///
/// # Safety
/// As [`free_instance`].
pub unsafe extern "C" fn enter_initialization_mode<M: Model>(c: fmi2Component) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::EnterInitializationMode, Instance::<M>::enter_initialization_mode) }
}

/// fmi2ExitInitializationMode.
///
/// # Safety
/// As [`free_instance`].
pub unsafe extern "C" fn exit_initialization_mode<M: Model>(c: fmi2Component) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::ExitInitializationMode, Instance::<M>::exit_initialization_mode) }
}

/// fmi2Terminate.
///
/// # Safety
/// As [`free_instance`].
pub unsafe extern "C" fn terminate<M: Model>(c: fmi2Component) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::Terminate, Instance::<M>::terminate) }
}

/// fmi2Reset.
///
/// # Safety
/// As [`free_instance`].
pub unsafe extern "C" fn reset<M: Model>(c: fmi2Component) -> fmi2Status {
    // SAFETY: as promised by the caller.
    unsafe { enter(c, Function::Reset, Instance::<M>::reset) }
}

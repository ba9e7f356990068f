//! The smallest importer: the 34 symbols as C sees them, and a logger that remembers.
#![allow(dead_code, reason = "each test uses its part")]

use bess_consensus::fmi::bindings::*;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::null_mut;

macro_rules! symbols {
    ($(fn $name:ident($($type:ty),*) -> $result:ty;)*) => {
        unsafe extern "C" { $(#[allow(clashing_extern_declarations)] pub fn $name($(_: $type),*) -> $result;)* }
    };
}

symbols! {
    fn fmi2GetTypesPlatform() -> *const c_char;
    fn fmi2GetVersion() -> *const c_char;
    fn fmi2SetDebugLogging(fmi2Component, fmi2Boolean, usize, *const fmi2String) -> fmi2Status;
    fn fmi2Instantiate(
        fmi2String, fmi2Type, fmi2String, fmi2String, *const fmi2CallbackFunctions, fmi2Boolean, fmi2Boolean
    ) -> fmi2Component;
    fn fmi2FreeInstance(fmi2Component) -> ();
    fn fmi2SetupExperiment(fmi2Component, fmi2Boolean, f64, f64, fmi2Boolean, f64) -> fmi2Status;
    fn fmi2EnterInitializationMode(fmi2Component) -> fmi2Status;
    fn fmi2ExitInitializationMode(fmi2Component) -> fmi2Status;
    fn fmi2Terminate(fmi2Component) -> fmi2Status;
    fn fmi2Reset(fmi2Component) -> fmi2Status;
    fn fmi2GetReal(fmi2Component, *const u32, usize, *mut f64) -> fmi2Status;
    fn fmi2GetInteger(fmi2Component, *const u32, usize, *mut i32) -> fmi2Status;
    fn fmi2GetBoolean(fmi2Component, *const u32, usize, *mut fmi2Boolean) -> fmi2Status;
    fn fmi2GetString(fmi2Component, *const u32, usize, *mut fmi2String) -> fmi2Status;
    fn fmi2SetReal(fmi2Component, *const u32, usize, *const f64) -> fmi2Status;
    fn fmi2SetInteger(fmi2Component, *const u32, usize, *const i32) -> fmi2Status;
    fn fmi2SetBoolean(fmi2Component, *const u32, usize, *const fmi2Boolean) -> fmi2Status;
    fn fmi2SetString(fmi2Component, *const u32, usize, *const fmi2String) -> fmi2Status;
    fn fmi2GetFMUstate(fmi2Component, *mut fmi2FMUstate) -> fmi2Status;
    fn fmi2SetFMUstate(fmi2Component, fmi2FMUstate) -> fmi2Status;
    fn fmi2FreeFMUstate(fmi2Component, *mut fmi2FMUstate) -> fmi2Status;
    fn fmi2SerializedFMUstateSize(fmi2Component, fmi2FMUstate, *mut usize) -> fmi2Status;
    fn fmi2SerializeFMUstate(fmi2Component, fmi2FMUstate, *mut c_char, usize) -> fmi2Status;
    fn fmi2DeSerializeFMUstate(fmi2Component, *const c_char, usize, *mut fmi2FMUstate) -> fmi2Status;
    fn fmi2GetDirectionalDerivative(
        fmi2Component, *const u32, usize, *const u32, usize, *const f64, *mut f64
    ) -> fmi2Status;
    fn fmi2SetRealInputDerivatives(fmi2Component, *const u32, usize, *const i32, *const f64) -> fmi2Status;
    fn fmi2GetRealOutputDerivatives(fmi2Component, *const u32, usize, *const i32, *mut f64) -> fmi2Status;
    fn fmi2DoStep(fmi2Component, f64, f64, fmi2Boolean) -> fmi2Status;
    fn fmi2CancelStep(fmi2Component) -> fmi2Status;
    fn fmi2GetStatus(fmi2Component, fmi2StatusKind, *mut fmi2Status) -> fmi2Status;
    fn fmi2GetRealStatus(fmi2Component, fmi2StatusKind, *mut f64) -> fmi2Status;
    fn fmi2GetIntegerStatus(fmi2Component, fmi2StatusKind, *mut i32) -> fmi2Status;
    fn fmi2GetBooleanStatus(fmi2Component, fmi2StatusKind, *mut fmi2Boolean) -> fmi2Status;
    fn fmi2GetStringStatus(fmi2Component, fmi2StatusKind, *mut fmi2String) -> fmi2Status;
}

/// One call of the logger.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub instance: String,
    pub status: fmi2Status,
    pub category: String,
    pub format: String,
    pub text: String,
}

/// What the logger was told; its address is the componentEnvironment.
#[derive(Default)]
pub struct Record {
    pub lines: RefCell<Vec<Line>>,
    /// A component that the logger calls back into, against the standard.
    pub call_back: RefCell<Option<fmi2Component>>,
    pub call_back_status: RefCell<Option<fmi2Status>>,
}

unsafe fn string(text: *const c_char) -> String {
    assert!(!text.is_null());
    unsafe { CStr::from_ptr(text) }.to_str().expect("UTF-8").to_owned()
}

unsafe fn receive(
    environment: *mut c_void,
    name: *const c_char,
    status: fmi2Status,
    category: *const c_char,
    format: *const c_char,
    text: *const c_char,
) {
    let record = unsafe { &*environment.cast::<Record>() };
    let line = unsafe {
        Line {
            instance: string(name),
            status,
            category: string(category),
            format: string(format),
            text: string(text),
        }
    };
    record.lines.borrow_mut().push(line);
    if let Some(c) = *record.call_back.borrow() {
        let status = unsafe { fmi2GetReal(c, [1].as_ptr(), 1, [0.0].as_mut_ptr()) };
        unsafe { fmi2FreeInstance(c) };
        *record.call_back_status.borrow_mut() = Some(status);
    }
}

/// A logger with the one variadic argument that the FMU passes. Stable Rust cannot define a variadic
/// function; on x86-64 and aarch64 Linux this argument arrives where a fixed one would.
#[cfg(not(miri))]
unsafe extern "C" fn logger(
    environment: *mut c_void,
    name: *const c_char,
    status: fmi2Status,
    category: *const c_char,
    format: *const c_char,
    text: *const c_char,
) {
    unsafe { receive(environment, name, status, category, format, text) }
}

#[cfg(miri)]
unsafe extern "C" fn logger(
    environment: *mut c_void,
    name: *const c_char,
    status: fmi2Status,
    category: *const c_char,
    format: *const c_char,
    mut arguments: ...
) {
    let text = unsafe { arguments.next_arg::<*const c_char>() };
    unsafe { receive(environment, name, status, category, format, text) }
}

/// The callbacks of a full importer.
pub fn callbacks(record: &Record) -> fmi2CallbackFunctions {
    #[cfg(not(miri))]
    let logger: fmi2CallbackLogger =
        unsafe { std::mem::transmute::<*const c_void, fmi2CallbackLogger>(logger as *const c_void) };
    #[cfg(miri)]
    let logger: fmi2CallbackLogger = Some(logger);
    fmi2CallbackFunctions {
        logger,
        allocateMemory: None,
        freeMemory: None,
        stepFinished: None,
        componentEnvironment: std::ptr::from_ref(record).cast_mut().cast(),
    }
}

/// Instantiates with everything given.
pub fn instantiate(
    name: &str,
    guid: &str,
    location: &str,
    functions: *const fmi2CallbackFunctions,
    on: bool,
) -> fmi2Component {
    let [name, guid, location] = [name, guid, location].map(|text| CString::new(text).unwrap());
    unsafe {
        fmi2Instantiate(
            name.as_ptr(),
            fmi2Type_fmi2CoSimulation,
            guid.as_ptr(),
            location.as_ptr(),
            functions,
            0,
            i32::from(on),
        )
    }
}

/// Brings a component from instantiated to step mode.
pub fn start(c: fmi2Component) {
    unsafe {
        assert_eq!(fmi2SetupExperiment(c, 0, f64::NAN, 0.0, 0, f64::NAN), fmi2Status_fmi2OK);
        assert_eq!(fmi2EnterInitializationMode(c), fmi2Status_fmi2OK);
        assert_eq!(fmi2ExitInitializationMode(c), fmi2Status_fmi2OK);
    }
}

/// A C function by name and with its arguments but the component filled in.
pub type Call = (&'static str, fn(fmi2Component) -> fmi2Status);

/// Every function but instantiate, free and the two inquiries, with harmless arguments.
pub fn harmless_calls() -> Vec<Call> {
    macro_rules! calls {
        ($($name:ident($($argument:expr),*);)*) => {
            vec![$((stringify!($name), |c| unsafe { $name(c $(, $argument)*) })),*]
        };
    }
    calls! {
        fmi2SetDebugLogging(0, 0, null_mut());
        fmi2SetupExperiment(0, 0.0, 0.0, 0, 0.0);
        fmi2EnterInitializationMode();
        fmi2ExitInitializationMode();
        fmi2Terminate();
        fmi2Reset();
        fmi2GetReal(null_mut(), 0, null_mut());
        fmi2GetInteger(null_mut(), 0, null_mut());
        fmi2GetBoolean(null_mut(), 0, null_mut());
        fmi2GetString(null_mut(), 0, null_mut());
        fmi2SetReal(null_mut(), 0, null_mut());
        fmi2SetInteger(null_mut(), 0, null_mut());
        fmi2SetBoolean(null_mut(), 0, null_mut());
        fmi2SetString(null_mut(), 0, null_mut());
        fmi2GetFMUstate(null_mut());
        fmi2SetFMUstate(null_mut());
        fmi2FreeFMUstate(null_mut());
        fmi2SerializedFMUstateSize(null_mut(), null_mut());
        fmi2SerializeFMUstate(null_mut(), null_mut(), 0);
        fmi2DeSerializeFMUstate(null_mut(), 0, null_mut());
        fmi2GetDirectionalDerivative(null_mut(), 0, null_mut(), 0, null_mut(), null_mut());
        fmi2SetRealInputDerivatives(null_mut(), 0, null_mut(), null_mut());
        fmi2GetRealOutputDerivatives(null_mut(), 0, null_mut(), null_mut());
        fmi2DoStep(0.0, 0.1, 1);
        fmi2CancelStep();
        fmi2GetStatus(fmi2StatusKind_fmi2DoStepStatus, null_mut());
        fmi2GetRealStatus(fmi2StatusKind_fmi2LastSuccessfulTime, null_mut());
        fmi2GetIntegerStatus(fmi2StatusKind_fmi2DoStepStatus, null_mut());
        fmi2GetBooleanStatus(fmi2StatusKind_fmi2Terminated, null_mut());
        fmi2GetStringStatus(fmi2StatusKind_fmi2PendingStatus, null_mut());
    }
}

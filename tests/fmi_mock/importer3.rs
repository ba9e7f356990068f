//! The smallest importer of FMI 3.0: the 75 symbols as C sees them, and a logger that remembers.
#![allow(dead_code, reason = "each test uses its part")]

use bess_consensus::fmi::three::bindings::*;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::{null, null_mut};

macro_rules! symbols {
    ($(fn $name:ident($($type:ty),*) -> $result:ty;)*) => {
        unsafe extern "C" { $(#[allow(clashing_extern_declarations)] pub fn $name($(_: $type),*) -> $result;)* }
    };
}

type I = fmi3Instance;
type S = fmi3Status;
type Vr = *const u32;

symbols! {
    fn fmi3GetVersion() -> *const c_char;
    fn fmi3SetDebugLogging(I, bool, usize, *const fmi3String) -> S;
    fn fmi3InstantiateModelExchange(
        fmi3String, fmi3String, fmi3String, bool, bool, *mut c_void, fmi3LogMessageCallback
    ) -> I;
    fn fmi3InstantiateCoSimulation(
        fmi3String, fmi3String, fmi3String, bool, bool, bool, bool, Vr, usize, *mut c_void,
        fmi3LogMessageCallback, fmi3IntermediateUpdateCallback
    ) -> I;
    fn fmi3InstantiateScheduledExecution(
        fmi3String, fmi3String, fmi3String, bool, bool, *mut c_void, fmi3LogMessageCallback,
        fmi3ClockUpdateCallback, fmi3LockPreemptionCallback, fmi3UnlockPreemptionCallback
    ) -> I;
    fn fmi3FreeInstance(I) -> ();
    fn fmi3EnterInitializationMode(I, bool, f64, f64, bool, f64) -> S;
    fn fmi3ExitInitializationMode(I) -> S;
    fn fmi3EnterEventMode(I) -> S;
    fn fmi3Terminate(I) -> S;
    fn fmi3Reset(I) -> S;
    fn fmi3GetFloat32(I, Vr, usize, *mut f32, usize) -> S;
    fn fmi3GetFloat64(I, Vr, usize, *mut f64, usize) -> S;
    fn fmi3GetInt8(I, Vr, usize, *mut i8, usize) -> S;
    fn fmi3GetUInt8(I, Vr, usize, *mut u8, usize) -> S;
    fn fmi3GetInt16(I, Vr, usize, *mut i16, usize) -> S;
    fn fmi3GetUInt16(I, Vr, usize, *mut u16, usize) -> S;
    fn fmi3GetInt32(I, Vr, usize, *mut i32, usize) -> S;
    fn fmi3GetUInt32(I, Vr, usize, *mut u32, usize) -> S;
    fn fmi3GetInt64(I, Vr, usize, *mut i64, usize) -> S;
    fn fmi3GetUInt64(I, Vr, usize, *mut u64, usize) -> S;
    fn fmi3GetBoolean(I, Vr, usize, *mut u8, usize) -> S;
    fn fmi3GetString(I, Vr, usize, *mut fmi3String, usize) -> S;
    fn fmi3GetBinary(I, Vr, usize, *mut usize, *mut fmi3Binary, usize) -> S;
    fn fmi3GetClock(I, Vr, usize, *mut bool) -> S;
    fn fmi3SetFloat32(I, Vr, usize, *const f32, usize) -> S;
    fn fmi3SetFloat64(I, Vr, usize, *const f64, usize) -> S;
    fn fmi3SetInt8(I, Vr, usize, *const i8, usize) -> S;
    fn fmi3SetUInt8(I, Vr, usize, *const u8, usize) -> S;
    fn fmi3SetInt16(I, Vr, usize, *const i16, usize) -> S;
    fn fmi3SetUInt16(I, Vr, usize, *const u16, usize) -> S;
    fn fmi3SetInt32(I, Vr, usize, *const i32, usize) -> S;
    fn fmi3SetUInt32(I, Vr, usize, *const u32, usize) -> S;
    fn fmi3SetInt64(I, Vr, usize, *const i64, usize) -> S;
    fn fmi3SetUInt64(I, Vr, usize, *const u64, usize) -> S;
    fn fmi3SetBoolean(I, Vr, usize, *const u8, usize) -> S;
    fn fmi3SetString(I, Vr, usize, *const fmi3String, usize) -> S;
    fn fmi3SetBinary(I, Vr, usize, *const usize, *const fmi3Binary, usize) -> S;
    fn fmi3SetClock(I, Vr, usize, *const bool) -> S;
    fn fmi3GetNumberOfVariableDependencies(I, u32, *mut usize) -> S;
    fn fmi3GetVariableDependencies(I, u32, *mut usize, *mut u32, *mut usize, *mut fmi3DependencyKind, usize) -> S;
    fn fmi3GetFMUState(I, *mut fmi3FMUState) -> S;
    fn fmi3SetFMUState(I, fmi3FMUState) -> S;
    fn fmi3FreeFMUState(I, *mut fmi3FMUState) -> S;
    fn fmi3SerializedFMUStateSize(I, fmi3FMUState, *mut usize) -> S;
    fn fmi3SerializeFMUState(I, fmi3FMUState, *mut u8, usize) -> S;
    fn fmi3DeserializeFMUState(I, *const u8, usize, *mut fmi3FMUState) -> S;
    fn fmi3GetDirectionalDerivative(I, Vr, usize, Vr, usize, *const f64, usize, *mut f64, usize) -> S;
    fn fmi3GetAdjointDerivative(I, Vr, usize, Vr, usize, *const f64, usize, *mut f64, usize) -> S;
    fn fmi3EnterConfigurationMode(I) -> S;
    fn fmi3ExitConfigurationMode(I) -> S;
    fn fmi3GetIntervalDecimal(I, Vr, usize, *mut f64, *mut fmi3IntervalQualifier) -> S;
    fn fmi3GetIntervalFraction(I, Vr, usize, *mut u64, *mut u64, *mut fmi3IntervalQualifier) -> S;
    fn fmi3GetShiftDecimal(I, Vr, usize, *mut f64) -> S;
    fn fmi3GetShiftFraction(I, Vr, usize, *mut u64, *mut u64) -> S;
    fn fmi3SetIntervalDecimal(I, Vr, usize, *const f64) -> S;
    fn fmi3SetIntervalFraction(I, Vr, usize, *const u64, *const u64) -> S;
    fn fmi3SetShiftDecimal(I, Vr, usize, *const f64) -> S;
    fn fmi3SetShiftFraction(I, Vr, usize, *const u64, *const u64) -> S;
    fn fmi3EvaluateDiscreteStates(I) -> S;
    fn fmi3UpdateDiscreteStates(I, *mut bool, *mut bool, *mut bool, *mut bool, *mut bool, *mut f64) -> S;
    fn fmi3EnterContinuousTimeMode(I) -> S;
    fn fmi3CompletedIntegratorStep(I, bool, *mut bool, *mut bool) -> S;
    fn fmi3SetTime(I, f64) -> S;
    fn fmi3SetContinuousStates(I, *const f64, usize) -> S;
    fn fmi3GetContinuousStateDerivatives(I, *mut f64, usize) -> S;
    fn fmi3GetEventIndicators(I, *mut f64, usize) -> S;
    fn fmi3GetContinuousStates(I, *mut f64, usize) -> S;
    fn fmi3GetNominalsOfContinuousStates(I, *mut f64, usize) -> S;
    fn fmi3GetNumberOfEventIndicators(I, *mut usize) -> S;
    fn fmi3GetNumberOfContinuousStates(I, *mut usize) -> S;
    fn fmi3EnterStepMode(I) -> S;
    fn fmi3GetOutputDerivatives(I, Vr, usize, *const i32, *mut f64, usize) -> S;
    fn fmi3DoStep(I, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64) -> S;
    fn fmi3ActivateModelPartition(I, u32, f64) -> S;
}

/// One call of the logger.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub status: fmi3Status,
    pub category: String,
    pub text: String,
}

/// What the logger was told; its address is the instanceEnvironment.
#[derive(Default)]
pub struct Record {
    pub lines: RefCell<Vec<Line>>,
    /// An instance that the logger calls back into, against the standard.
    pub call_back: RefCell<Option<fmi3Instance>>,
    pub call_back_status: RefCell<Option<fmi3Status>>,
}

pub unsafe extern "C" fn log(
    environment: *mut c_void,
    status: fmi3Status,
    category: fmi3String,
    message: fmi3String,
) {
    let record = unsafe { &*environment.cast::<Record>() };
    let text = |pointer: fmi3String| unsafe { CStr::from_ptr(pointer) }.to_str().expect("UTF-8").to_owned();
    record.lines.borrow_mut().push(Line { status, category: text(category), text: text(message) });
    if let Some(c) = *record.call_back.borrow() {
        let status = unsafe { fmi3GetFloat64(c, [1].as_ptr(), 1, [0.0; 2].as_mut_ptr(), 2) };
        unsafe { fmi3FreeInstance(c) };
        *record.call_back_status.borrow_mut() = Some(status);
    }
}

pub fn instantiate(name: &str, token: &str, path: &str, record: &Record) -> fmi3Instance {
    instantiate_with(name, token, path, record, (false, 0))
}

/// The same with event mode used, and as many intermediate variables.
pub fn instantiate_with(
    name: &str,
    token: &str,
    path: &str,
    record: &Record,
    (event_mode, intermediate): (bool, usize),
) -> fmi3Instance {
    let c = |text: &str| CString::new(text).expect("no NUL");
    let (name, token, path) = (c(name), c(token), c(path));
    let environment = (&raw const *record).cast_mut().cast();
    unsafe {
        fmi3InstantiateCoSimulation(
            name.as_ptr(),
            token.as_ptr(),
            path.as_ptr(),
            false,
            true,
            event_mode,
            false,
            null(),
            intermediate,
            environment,
            Some(log),
            None,
        )
    }
}

macro_rules! calls {
    ($($name:ident($($argument:expr),*);)*) => {
        vec![$((stringify!($name), |c| unsafe { $name(c $(, $argument)*) })),*]
    };
}

/// A function with arguments of its own.
pub type Call = fn(fmi3Instance) -> fmi3Status;

/// Every function on an instance with arguments that ask for nothing: each can be called in any state without harm.
pub fn harmless_calls() -> Vec<(&'static str, Call)> {
    calls! {
        fmi3SetDebugLogging(true, 0, null());
        fmi3EnterInitializationMode(false, 0.0, 0.0, false, 0.0);
        fmi3ExitInitializationMode();
        fmi3EnterEventMode();
        fmi3Terminate();
        fmi3Reset();
        fmi3GetFloat32(null(), 0, null_mut(), 0);
        fmi3GetFloat64(null(), 0, null_mut(), 0);
        fmi3GetInt8(null(), 0, null_mut(), 0);
        fmi3GetUInt8(null(), 0, null_mut(), 0);
        fmi3GetInt16(null(), 0, null_mut(), 0);
        fmi3GetUInt16(null(), 0, null_mut(), 0);
        fmi3GetInt32(null(), 0, null_mut(), 0);
        fmi3GetUInt32(null(), 0, null_mut(), 0);
        fmi3GetInt64(null(), 0, null_mut(), 0);
        fmi3GetUInt64(null(), 0, null_mut(), 0);
        fmi3GetBoolean(null(), 0, null_mut(), 0);
        fmi3GetString(null(), 0, null_mut(), 0);
        fmi3GetBinary(null(), 0, null_mut(), null_mut(), 0);
        fmi3GetClock(null(), 0, null_mut());
        fmi3SetFloat32(null(), 0, null(), 0);
        fmi3SetFloat64(null(), 0, null(), 0);
        fmi3SetInt8(null(), 0, null(), 0);
        fmi3SetUInt8(null(), 0, null(), 0);
        fmi3SetInt16(null(), 0, null(), 0);
        fmi3SetUInt16(null(), 0, null(), 0);
        fmi3SetInt32(null(), 0, null(), 0);
        fmi3SetUInt32(null(), 0, null(), 0);
        fmi3SetInt64(null(), 0, null(), 0);
        fmi3SetUInt64(null(), 0, null(), 0);
        fmi3SetBoolean(null(), 0, null(), 0);
        fmi3SetString(null(), 0, null(), 0);
        fmi3SetBinary(null(), 0, null(), null(), 0);
        fmi3SetClock(null(), 0, null());
        fmi3GetNumberOfVariableDependencies(1, null_mut());
        fmi3GetVariableDependencies(1, null_mut(), null_mut(), null_mut(), null_mut(), 0);
        fmi3GetFMUState(null_mut());
        fmi3SetFMUState(null_mut());
        fmi3FreeFMUState(null_mut());
        fmi3SerializedFMUStateSize(null_mut(), null_mut());
        fmi3SerializeFMUState(null_mut(), null_mut(), 0);
        fmi3DeserializeFMUState(null(), 0, null_mut());
        fmi3GetDirectionalDerivative(null(), 0, null(), 0, null(), 0, null_mut(), 0);
        fmi3GetAdjointDerivative(null(), 0, null(), 0, null(), 0, null_mut(), 0);
        fmi3EnterConfigurationMode();
        fmi3ExitConfigurationMode();
        fmi3GetIntervalDecimal(null(), 0, null_mut(), null_mut());
        fmi3GetIntervalFraction(null(), 0, null_mut(), null_mut(), null_mut());
        fmi3GetShiftDecimal(null(), 0, null_mut());
        fmi3GetShiftFraction(null(), 0, null_mut(), null_mut());
        fmi3SetIntervalDecimal(null(), 0, null());
        fmi3SetIntervalFraction(null(), 0, null(), null());
        fmi3SetShiftDecimal(null(), 0, null());
        fmi3SetShiftFraction(null(), 0, null(), null());
        fmi3EvaluateDiscreteStates();
        fmi3UpdateDiscreteStates(null_mut(), null_mut(), null_mut(), null_mut(), null_mut(), null_mut());
        fmi3EnterContinuousTimeMode();
        fmi3CompletedIntegratorStep(true, null_mut(), null_mut());
        fmi3SetTime(0.0);
        fmi3SetContinuousStates(null(), 0);
        fmi3GetContinuousStateDerivatives(null_mut(), 0);
        fmi3GetEventIndicators(null_mut(), 0);
        fmi3GetContinuousStates(null_mut(), 0);
        fmi3GetNominalsOfContinuousStates(null_mut(), 0);
        fmi3GetNumberOfEventIndicators(null_mut());
        fmi3GetNumberOfContinuousStates(null_mut());
        fmi3EnterStepMode();
        fmi3GetOutputDerivatives(null(), 0, null(), null_mut(), 0);
        fmi3DoStep(0.0, 0.1, true, null_mut(), null_mut(), null_mut(), null_mut());
        fmi3ActivateModelPartition(0, 0.0);
    }
}

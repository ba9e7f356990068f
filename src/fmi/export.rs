//! The 34 symbols. A `no_mangle` function of a library vanishes from a shared library that does not
//! refer to it, hence a macro: the functions are defined in the cdylib itself.

/// Defines the 34 C functions of FMI 2.0 co-simulation for a [`Model`](crate::fmi::Model). To be used
/// once, in the root of a cdylib; each function is checked against the C typedef at compile time.
///
/// ```ignore
/// bess_consensus::export_fmi2!(MyModel);
/// ```
#[macro_export]
macro_rules! export_fmi2 {
    ($model:ty) => {
        $crate::export_fmi2! { @plain
            fmi2GetTypesPlatform: fmi2GetTypesPlatformTYPE = get_types_platform;
            fmi2GetVersion: fmi2GetVersionTYPE = get_version;
        }
        $crate::export_fmi2! { @generic $model;
            fmi2SetDebugLogging: fmi2SetDebugLoggingTYPE = set_debug_logging(
                c: fmi2Component, on: fmi2Boolean, n: usize, categories: *const fmi2String);
            fmi2SetupExperiment: fmi2SetupExperimentTYPE = setup_experiment(
                c: fmi2Component, tolerance_defined: fmi2Boolean, tolerance: fmi2Real,
                start: fmi2Real, stop_defined: fmi2Boolean, stop: fmi2Real);
            fmi2EnterInitializationMode: fmi2EnterInitializationModeTYPE =
                enter_initialization_mode(c: fmi2Component);
            fmi2ExitInitializationMode: fmi2ExitInitializationModeTYPE =
                exit_initialization_mode(c: fmi2Component);
            fmi2Terminate: fmi2TerminateTYPE = terminate(c: fmi2Component);
            fmi2Reset: fmi2ResetTYPE = reset(c: fmi2Component);
            fmi2GetReal: fmi2GetRealTYPE = get_real(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize, value: *mut fmi2Real);
            fmi2GetInteger: fmi2GetIntegerTYPE = get_integer(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize, value: *mut fmi2Integer);
            fmi2GetBoolean: fmi2GetBooleanTYPE = get_boolean(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize, value: *mut fmi2Boolean);
            fmi2GetString: fmi2GetStringTYPE = get_string(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize, value: *mut fmi2String);
            fmi2SetReal: fmi2SetRealTYPE = set_real(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize, value: *const fmi2Real);
            fmi2SetInteger: fmi2SetIntegerTYPE = set_integer(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize, value: *const fmi2Integer);
            fmi2SetBoolean: fmi2SetBooleanTYPE = set_boolean(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize, value: *const fmi2Boolean);
            fmi2SetString: fmi2SetStringTYPE = set_string(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize, value: *const fmi2String);
            fmi2GetFMUstate: fmi2GetFMUstateTYPE = get_fmu_state(c: fmi2Component, state: *mut fmi2FMUstate);
            fmi2SetFMUstate: fmi2SetFMUstateTYPE = set_fmu_state(c: fmi2Component, state: fmi2FMUstate);
            fmi2FreeFMUstate: fmi2FreeFMUstateTYPE = free_fmu_state(c: fmi2Component, state: *mut fmi2FMUstate);
            fmi2SerializedFMUstateSize: fmi2SerializedFMUstateSizeTYPE = serialized_fmu_state_size(
                c: fmi2Component, state: fmi2FMUstate, size: *mut usize);
            fmi2SerializeFMUstate: fmi2SerializeFMUstateTYPE = serialize_fmu_state(
                c: fmi2Component, state: fmi2FMUstate, bytes: *mut fmi2Byte, size: usize);
            fmi2DeSerializeFMUstate: fmi2DeSerializeFMUstateTYPE = deserialize_fmu_state(
                c: fmi2Component, bytes: *const fmi2Byte, size: usize, state: *mut fmi2FMUstate);
            fmi2GetDirectionalDerivative: fmi2GetDirectionalDerivativeTYPE = get_directional_derivative(
                c: fmi2Component, unknown: *const fmi2ValueReference, n_unknown: usize,
                known: *const fmi2ValueReference, n_known: usize,
                dv_known: *const fmi2Real, dv_unknown: *mut fmi2Real);
            fmi2SetRealInputDerivatives: fmi2SetRealInputDerivativesTYPE = set_real_input_derivatives(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize,
                order: *const fmi2Integer, value: *const fmi2Real);
            fmi2GetRealOutputDerivatives: fmi2GetRealOutputDerivativesTYPE = get_real_output_derivatives(
                c: fmi2Component, vr: *const fmi2ValueReference, nvr: usize,
                order: *const fmi2Integer, value: *mut fmi2Real);
            fmi2DoStep: fmi2DoStepTYPE = do_step(
                c: fmi2Component, point: fmi2Real, step: fmi2Real, no_rollback: fmi2Boolean);
            fmi2CancelStep: fmi2CancelStepTYPE = cancel_step(c: fmi2Component);
            fmi2GetStatus: fmi2GetStatusTYPE = get_status(
                c: fmi2Component, kind: fmi2StatusKind, value: *mut fmi2Status);
            fmi2GetRealStatus: fmi2GetRealStatusTYPE = get_real_status(
                c: fmi2Component, kind: fmi2StatusKind, value: *mut fmi2Real);
            fmi2GetIntegerStatus: fmi2GetIntegerStatusTYPE = get_integer_status(
                c: fmi2Component, kind: fmi2StatusKind, value: *mut fmi2Integer);
            fmi2GetBooleanStatus: fmi2GetBooleanStatusTYPE = get_boolean_status(
                c: fmi2Component, kind: fmi2StatusKind, value: *mut fmi2Boolean);
            fmi2GetStringStatus: fmi2GetStringStatusTYPE = get_string_status(
                c: fmi2Component, kind: fmi2StatusKind, value: *mut fmi2String);
        }
        $crate::export_fmi2! { @returning $model;
            fmi2Instantiate: fmi2InstantiateTYPE = instantiate(
                name: fmi2String, kind: fmi2Type, guid: fmi2String, location: fmi2String,
                functions: *const fmi2CallbackFunctions, visible: fmi2Boolean, on: fmi2Boolean)
                -> fmi2Component;
            fmi2FreeInstance: fmi2FreeInstanceTYPE = free_instance(c: fmi2Component) -> ();
        }
    };
    (@plain $($name:ident: $type:ident = $function:ident;)*) => { $(
        const _: $crate::fmi::bindings::$type = {
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name() -> *const ::std::ffi::c_char {
                $crate::fmi::shell::$function()
            }
            Some($name)
        };
    )* };
    (@generic $model:ty; $($name:ident: $type:ident = $function:ident($($argument:ident: $kind:ty),*);)*) => {
        $crate::export_fmi2! { @returning $model;
            $($name: $type = $function($($argument: $kind),*) -> fmi2Status;)* }
    };
    (@returning $model:ty;
        $($name:ident: $type:ident = $function:ident($($argument:ident: $kind:ty),*) -> $result:ty;)*
    ) => { $(
        const _: $crate::fmi::bindings::$type = {
            #[allow(unused_imports)]
            use $crate::fmi::bindings::*;

            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name($($argument: $kind),*) -> $result {
                // SAFETY: the importer keeps the promises of FMI 2.0, which are those of the callee.
                unsafe { $crate::fmi::shell::$function::<$model>($($argument),*) }
            }
            Some($name)
        };
    )* };
}

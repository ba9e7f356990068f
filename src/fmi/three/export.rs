//! The 75 symbols of FMI 3.0. A `no_mangle` function of a library vanishes from a shared library that does not refer to
//! it, hence a macro: the functions are defined in the cdylib itself, beside those of `export_fmi2!`.

/// Defines the 75 C functions of FMI 3.0 for a [`Model`](crate::fmi::Model). To be used once, in the root of a cdylib;
/// each function is checked against the C typedef at compile time.
///
/// ```ignore
/// bess_consensus::export_fmi3!(MyModel);
/// ```
#[macro_export]
macro_rules! export_fmi3 {
    ($model:ty) => {
        const _: $crate::fmi::three::bindings::fmi3GetVersionTYPE = {
            #[unsafe(no_mangle)]
            unsafe extern "C" fn fmi3GetVersion() -> *const ::std::ffi::c_char {
                $crate::fmi::three::shell::get_version()
            }
            Some(fmi3GetVersion)
        };
        // What does the work.
        $crate::export_fmi3! { @own $model;
            fmi3SetDebugLogging: fmi3SetDebugLoggingTYPE = set_debug_logging(
                instance: fmi3Instance, logging_on: fmi3Boolean, n_categories: usize,
                categories: *const fmi3String) -> fmi3Status;
            fmi3InstantiateCoSimulation: fmi3InstantiateCoSimulationTYPE = instantiate_co_simulation(
                instance_name: fmi3String, instantiation_token: fmi3String, resource_path: fmi3String,
                visible: fmi3Boolean, logging_on: fmi3Boolean, event_mode_used: fmi3Boolean,
                early_return_allowed: fmi3Boolean,
                required_intermediate_variables: *const fmi3ValueReference,
                n_required_intermediate_variables: usize, instance_environment: fmi3InstanceEnvironment,
                log_message: fmi3LogMessageCallback,
                intermediate_update: fmi3IntermediateUpdateCallback) -> fmi3Instance;
            fmi3FreeInstance: fmi3FreeInstanceTYPE = free_instance(instance: fmi3Instance) -> ();
            fmi3EnterInitializationMode: fmi3EnterInitializationModeTYPE = enter_initialization_mode(
                instance: fmi3Instance, tolerance_defined: fmi3Boolean, tolerance: fmi3Float64,
                start_time: fmi3Float64, stop_time_defined: fmi3Boolean,
                stop_time: fmi3Float64) -> fmi3Status;
            fmi3ExitInitializationMode: fmi3ExitInitializationModeTYPE = exit_initialization_mode(
                instance: fmi3Instance) -> fmi3Status;
            fmi3Terminate: fmi3TerminateTYPE = terminate(instance: fmi3Instance) -> fmi3Status;
            fmi3Reset: fmi3ResetTYPE = reset(instance: fmi3Instance) -> fmi3Status;
            fmi3GetFloat64: fmi3GetFloat64TYPE = get_float64(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Float64,
                n_values: usize) -> fmi3Status;
            fmi3GetInt32: fmi3GetInt32TYPE = get_int32(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Int32,
                n_values: usize) -> fmi3Status;
            fmi3GetUInt64: fmi3GetUInt64TYPE = get_uint64(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3UInt64,
                n_values: usize) -> fmi3Status;
            fmi3GetBoolean: fmi3GetBooleanTYPE = get_boolean(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Boolean,
                n_values: usize) -> fmi3Status;
            fmi3SetFloat64: fmi3SetFloat64TYPE = set_float64(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize,
                values: *const fmi3Float64, n_values: usize) -> fmi3Status;
            fmi3SetInt32: fmi3SetInt32TYPE = set_int32(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3Int32,
                n_values: usize) -> fmi3Status;
            fmi3SetUInt64: fmi3SetUInt64TYPE = set_uint64(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3UInt64,
                n_values: usize) -> fmi3Status;
            fmi3SetBoolean: fmi3SetBooleanTYPE = set_boolean(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize,
                values: *const fmi3Boolean, n_values: usize) -> fmi3Status;
            fmi3GetNumberOfVariableDependencies: fmi3GetNumberOfVariableDependenciesTYPE = get_number_of_variable_dependencies(
                instance: fmi3Instance, value_reference: fmi3ValueReference,
                n_dependencies: *mut usize) -> fmi3Status;
            fmi3GetVariableDependencies: fmi3GetVariableDependenciesTYPE = get_variable_dependencies(
                instance: fmi3Instance, dependent: fmi3ValueReference,
                element_indices_of_dependent: *mut usize, independents: *mut fmi3ValueReference,
                element_indices_of_independents: *mut usize, dependency_kinds: *mut fmi3DependencyKind,
                n_dependencies: usize) -> fmi3Status;
            fmi3GetFMUState: fmi3GetFMUStateTYPE = get_fmu_state(
                instance: fmi3Instance, state: *mut fmi3FMUState) -> fmi3Status;
            fmi3SetFMUState: fmi3SetFMUStateTYPE = set_fmu_state(
                instance: fmi3Instance, state: fmi3FMUState) -> fmi3Status;
            fmi3FreeFMUState: fmi3FreeFMUStateTYPE = free_fmu_state(
                instance: fmi3Instance, state: *mut fmi3FMUState) -> fmi3Status;
            fmi3SerializedFMUStateSize: fmi3SerializedFMUStateSizeTYPE = serialized_fmu_state_size(
                instance: fmi3Instance, state: fmi3FMUState, size: *mut usize) -> fmi3Status;
            fmi3SerializeFMUState: fmi3SerializeFMUStateTYPE = serialize_fmu_state(
                instance: fmi3Instance, state: fmi3FMUState, serialized_state: *mut fmi3Byte,
                size: usize) -> fmi3Status;
            fmi3DeserializeFMUState: fmi3DeserializeFMUStateTYPE = deserialize_fmu_state(
                instance: fmi3Instance, serialized_state: *const fmi3Byte, size: usize,
                state: *mut fmi3FMUState) -> fmi3Status;
            fmi3GetDirectionalDerivative: fmi3GetDirectionalDerivativeTYPE = get_directional_derivative(
                instance: fmi3Instance, unknowns: *const fmi3ValueReference, n_unknowns: usize,
                knowns: *const fmi3ValueReference, n_knowns: usize, seed: *const fmi3Float64,
                n_seed: usize, sensitivity: *mut fmi3Float64, n_sensitivity: usize) -> fmi3Status;
            fmi3EnterConfigurationMode: fmi3EnterConfigurationModeTYPE = enter_configuration_mode(
                instance: fmi3Instance) -> fmi3Status;
            fmi3ExitConfigurationMode: fmi3ExitConfigurationModeTYPE = exit_configuration_mode(
                instance: fmi3Instance) -> fmi3Status;
            fmi3GetOutputDerivatives: fmi3GetOutputDerivativesTYPE = get_output_derivatives(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, orders: *const fmi3Int32,
                values: *mut fmi3Float64, n_values: usize) -> fmi3Status;
            fmi3DoStep: fmi3DoStepTYPE = do_step(
                instance: fmi3Instance, current_communication_point: fmi3Float64,
                communication_step_size: fmi3Float64, no_set_state_prior_to_current_point: fmi3Boolean,
                event_handling_needed: *mut fmi3Boolean, terminate_simulation: *mut fmi3Boolean,
                early_return: *mut fmi3Boolean, last_successful_time: *mut fmi3Float64) -> fmi3Status;
        }
        // Types that no variable has.
        $crate::export_fmi3! { @through no_such_type_of $model;
            fmi3GetFloat32: fmi3GetFloat32TYPE = GetFloat32(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Float32,
                n_values: usize);
            fmi3GetInt8: fmi3GetInt8TYPE = GetInt8(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Int8,
                n_values: usize);
            fmi3GetUInt8: fmi3GetUInt8TYPE = GetUInt8(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3UInt8,
                n_values: usize);
            fmi3GetInt16: fmi3GetInt16TYPE = GetInt16(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Int16,
                n_values: usize);
            fmi3GetUInt16: fmi3GetUInt16TYPE = GetUInt16(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3UInt16,
                n_values: usize);
            fmi3GetUInt32: fmi3GetUInt32TYPE = GetUInt32(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3UInt32,
                n_values: usize);
            fmi3GetInt64: fmi3GetInt64TYPE = GetInt64(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Int64,
                n_values: usize);
            fmi3GetString: fmi3GetStringTYPE = GetString(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3String,
                n_values: usize);
            fmi3GetBinary: fmi3GetBinaryTYPE = GetBinary(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, value_sizes: *mut usize,
                values: *mut fmi3Binary, n_values: usize);
            fmi3GetClock: fmi3GetClockTYPE = GetClock(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Clock);
            fmi3SetFloat32: fmi3SetFloat32TYPE = SetFloat32(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize,
                values: *const fmi3Float32, n_values: usize);
            fmi3SetInt8: fmi3SetInt8TYPE = SetInt8(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3Int8,
                n_values: usize);
            fmi3SetUInt8: fmi3SetUInt8TYPE = SetUInt8(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3UInt8,
                n_values: usize);
            fmi3SetInt16: fmi3SetInt16TYPE = SetInt16(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3Int16,
                n_values: usize);
            fmi3SetUInt16: fmi3SetUInt16TYPE = SetUInt16(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3UInt16,
                n_values: usize);
            fmi3SetUInt32: fmi3SetUInt32TYPE = SetUInt32(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3UInt32,
                n_values: usize);
            fmi3SetInt64: fmi3SetInt64TYPE = SetInt64(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3Int64,
                n_values: usize);
            fmi3SetString: fmi3SetStringTYPE = SetString(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3String,
                n_values: usize);
            fmi3SetBinary: fmi3SetBinaryTYPE = SetBinary(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, value_sizes: *const usize,
                values: *const fmi3Binary, n_values: usize);
            fmi3SetClock: fmi3SetClockTYPE = SetClock(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, values: *const fmi3Clock);
        }
        // What this FMU has no use for.
        $crate::export_fmi3! { @through absent_of $model;
            fmi3EnterEventMode: fmi3EnterEventModeTYPE = EnterEventMode(instance: fmi3Instance);
            fmi3GetAdjointDerivative: fmi3GetAdjointDerivativeTYPE = GetAdjointDerivative(
                instance: fmi3Instance, unknowns: *const fmi3ValueReference, n_unknowns: usize,
                knowns: *const fmi3ValueReference, n_knowns: usize, seed: *const fmi3Float64,
                n_seed: usize, sensitivity: *mut fmi3Float64, n_sensitivity: usize);
            fmi3GetIntervalDecimal: fmi3GetIntervalDecimalTYPE = GetIntervalDecimal(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize,
                intervals: *mut fmi3Float64, qualifiers: *mut fmi3IntervalQualifier);
            fmi3GetIntervalFraction: fmi3GetIntervalFractionTYPE = GetIntervalFraction(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, counters: *mut fmi3UInt64,
                resolutions: *mut fmi3UInt64, qualifiers: *mut fmi3IntervalQualifier);
            fmi3GetShiftDecimal: fmi3GetShiftDecimalTYPE = GetShiftDecimal(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, shifts: *mut fmi3Float64);
            fmi3GetShiftFraction: fmi3GetShiftFractionTYPE = GetShiftFraction(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize, counters: *mut fmi3UInt64,
                resolutions: *mut fmi3UInt64);
            fmi3SetIntervalDecimal: fmi3SetIntervalDecimalTYPE = SetIntervalDecimal(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize,
                intervals: *const fmi3Float64);
            fmi3SetIntervalFraction: fmi3SetIntervalFractionTYPE = SetIntervalFraction(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize,
                counters: *const fmi3UInt64, resolutions: *const fmi3UInt64);
            fmi3SetShiftDecimal: fmi3SetShiftDecimalTYPE = SetShiftDecimal(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize,
                shifts: *const fmi3Float64);
            fmi3SetShiftFraction: fmi3SetShiftFractionTYPE = SetShiftFraction(
                instance: fmi3Instance, vr: *const fmi3ValueReference, n: usize,
                counters: *const fmi3UInt64, resolutions: *const fmi3UInt64);
            fmi3EvaluateDiscreteStates: fmi3EvaluateDiscreteStatesTYPE = EvaluateDiscreteStates(
                instance: fmi3Instance);
            fmi3UpdateDiscreteStates: fmi3UpdateDiscreteStatesTYPE = UpdateDiscreteStates(
                instance: fmi3Instance, discrete_states_need_update: *mut fmi3Boolean,
                terminate_simulation: *mut fmi3Boolean,
                nominals_of_continuous_states_changed: *mut fmi3Boolean,
                values_of_continuous_states_changed: *mut fmi3Boolean,
                next_event_time_defined: *mut fmi3Boolean, next_event_time: *mut fmi3Float64);
            fmi3EnterContinuousTimeMode: fmi3EnterContinuousTimeModeTYPE = EnterContinuousTimeMode(
                instance: fmi3Instance);
            fmi3CompletedIntegratorStep: fmi3CompletedIntegratorStepTYPE = CompletedIntegratorStep(
                instance: fmi3Instance, no_set_state_prior_to_current_point: fmi3Boolean,
                enter_event_mode: *mut fmi3Boolean, terminate_simulation: *mut fmi3Boolean);
            fmi3SetTime: fmi3SetTimeTYPE = SetTime(instance: fmi3Instance, time: fmi3Float64);
            fmi3SetContinuousStates: fmi3SetContinuousStatesTYPE = SetContinuousStates(
                instance: fmi3Instance, continuous_states: *const fmi3Float64, n_continuous_states: usize);
            fmi3GetContinuousStateDerivatives: fmi3GetContinuousStateDerivativesTYPE = GetContinuousStateDerivatives(
                instance: fmi3Instance, derivatives: *mut fmi3Float64, n_continuous_states: usize);
            fmi3GetEventIndicators: fmi3GetEventIndicatorsTYPE = GetEventIndicators(
                instance: fmi3Instance, event_indicators: *mut fmi3Float64, n_event_indicators: usize);
            fmi3GetContinuousStates: fmi3GetContinuousStatesTYPE = GetContinuousStates(
                instance: fmi3Instance, continuous_states: *mut fmi3Float64, n_continuous_states: usize);
            fmi3GetNominalsOfContinuousStates: fmi3GetNominalsOfContinuousStatesTYPE = GetNominalsOfContinuousStates(
                instance: fmi3Instance, nominals: *mut fmi3Float64, n_continuous_states: usize);
            fmi3GetNumberOfEventIndicators: fmi3GetNumberOfEventIndicatorsTYPE = GetNumberOfEventIndicators(
                instance: fmi3Instance, n_event_indicators: *mut usize);
            fmi3GetNumberOfContinuousStates: fmi3GetNumberOfContinuousStatesTYPE = GetNumberOfContinuousStates(
                instance: fmi3Instance, n_continuous_states: *mut usize);
            fmi3EnterStepMode: fmi3EnterStepModeTYPE = EnterStepMode(instance: fmi3Instance);
            fmi3ActivateModelPartition: fmi3ActivateModelPartitionTYPE = ActivateModelPartition(
                instance: fmi3Instance, clock_reference: fmi3ValueReference, activation_time: fmi3Float64);
        }
        $crate::export_fmi3! { @interface
            fmi3InstantiateModelExchange: fmi3InstantiateModelExchangeTYPE = InstantiateModelExchange();
            fmi3InstantiateScheduledExecution: fmi3InstantiateScheduledExecutionTYPE =
                InstantiateScheduledExecution(
                    clock: fmi3ClockUpdateCallback, lock: fmi3LockPreemptionCallback,
                    unlock: fmi3UnlockPreemptionCallback);
        }
    };
    (@own $model:ty;
        $($name:ident: $type:ident = $function:ident($($argument:ident: $kind:ty),*) -> $result:ty;)*
    ) => { $(
        const _: $crate::fmi::three::bindings::$type = {
            #[allow(unused_imports)]
            use $crate::fmi::three::bindings::*;

            #[unsafe(no_mangle)]
            #[allow(clippy::too_many_arguments, reason = "the standard's signature")]
            unsafe extern "C" fn $name($($argument: $kind),*) -> $result {
                // SAFETY: the importer keeps the promises of FMI 3.0, which are those of the callee.
                unsafe { $crate::fmi::three::shell::$function::<$model>($($argument),*) }
            }
            Some($name)
        };
    )* };
    (@through $through:ident $model:ty;
        $($name:ident: $type:ident = $function:ident(
            $first:ident: $first_kind:ty $(, $argument:ident: $kind:ty)*);)*
    ) => { $(
        const _: $crate::fmi::three::bindings::$type = {
            #[allow(unused_imports)]
            use $crate::fmi::three::bindings::*;

            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name($first: $first_kind $(, $argument: $kind)*) -> fmi3Status {
                let function = $crate::fmi::three::Function::$function;
                let all = ($first $(, $argument)*,);
                // SAFETY: the importer keeps the promises of FMI 3.0, which are those of the callee.
                unsafe { $crate::export_fmi3!(@$through $model, function, all) }
            }
            Some($name)
        };
    )* };
    (@absent_of $model:ty, $function:ident, $all:ident) => {
        $crate::fmi::three::shell::absent::<$model>($all.0, $function)
    };
    (@no_such_type_of $model:ty, $function:ident, $all:ident) => {
        $crate::fmi::three::shell::no_such_type::<$model>($all.0, $function, $all.1, $all.2)
    };
    (@interface $($name:ident: $type:ident = $function:ident($($argument:ident: $kind:ty),*);)*) => { $(
        const _: $crate::fmi::three::bindings::$type = {
            #[allow(unused_imports)]
            use $crate::fmi::three::bindings::*;

            #[unsafe(no_mangle)]
            #[allow(clippy::too_many_arguments, reason = "the standard's signature")]
            unsafe extern "C" fn $name(
                _name: fmi3String,
                _token: fmi3String,
                _path: fmi3String,
                _visible: fmi3Boolean,
                _logging: fmi3Boolean,
                environment: fmi3InstanceEnvironment,
                log: fmi3LogMessageCallback
                $(, $argument: $kind)*
            ) -> fmi3Instance {
                let function = $crate::fmi::three::Function::$function;
                let _ = ($($argument,)*);
                // SAFETY: the importer's logger, if any, is callable.
                unsafe { $crate::fmi::three::shell::no_such_interface(function, environment, log) }
            }
            Some($name)
        };
    )* };
}

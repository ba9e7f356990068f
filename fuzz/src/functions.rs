//! The 34 functions of one FMU as C sees them: those of a model linked into this program, or of a shared library.
//! Never called with what C cannot express.

use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Model, shell};
use libloading::Library;
use std::path::Path;

/// The function inside one of the C headers' `Option<fn>` types.
pub trait Inner {
    /// The plain function pointer.
    type Function;
}

impl<F> Inner for Option<F> {
    type Function = F;
}

macro_rules! functions {
    (plain { $($plain:ident = $plain_name:literal: $plain_type:ty;)* }
     generic { $($field:ident = $name:literal: $type:ty;)* }) => {
        /// The 34 functions, each under the name of the chapter it comes from.
        #[allow(missing_docs)]
        pub struct Functions {
            $(pub $plain: <$plain_type as Inner>::Function,)*
            $(pub $field: <$type as Inner>::Function,)*
            /// Keeps the code of a shared library in memory.
            _library: Option<Library>,
        }

        impl Functions {
            /// Those behind the exported symbols of a model's library, without the library.
            pub fn of<M: Model>() -> Self {
                Self {
                    $($plain: shell::$plain,)*
                    $($field: shell::$field::<M>,)*
                    _library: None,
                }
            }

            /// Those of a shared library; the error names the file, or the first function that it lacks.
            pub fn load(path: &Path) -> Result<Self, String> {
                // SAFETY: the library is one that this workspace has built; its constructors do nothing.
                let library = unsafe { Library::new(path) }.map_err(|e| format!("{}: {e}", path.display()))?;
                let missing = |name: &str| format!("{}: no function {name}", path.display());
                Ok(Self {
                    // SAFETY: the C headers give each function this type.
                    $($plain: unsafe { library.get::<$plain_type>($plain_name.as_bytes()) }
                        .ok().and_then(|symbol| *symbol).ok_or_else(|| missing($plain_name))?,)*
                    // SAFETY: as above.
                    $($field: unsafe { library.get::<$type>($name.as_bytes()) }
                        .ok().and_then(|symbol| *symbol).ok_or_else(|| missing($name))?,)*
                    _library: Some(library),
                })
            }
        }
    };
}

functions! {
    plain {
        get_types_platform = "fmi2GetTypesPlatform": fmi2GetTypesPlatformTYPE;
        get_version = "fmi2GetVersion": fmi2GetVersionTYPE;
    }
    generic {
        set_debug_logging = "fmi2SetDebugLogging": fmi2SetDebugLoggingTYPE;
        instantiate = "fmi2Instantiate": fmi2InstantiateTYPE;
        free_instance = "fmi2FreeInstance": fmi2FreeInstanceTYPE;
        setup_experiment = "fmi2SetupExperiment": fmi2SetupExperimentTYPE;
        enter_initialization_mode = "fmi2EnterInitializationMode": fmi2EnterInitializationModeTYPE;
        exit_initialization_mode = "fmi2ExitInitializationMode": fmi2ExitInitializationModeTYPE;
        terminate = "fmi2Terminate": fmi2TerminateTYPE;
        reset = "fmi2Reset": fmi2ResetTYPE;
        get_real = "fmi2GetReal": fmi2GetRealTYPE;
        get_integer = "fmi2GetInteger": fmi2GetIntegerTYPE;
        get_boolean = "fmi2GetBoolean": fmi2GetBooleanTYPE;
        get_string = "fmi2GetString": fmi2GetStringTYPE;
        set_real = "fmi2SetReal": fmi2SetRealTYPE;
        set_integer = "fmi2SetInteger": fmi2SetIntegerTYPE;
        set_boolean = "fmi2SetBoolean": fmi2SetBooleanTYPE;
        set_string = "fmi2SetString": fmi2SetStringTYPE;
        get_fmu_state = "fmi2GetFMUstate": fmi2GetFMUstateTYPE;
        set_fmu_state = "fmi2SetFMUstate": fmi2SetFMUstateTYPE;
        free_fmu_state = "fmi2FreeFMUstate": fmi2FreeFMUstateTYPE;
        serialized_fmu_state_size = "fmi2SerializedFMUstateSize": fmi2SerializedFMUstateSizeTYPE;
        serialize_fmu_state = "fmi2SerializeFMUstate": fmi2SerializeFMUstateTYPE;
        deserialize_fmu_state = "fmi2DeSerializeFMUstate": fmi2DeSerializeFMUstateTYPE;
        get_directional_derivative = "fmi2GetDirectionalDerivative": fmi2GetDirectionalDerivativeTYPE;
        set_real_input_derivatives = "fmi2SetRealInputDerivatives": fmi2SetRealInputDerivativesTYPE;
        get_real_output_derivatives = "fmi2GetRealOutputDerivatives": fmi2GetRealOutputDerivativesTYPE;
        do_step = "fmi2DoStep": fmi2DoStepTYPE;
        cancel_step = "fmi2CancelStep": fmi2CancelStepTYPE;
        get_status = "fmi2GetStatus": fmi2GetStatusTYPE;
        get_real_status = "fmi2GetRealStatus": fmi2GetRealStatusTYPE;
        get_integer_status = "fmi2GetIntegerStatus": fmi2GetIntegerStatusTYPE;
        get_boolean_status = "fmi2GetBooleanStatus": fmi2GetBooleanStatusTYPE;
        get_string_status = "fmi2GetStringStatus": fmi2GetStringStatusTYPE;
    }
}

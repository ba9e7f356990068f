//! The shared library of an FMU: found, loaded, all functions resolved at once, so that nothing is
//! missing in the middle of a run. Never calls one of them but the two that name the version.

use super::binary;
use super::description::ModelDescription;
use crate::fmi::bindings::*;
use libloading::Library;
use std::ffi::CStr;
use std::path::{Path, PathBuf};

/// The folders of `binaries/` that suit this machine, and the extension of a library on it.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
const PLATFORM: (&[&str], &str) = (&["linux64"], "so");
#[cfg(all(target_os = "linux", target_arch = "aarch64"))]
const PLATFORM: (&[&str], &str) = (&["aarch64-linux", "linux-aarch64"], "so");
#[cfg(all(target_os = "windows", target_arch = "x86_64"))]
const PLATFORM: (&[&str], &str) = (&["win64"], "dll");
#[cfg(target_os = "macos")]
const PLATFORM: (&[&str], &str) = (&["darwin64"], "dylib");
#[cfg(not(any(
    all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")),
    all(target_os = "windows", target_arch = "x86_64"),
    target_os = "macos"
)))]
const PLATFORM: (&[&str], &str) = (&[], "so");

/// The function inside one of the C headers' `Option<fn>` types.
pub(super) trait Inner {
    type Function;
}

impl<F> Inner for Option<F> {
    type Function = F;
}

macro_rules! functions {
    ($($field:ident = $name:literal: $type:ty;)*) => {
        /// The 34 functions of FMI 2.0 co-simulation; valid as long as the library is loaded.
        pub(super) struct Functions {
            $(#[allow(dead_code)] pub $field: <$type as Inner>::Function,)*
        }

        impl Functions {
            /// All functions, or the names of those that are not there.
            fn resolve(library: &Library) -> Result<Self, Vec<&'static str>> {
                // SAFETY: the C headers give each function this type; a library that exports
                // something else under the name breaks FMI, which no loader can detect.
                $(let $field = unsafe { library.get::<$type>(concat!($name, "\0").as_bytes()) }
                    .ok()
                    .and_then(|symbol| *symbol);)*
                let mut missing = Vec::new();
                $(if $field.is_none() { missing.push($name); })*
                match ($($field,)*) {
                    ($(Some($field),)*) => Ok(Self { $($field),* }),
                    _ => Err(missing),
                }
            }
        }
    };
}

functions! {
    get_types_platform = "fmi2GetTypesPlatform": fmi2GetTypesPlatformTYPE;
    get_version = "fmi2GetVersion": fmi2GetVersionTYPE;
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

/// A loaded library with its functions. The functions must not outlive it.
pub struct LoadedLibrary {
    pub(super) functions: Functions,
    _library: Library,
}

/// Why a library could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// No binary for this machine.
    #[error(
        "{model}: no binary for this machine: {} is not there; the FMU holds {held}. Export it again \
         for this platform, or use a machine of that one", expected.display()
    )]
    NoBinary {
        /// Model identifier.
        model: String,
        /// Where it should be, within the FMU.
        expected: PathBuf,
        /// The platforms that are there.
        held: String,
    },

    /// A file under the right name that this machine cannot load.
    #[error("{}: is {found}; expected {expected}", path.display())]
    Foreign {
        /// The library.
        path: PathBuf,
        /// What it is.
        found: String,
        /// What it should be.
        expected: &'static str,
    },

    /// The system's loader refused.
    #[error("{}: cannot be loaded ({reason})", path.display())]
    Load {
        /// The library.
        path: PathBuf,
        /// What the loader says.
        reason: String,
    },

    /// Functions of the standard are missing.
    #[error("{}: misses {}; expected all 34 functions of FMI 2.0 co-simulation", path.display(), missing.join(", "))]
    Missing {
        /// The library.
        path: PathBuf,
        /// Their names.
        missing: Vec<&'static str>,
    },

    /// Another version or another set of C types.
    #[error("{}: {function} says \"{found}\"; expected \"{expected}\"", path.display())]
    Version {
        /// The library.
        path: PathBuf,
        /// Which function.
        function: &'static str,
        /// Its answer.
        found: String,
        /// The right one.
        expected: &'static str,
    },
}

impl LoadedLibrary {
    /// Loads the library of an FMU unpacked at `folder`. Loading runs code of the FMU.
    pub fn load(folder: &Path, description: &ModelDescription) -> Result<Self, LibraryError> {
        let path = find(folder, &description.model_identifier)?;
        check(&path)?;
        let library =
            open(&path).map_err(|error| LibraryError::Load { path: path.clone(), reason: reason(&error) })?;
        let functions = Functions::resolve(&library)
            .map_err(|missing| LibraryError::Missing { path: path.clone(), missing })?;
        // SAFETY: both take nothing and return a static string or NULL.
        let (version, types) =
            unsafe { (text((functions.get_version)()), text((functions.get_types_platform)())) };
        for (function, found, expected) in
            [("fmi2GetVersion", version, "2.0"), ("fmi2GetTypesPlatform", types, "default")]
        {
            if found != expected {
                return Err(LibraryError::Version { path, function, found, expected });
            }
        }
        Ok(Self { functions, _library: library })
    }
}

#[cfg(unix)]
fn open(path: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::unix;
    // Unresolved symbols must come out here, not in the middle of a run; and FMUs must not see each
    // other's symbols.
    // SAFETY: the library's constructors run; the user chose to run this FMU.
    unsafe { unix::Library::open(Some(path), unix::RTLD_NOW | unix::RTLD_LOCAL) }.map(Library::from)
}

#[cfg(not(unix))]
fn open(path: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: the library's constructors run; the user chose to run this FMU.
    unsafe { Library::new(path) }
}

/// What the system's loader says, which names the missing symbol or file, and what to do about Python's.
fn reason(error: &libloading::Error) -> String {
    let text = std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string);
    if text.contains("undefined symbol: Py") || text.contains("undefined symbol: _Py") {
        return format!(
            "{text}; the FMU leaves Python to its host: start with LD_PRELOAD=/path/to/libpython3.so and with \
             PYTHONPATH for its packages"
        );
    }
    text
}

/// Finds the library and looks at it without running any of its code.
pub(super) fn look(folder: &Path, description: &ModelDescription) -> Result<(), LibraryError> {
    check(&find(folder, &description.model_identifier)?)
}

fn check(path: &Path) -> Result<(), LibraryError> {
    match binary::unfit(path) {
        Ok(None) => Ok(()),
        Ok(Some((found, expected))) => {
            Err(LibraryError::Foreign { path: path.to_path_buf(), found, expected })
        }
        Err(error) => Err(LibraryError::Load { path: path.to_path_buf(), reason: error.to_string() }),
    }
}

/// The library's absolute path.
fn find(folder: &Path, identifier: &str) -> Result<PathBuf, LibraryError> {
    let (platforms, extension) = PLATFORM;
    let file = format!("{identifier}.{extension}");
    for platform in platforms {
        let path = folder.join("binaries").join(platform).join(&file);
        if path.is_file() {
            return Ok(std::path::absolute(&path).unwrap_or(path));
        }
    }
    let expected = Path::new("binaries").join(platforms.first().unwrap_or(&"(unknown platform)")).join(&file);
    Err(LibraryError::NoBinary { model: identifier.to_owned(), expected, held: platforms_in(folder) })
}

fn platforms_in(folder: &Path) -> String {
    let entries = std::fs::read_dir(folder.join("binaries")).into_iter().flatten().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    if names.is_empty() { "no binaries at all".into() } else { names.join(", ") }
}

/// # Safety
/// `pointer` is NULL or a C string that lives through this call.
unsafe fn text(pointer: *const std::os::raw::c_char) -> String {
    if pointer.is_null() {
        return "NULL".into();
    }
    // SAFETY: not NULL, so by the caller's promise a C string.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

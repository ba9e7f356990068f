//! libhelics: found, loaded at run time, the functions that a federate needs resolved at once. Decides nothing of when
//! they are called; [`super::session`] and [`super::broker`] do.

use super::error::FederationError;
use libloading::Library;
use std::ffi::{CStr, c_char, c_double, c_int, c_void};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// The version that this program was tried with; later ones of the same major version are taken too.
pub const WANTED: &str = "3.6.1";

/// Names the library, before everything else that is looked at.
pub const VARIABLE: &str = "BESS_HELICS";

/// `HelicsError`, filled by each call.
#[repr(C)]
pub(super) struct HelicsError {
    pub code: i32,
    pub message: *const c_char,
}

/// An opaque object of HELICS: a federate, its info, a publication, an input, a broker, a core.
pub(super) type Object = *mut c_void;

macro_rules! functions {
    ($($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The functions of the C API of HELICS 3 that are used here; valid as long as the library is loaded.
        pub(super) struct Functions {
            $(pub $field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            fn resolve(library: &Library) -> Result<Self, Vec<&'static str>> {
                let mut missing = Vec::new();
                // SAFETY: the header of HELICS 3 gives each function this type; a library that exports something else
                // under the name is not HELICS, which no loader can detect.
                $(let $field = unsafe {
                    library.get::<unsafe extern "C" fn($($argument),*) $(-> $result)?>(concat!($name, "\0").as_bytes())
                }.ok().map(|symbol| *symbol);
                if $field.is_none() { missing.push($name); })*
                match ($($field,)*) {
                    ($(Some($field),)*) => Ok(Self { $($field),* }),
                    _ => Err(missing),
                }
            }
        }
    };
}

functions! {
    version = "helicsGetVersion": fn() -> *const c_char;
    abort = "helicsAbort": fn(c_int, *const c_char);
    close_library = "helicsCloseLibrary": fn();
    create_info = "helicsCreateFederateInfo": fn() -> Object;
    free_info = "helicsFederateInfoFree": fn(Object);
    set_core_type = "helicsFederateInfoSetCoreTypeFromString": fn(Object, *const c_char, *mut HelicsError);
    set_core_init = "helicsFederateInfoSetCoreInitString": fn(Object, *const c_char, *mut HelicsError);
    set_flag = "helicsFederateInfoSetFlagOption": fn(Object, c_int, c_int, *mut HelicsError);
    create_federate = "helicsCreateValueFederate": fn(*const c_char, Object, *mut HelicsError) -> Object;
    disconnect = "helicsFederateDisconnect": fn(Object, *mut HelicsError);
    free_federate = "helicsFederateFree": fn(Object);
    register_publication = "helicsFederateRegisterGlobalPublication":
        fn(Object, *const c_char, c_int, *const c_char, *mut HelicsError) -> Object;
    register_input = "helicsFederateRegisterGlobalInput":
        fn(Object, *const c_char, c_int, *const c_char, *mut HelicsError) -> Object;
    add_target = "helicsInputAddTarget": fn(Object, *const c_char, *mut HelicsError);
    publication_option = "helicsPublicationSetOption": fn(Object, c_int, c_int, *mut HelicsError);
    input_option = "helicsInputSetOption": fn(Object, c_int, c_int, *mut HelicsError);
    enter_initializing = "helicsFederateEnterInitializingMode": fn(Object, *mut HelicsError);
    enter_executing = "helicsFederateEnterExecutingMode": fn(Object, *mut HelicsError);
    enter_executing_iterative = "helicsFederateEnterExecutingModeIterative":
        fn(Object, c_int, *mut HelicsError) -> c_int;
    request_time = "helicsFederateRequestTime": fn(Object, c_double, *mut HelicsError) -> c_double;
    get_core = "helicsFederateGetCore": fn(Object, *mut HelicsError) -> Object;
    create_query = "helicsCreateQuery": fn(*const c_char, *const c_char) -> Object;
    query_core = "helicsQueryCoreExecute": fn(Object, Object, *mut HelicsError) -> *const c_char;
    core_wait = "helicsCoreWaitForDisconnect": fn(Object, c_int, *mut HelicsError) -> c_int;
    free_query = "helicsQueryFree": fn(Object);
    current_time = "helicsFederateGetCurrentTime": fn(Object, *mut HelicsError) -> c_double;
    publish_double = "helicsPublicationPublishDouble": fn(Object, c_double, *mut HelicsError);
    publish_vector = "helicsPublicationPublishVector": fn(Object, *const c_double, c_int, *mut HelicsError);
    is_updated = "helicsInputIsUpdated": fn(Object) -> c_int;
    vector_size = "helicsInputGetVectorSize": fn(Object) -> c_int;
    get_vector = "helicsInputGetVector": fn(Object, *mut c_double, c_int, *mut c_int, *mut HelicsError);
    get_double = "helicsInputGetDouble": fn(Object, *mut HelicsError) -> c_double;
    create_broker = "helicsCreateBroker":
        fn(*const c_char, *const c_char, *const c_char, *mut HelicsError) -> Object;
    broker_is_connected = "helicsBrokerIsConnected": fn(Object) -> c_int;
    broker_address = "helicsBrokerGetAddress": fn(Object) -> *const c_char;
    broker_wait = "helicsBrokerWaitForDisconnect": fn(Object, c_int, *mut HelicsError) -> c_int;
    broker_disconnect = "helicsBrokerDisconnect": fn(Object, *mut HelicsError);
    broker_free = "helicsBrokerFree": fn(Object);
}

/// The loaded library with its functions. The functions must not outlive it.
pub struct Helics {
    pub(super) functions: Functions,
    /// Questions that nobody has answered yet.
    pub(super) open_questions: AtomicUsize,
    _library: Library,
    version: String,
    path: PathBuf,
}

impl Helics {
    /// Finds and loads it: at `named`, else where the environment variable [`VARIABLE`] says, else in the `helics`
    /// package of the python3 on the path, else under the system's names.
    pub fn load(named: Option<&Path>) -> Result<Self, FederationError> {
        let variable = std::env::var_os(VARIABLE).filter(|value| !value.is_empty()).map(PathBuf::from);
        if let Some(path) = named.map(Path::to_path_buf).or(variable) {
            return match in_folder(&path) {
                Some(path) => Self::open(&path),
                None if path.is_file() => Self::open(&path),
                None => Err(FederationError::Absent { looked: path.display().to_string() }),
            };
        }
        let mut looked = Vec::new();
        match package_of_python() {
            Some(folder) => match in_folder(&folder) {
                Some(path) => return Self::open(&path),
                None => looked.push(format!("a library in {}", folder.display())),
            },
            None => looked.push("the package helics of python3".to_owned()),
        }
        for name in NAMES {
            match Self::open(Path::new(name)) {
                Err(FederationError::Load { .. }) => looked.push((*name).to_owned()),
                loaded => return loaded,
            }
        }
        looked.push(format!("the environment variable {VARIABLE}"));
        Err(FederationError::Absent { looked: looked.join(", ") })
    }

    fn open(path: &Path) -> Result<Self, FederationError> {
        let refused = |reason: String| FederationError::Load { path: path.to_path_buf(), reason };
        // SAFETY: the library's constructors run; the user chose this library.
        let library = unsafe { Library::new(path) }.map_err(|error| refused(error.to_string()))?;
        let functions = Functions::resolve(&library)
            .map_err(|missing| refused(format!("it misses {}", missing.join(", "))))?;
        // SAFETY: takes nothing and returns a static string or NULL.
        let version = text(unsafe { (functions.version)() });
        let number = |text: &str| -> Option<(u32, u32)> {
            let mut parts = text.trim_start_matches(|c: char| !c.is_ascii_digit()).split(['.', '-', ' ']);
            Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
        };
        match (number(&version), number(WANTED)) {
            (Some((major, minor)), Some((wanted, least))) if major == wanted && minor >= least => {}
            _ => return Err(FederationError::Version { path: path.to_path_buf(), found: version }),
        }
        let (open_questions, path) = (AtomicUsize::new(0), path.to_path_buf());
        Ok(Self { functions, open_questions, _library: library, version, path })
    }

    /// What it says of its version.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Where it was found.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Ends whatever call of HELICS waits in another thread of this process, with an error there.
    pub fn abort(&self, reason: &str) {
        let reason: String = reason.chars().filter(|c| *c != '\0').collect();
        if let Ok(reason) = std::ffi::CString::new(reason) {
            // SAFETY: the string lives through the call; HELICS takes it from any thread.
            unsafe { (self.functions.abort)(-101, reason.as_ptr()) }
        }
    }

    /// Ends this process. HELICS's threads are given a while to send what they have to, and no more: some wait for ever
    /// for a broker that has ended sooner, and so would an ordinary end of the process, for them.
    pub fn end_process(self: Arc<Self>, code: u8) -> ! {
        let (closed, waiting) = std::sync::mpsc::channel();
        // A thread whose question nobody answers is still inside the library; its session has waited for its core.
        let is_idle = self.open_questions.load(Ordering::SeqCst) == 0;
        let closing = std::thread::Builder::new().name("close".into());
        let close = move || {
            // SAFETY: takes nothing; sessions and brokers have been dropped by whoever calls.
            unsafe { (self.functions.close_library)() };
            // Nobody may be waiting any more.
            let _ = closed.send(());
        };
        if is_idle && closing.spawn(close).is_ok() {
            let _ = waiting.recv_timeout(LAST_WORDS);
        }
        // SAFETY: takes a number and does not come back; nothing of ours is left to be written.
        unsafe { _exit(c_int::from(code)) }
    }
}

unsafe extern "C" {
    fn _exit(code: c_int) -> !;
}

/// How long HELICS may take to say good-bye.
pub(super) const LAST_WORDS: Duration = Duration::from_secs(3);

/// File names under which the system's loader may know it.
const NAMES: &[&str] = if cfg!(target_os = "windows") {
    &["helics.dll"]
} else if cfg!(target_os = "macos") {
    &["libhelics.dylib"]
} else {
    &["libhelics.so.3", "libhelics.so"]
};

/// The library in a folder: a Python package of HELICS, an installation of it, or the folder of the library itself.
fn in_folder(folder: &Path) -> Option<PathBuf> {
    let places = ["install/lib64", "install/lib", "install/bin", "lib64", "lib", "bin", "."];
    let files = places.iter().flat_map(|place| NAMES.iter().map(move |name| folder.join(place).join(name)));
    files.into_iter().find(|path| path.is_file())
}

/// Where the python3 on the path has its package, without importing it.
fn package_of_python() -> Option<PathBuf> {
    let code = "import importlib.util as u; s = u.find_spec('helics'); print(s.origin if s else '')";
    let mut python = Command::new("python3");
    let output = python.args(["-c", code]).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    let origin = String::from_utf8(output.stdout).ok()?;
    let folder = Path::new(origin.trim()).parent()?;
    folder.is_dir().then(|| folder.to_path_buf()).filter(|folder| !folder.as_os_str().is_empty())
}

/// A C string of HELICS as text; empty for NULL.
pub(super) fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // SAFETY: not NULL, so a C string that HELICS keeps at least until its next call.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

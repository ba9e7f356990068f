//! A safe FMU instance: typed calls, fmi2Status split into Ok and Err once, freed on drop. Nothing
//! after fmi2Fatal but silence: the standard forbids even to free.

use super::description::Variable;
use super::fmu::{self, Parts};
use super::guarded::{Guarded, Trespass};
use super::library::Functions;
use super::logger::{self, LogStore, LogTarget};
use super::participant::{CallError, Participant, StateHandle};
use crate::fmi::bindings::*;
use std::collections::BTreeMap;
use std::ffi::CString;
use std::os::raw::c_void;
use std::path::Path;
use std::ptr;
use std::rc::Rc;
use std::sync::Arc;

/// Where in its life an instance is, as far as the importer must know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Life {
    Instantiated,
    Initialization,
    Step,
    Terminated,
    Fatal,
}

/// One instance of an FMU.
pub struct Slave {
    name: String,
    pub(super) component: fmi2Component,
    life: Life,
    pub(super) states: BTreeMap<u64, fmi2FMUstate>,
    pub(super) next_state: u64,
    reals: Guarded<f64>,
    integers: Guarded<i32>,
    // The FMU holds pointers at these two until it is freed.
    _callbacks: Box<fmi2CallbackFunctions>,
    log: Box<LogStore>,
    // Last: the library goes when all else is gone.
    pub(super) parts: Rc<Parts>,
}

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(pointer: *mut c_void);
}

impl Slave {
    pub(super) fn new(
        parts: Rc<Parts>,
        name: &str,
        logging_on: bool,
        target: Option<Arc<LogTarget>>,
    ) -> Result<Self, CallError> {
        let function = "fmi2Instantiate";
        let c_string = |text: &str| {
            CString::new(text)
                .map_err(|_| CallError::new(function, format!("{text:?} holds a NUL character")))
        };
        let c_name = c_string(name)?;
        let guid = c_string(&parts.description.guid)?;
        let resources = c_string(&file_uri(&parts.folder.path().join("resources")))?;
        let log = Box::new(LogStore::new(target));
        let callbacks = Box::new(fmi2CallbackFunctions {
            logger: logger::callback(),
            allocateMemory: Some(calloc),
            freeMemory: Some(free),
            stepFinished: None,
            componentEnvironment: ptr::from_ref(&*log).cast_mut().cast(),
        });
        // SAFETY: the strings live through the call, callbacks and log store as long as the instance.
        let component = unsafe {
            (parts.library.functions.instantiate)(
                c_name.as_ptr(),
                fmi2Type_fmi2CoSimulation,
                guid.as_ptr(),
                resources.as_ptr(),
                &*callbacks,
                fmi2False as fmi2Boolean,
                fmi2Boolean::from(logging_on),
            )
        };
        if component.is_null() {
            let reason = format!("returned NULL; {} could not make an instance", parts.path.display());
            return Err(CallError::new(function, reason).with_log(log.take()));
        }
        Ok(Self {
            name: name.to_owned(),
            component,
            life: Life::Instantiated,
            states: BTreeMap::new(),
            next_state: 0,
            reals: Guarded::default(),
            integers: Guarded::default(),
            _callbacks: callbacks,
            log,
            parts,
        })
    }

    pub(super) fn functions(&self) -> &Functions {
        &self.parts.library.functions
    }

    /// Splits a status into Ok and Err. A warning is Ok: its line went to the log.
    pub(super) fn check(&mut self, function: &'static str, status: fmi2Status) -> Result<(), CallError> {
        #[allow(non_upper_case_globals)]
        let reason = match status {
            fmi2Status_fmi2OK | fmi2Status_fmi2Warning => return Ok(()),
            fmi2Status_fmi2Discard => "returned fmi2Discard".to_owned(),
            fmi2Status_fmi2Error => "returned fmi2Error".to_owned(),
            fmi2Status_fmi2Fatal => {
                self.life = Life::Fatal;
                "returned fmi2Fatal; the instance is lost".to_owned()
            }
            fmi2Status_fmi2Pending => {
                "returned fmi2Pending, but no asynchronous step was asked for".to_owned()
            }
            other => format!("returned {other}, which is no fmi2Status"),
        };
        Err(CallError::new(function, reason).with_log(self.log.take()))
    }

    /// A library that wrote outside its room has damaged memory, so nothing of it is called any more.
    pub(super) fn trespassed(&mut self, function: &'static str, room: usize, found: Trespass) -> CallError {
        self.life = Life::Fatal;
        let Trespass { before, after } = found;
        let reason = format!(
            "wrote outside the room for {room} values: {before} before it and {after} after it are damaged; the \
             instance is lost. In a process of its own (--isolate) it can damage only itself"
        );
        CallError::new(function, reason).with_log(self.log.take())
    }

    pub(super) fn alive(&self, function: &'static str) -> Result<(), CallError> {
        if self.life == Life::Fatal {
            return Err(CallError::new(function, "not called: the instance is lost after fmi2Fatal"));
        }
        Ok(())
    }

    fn expect(&self, function: &'static str, life: Life) -> Result<(), CallError> {
        self.alive(function)?;
        if self.life != life {
            let reason = format!("not called: the instance is in {:?}; expected {life:?}", self.life);
            return Err(CallError::new(function, reason));
        }
        Ok(())
    }

    fn values(&self, function: &'static str, references: usize, values: usize) -> Result<(), CallError> {
        self.alive(function)?;
        if references != values {
            let reason = format!("not called: {values} values for {references} value references");
            return Err(CallError::new(function, reason));
        }
        Ok(())
    }
}

macro_rules! access {
    ($(get $get:ident, set $set:ident: $type:ty, $room:ident, $get_name:literal, $set_name:literal;)*) => {$(
        fn $get(&mut self, references: &[u32], values: &mut [$type]) -> Result<(), CallError> {
            self.values($get_name, references.len(), values.len())?;
            let room = self.$room.lay_out(values);
            // SAFETY: a living instance; both arrays have the length given and live through the call.
            let status = unsafe {
                (self.functions().$get)(self.component, references.as_ptr(), references.len(), room)
            };
            match self.$room.written() {
                Ok(written) => values.copy_from_slice(written),
                Err(found) => return Err(self.trespassed($get_name, references.len(), found)),
            }
            self.check($get_name, status)
        }

        fn $set(&mut self, references: &[u32], values: &[$type]) -> Result<(), CallError> {
            self.values($set_name, references.len(), values.len())?;
            // SAFETY: a living instance; both arrays have the length given and live through the call.
            let status = unsafe {
                (self.functions().$set)(self.component, references.as_ptr(), references.len(), values.as_ptr())
            };
            self.check($set_name, status)
        }
    )*};
}

impl Participant for Slave {
    fn name(&self) -> &str {
        &self.name
    }

    fn variables(&self) -> &[Variable] {
        &self.parts.description.variables
    }

    fn can_vary_step(&self) -> bool {
        self.parts.description.capabilities.can_handle_variable_step
    }

    fn identity(&self) -> String {
        fmu::identity(&self.parts.description.guid, &self.parts.path)
    }

    fn setup(&mut self, start_ns: i64, stop_ns: Option<i64>) -> Result<(), CallError> {
        let function = "fmi2SetupExperiment";
        self.expect(function, Life::Instantiated)?;
        let (defined, stop) = (fmi2Boolean::from(stop_ns.is_some()), seconds(stop_ns.unwrap_or(0)));
        // SAFETY: a living instance in the right state.
        let status = unsafe {
            (self.functions().setup_experiment)(self.component, 0, 0.0, seconds(start_ns), defined, stop)
        };
        self.check(function, status)
    }

    fn enter_initialization(&mut self) -> Result<(), CallError> {
        let function = "fmi2EnterInitializationMode";
        self.expect(function, Life::Instantiated)?;
        // SAFETY: a living instance in the right state.
        let status = unsafe { (self.functions().enter_initialization_mode)(self.component) };
        self.check(function, status)?;
        self.life = Life::Initialization;
        Ok(())
    }

    fn exit_initialization(&mut self) -> Result<(), CallError> {
        let function = "fmi2ExitInitializationMode";
        self.expect(function, Life::Initialization)?;
        // SAFETY: a living instance in the right state.
        let status = unsafe { (self.functions().exit_initialization_mode)(self.component) };
        self.check(function, status)?;
        self.life = Life::Step;
        Ok(())
    }

    access! {
        get get_real, set set_real: f64, reals, "fmi2GetReal", "fmi2SetReal";
        get get_integer, set set_integer: i32, integers, "fmi2GetInteger", "fmi2SetInteger";
        get get_boolean, set set_boolean: i32, integers, "fmi2GetBoolean", "fmi2SetBoolean";
    }

    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        let function = "fmi2DoStep";
        self.expect(function, Life::Step)?;
        // SAFETY: a living instance in the right state. The last argument (1) says that no state before
        // this point will be asked back, unless some are kept.
        let status = unsafe {
            let no_return = fmi2Boolean::from(self.states.is_empty());
            (self.functions().do_step)(self.component, seconds(t_ns), seconds(h_ns), no_return)
        };
        self.check(function, status)
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        if self.life != Life::Step {
            return Ok(());
        }
        self.life = Life::Terminated;
        // SAFETY: a living instance in the right state.
        let status = unsafe { (self.functions().terminate)(self.component) };
        self.check("fmi2Terminate", status)
    }

    fn reset(&mut self) -> Result<(), CallError> {
        let function = "fmi2Reset";
        self.alive(function)?;
        // SAFETY: a living instance; allowed in every state but fatal.
        let status = unsafe { (self.functions().reset)(self.component) };
        self.check(function, status)?;
        self.life = Life::Instantiated;
        Ok(())
    }

    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        self.save()
    }

    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError> {
        self.restore(state)
    }

    fn forget_state(&mut self, state: StateHandle) {
        self.forget(state);
    }

    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        self.serialise(state)
    }

    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        self.deserialise(bytes)
    }
}

impl Drop for Slave {
    fn drop(&mut self) {
        if self.life == Life::Fatal {
            return;
        }
        self.forget_all();
        // SAFETY: allocated by this library, not freed before, and nobody uses it after.
        unsafe { (self.functions().free_instance)(self.component) };
    }
}

/// The one place where integer time becomes a double.
pub(super) fn seconds(ns: i64) -> f64 {
    ns as f64 / 1e9
}

/// `file:///...` of an absolute path, percent-encoded as RFC 3986 has it.
fn file_uri(path: &Path) -> String {
    let text = path.to_string_lossy().replace('\\', "/");
    let mut uri = String::from(if text.starts_with('/') { "file://" } else { "file:///" });
    for byte in text.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'/' | b'-' | b'.' | b'_' | b'~' | b':' => {
                uri.push(char::from(byte));
            }
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_uris() {
        for (path, expected) in [
            ("/tmp/fmu/resources", "file:///tmp/fmu/resources"),
            ("/tmp/a b/\u{e4}", "file:///tmp/a%20b/%C3%A4"),
            ("C:\\x\\resources", "file:///C:/x/resources"),
        ] {
            assert_eq!(file_uri(Path::new(path)), expected);
        }
    }

    #[test]
    fn a_tenth_of_a_second_is_the_nearest_double_at_every_step() {
        for k in 0..1_000_000_i64 {
            let expected: f64 = format!("{}.{}", k / 10, k % 10).parse().unwrap();
            assert_eq!(seconds(k * 100_000_000), expected);
        }
    }
}

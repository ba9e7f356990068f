//! The participant on this side: every call becomes a message, every answer has a deadline. When the process dies or
//! does not answer, the call is an error that says so, and nothing is asked of it any more.

use super::Isolation;
use super::process::{KEPT, describe, spawn, wait};
use super::protocol::{Receiver, Reply, Request, Sender, Type, Wire, pack, unpack};
use crate::harness::archive::{Limits, Unpacked, unpack as unpack_archive};
use crate::harness::description::{ModelDescription, Variable};
use crate::harness::error::HarnessError;
use crate::harness::participant::{CallError, Participant, StateHandle, Trouble};
use crate::harness::{fmu, library};
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long a process may take to go, and its last lines to arrive.
const GRACE: Duration = Duration::from_secs(5);

/// An FMU in a process of its own.
pub struct Isolated {
    name: String,
    description: ModelDescription,
    path: PathBuf,
    child: Child,
    calls: Sender,
    answers: Receiver,
    call_limit: Duration,
    log: VecDeque<String>,
    printed: Arc<Mutex<VecDeque<String>>>,
    is_gone: bool,
    references: Vec<u8>,
    values: Vec<u8>,
    // Last: deleted when nobody uses it any more.
    _folder: Unpacked,
}

impl Isolated {
    /// Unpacks and reads the FMU here, loads and instantiates it there. The command gets the arguments folder, FMU,
    /// name and number of this process.
    pub fn start(path: &Path, name: &str, isolation: &Isolation) -> Result<Self, HarnessError> {
        let folder = unpack_archive(path, Limits::default())?;
        let description = ModelDescription::read(&folder.path().join("modelDescription.xml"))?;
        library::look(folder.path(), &description)?;
        let failed = |source: CallError| HarnessError::Call { participant: name.to_owned(), source };
        let spawned = spawn(path, folder.path(), name, isolation);
        let (child, stream, printed) = spawned.map_err(|error| {
            failed(CallError::new(
                "starting its process",
                format!("{}: {error}", isolation.command.0.display()),
            ))
        })?;
        let broken = |error: io::Error| failed(CallError::new("starting its process", error.to_string()));
        let answers = stream.try_clone().map_err(broken)?;
        stream.set_write_timeout(Some(isolation.call_limit)).map_err(broken)?;
        let mut isolated = Self {
            name: name.to_owned(),
            description,
            path: path.to_path_buf(),
            child,
            calls: Sender::new(stream),
            answers: Receiver::new(answers),
            call_limit: isolation.call_limit,
            log: VecDeque::new(),
            printed,
            is_gone: false,
            references: Vec::new(),
            values: Vec::new(),
            _folder: folder,
        };
        isolated.answers.set_limit(isolation.call_limit).map_err(broken)?;
        isolated
            .receive("fmi2Instantiate")
            .and_then(|()| isolated.done("fmi2Instantiate"))
            .map_err(failed)?;
        Ok(isolated)
    }

    /// Number of the process.
    pub fn process(&self) -> u32 {
        self.child.id()
    }

    /// Sends a call and waits for its answer, which is then in `answers`.
    fn call(&mut self, function: &'static str, request: &Request<'_>) -> Result<(), CallError> {
        if self.is_gone {
            return Err(CallError::new(function, "not called: the FMU's process has ended"));
        }
        match self.calls.send(request) {
            Ok(()) => self.receive(function),
            Err(error) => Err(self.lost(function, &error)),
        }
    }

    fn receive(&mut self, function: &'static str) -> Result<(), CallError> {
        let begun = Instant::now();
        let mut has_logged = false;
        loop {
            match self.answers.receive() {
                Ok(true) => {}
                Ok(false) => return Err(self.died(function)),
                Err(error) => return Err(self.lost(function, &error)),
            }
            match self.heard() {
                Heard::Log(line) => {
                    if self.log.len() == KEPT {
                        self.log.pop_front();
                    }
                    self.log.push_back(line);
                    has_logged = true;
                    // One that logs for ever hangs too.
                    let left = self.call_limit.saturating_sub(begun.elapsed());
                    if left.is_zero() {
                        return Err(self.hung(function));
                    }
                    self.answers
                        .set_limit(left)
                        .map_err(|error| CallError::new(function, error.to_string()))?;
                }
                Heard::Answer => return self.rearm(function, has_logged),
                Heard::Refused(named, reason, log) => {
                    // Those lines came one by one as well.
                    self.log.clear();
                    self.rearm(function, has_logged)?;
                    return Err(CallError::new(named.unwrap_or(function), reason).with_log(log));
                }
                Heard::Nonsense(error) => return Err(self.lost(function, &error)),
            }
        }
    }

    fn heard(&self) -> Heard {
        match self.answers.message() {
            Ok(Reply::Log { category, message }) => Heard::Log(format!("[{category}] {message}")),
            Ok(Reply::Refused { function, reason, log }) => {
                let named = FUNCTIONS.iter().find(|known| **known == function).copied();
                Heard::Refused(named, reason.to_owned(), log)
            }
            Ok(_) => Heard::Answer,
            Err(error) => Heard::Nonsense(error),
        }
    }

    fn rearm(&mut self, function: &'static str, is_needed: bool) -> Result<(), CallError> {
        if !is_needed {
            return Ok(());
        }
        let armed = self.answers.set_limit(self.call_limit);
        armed.map_err(|error| CallError::new(function, error.to_string()))
    }

    fn done(&mut self, function: &'static str) -> Result<(), CallError> {
        if matches!(self.answers.message(), Ok(Reply::Done)) { Ok(()) } else { Err(self.confused(function)) }
    }

    fn state(&mut self, function: &'static str) -> Result<StateHandle, CallError> {
        let state = match self.answers.message() {
            Ok(Reply::State(state)) => Some(StateHandle(state)),
            _ => None,
        };
        state.ok_or_else(|| self.confused(function))
    }

    fn simple(&mut self, function: &'static str, request: &Request<'_>) -> Result<(), CallError> {
        self.call(function, request)?;
        self.done(function)
    }

    fn get<T: Wire>(
        &mut self,
        (function, kind): (&'static str, Type),
        references: &[u32],
        values: &mut [T],
    ) -> Result<(), CallError> {
        same_length(function, references.len(), values.len())?;
        let mut packed = std::mem::take(&mut self.references);
        packed.clear();
        pack(references, &mut packed);
        let called = self.call(function, &Request::Get { kind, references: &packed });
        self.references = packed;
        called?;
        let fits = matches!(self.answers.message(), Ok(Reply::Values(bytes)) if unpack(bytes, values));
        if fits { Ok(()) } else { Err(self.confused(function)) }
    }

    fn set<T: Wire>(
        &mut self,
        (function, kind): (&'static str, Type),
        references: &[u32],
        values: &[T],
    ) -> Result<(), CallError> {
        same_length(function, references.len(), values.len())?;
        let mut packed = (std::mem::take(&mut self.references), std::mem::take(&mut self.values));
        packed.0.clear();
        packed.1.clear();
        pack(references, &mut packed.0);
        pack(values, &mut packed.1);
        let called = self.call(function, &Request::Set { kind, references: &packed.0, values: &packed.1 });
        (self.references, self.values) = packed;
        called?;
        self.done(function)
    }

    /// The connection broke: by the end of the process, by its silence, or by nonsense.
    fn lost(&mut self, function: &'static str, error: &io::Error) -> CallError {
        match error.kind() {
            io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => self.hung(function),
            io::ErrorKind::BrokenPipe | io::ErrorKind::ConnectionReset => self.died(function),
            _ => {
                self.end();
                self.error(function, format!("its process answered nonsense: {error}"), Trouble::Died)
            }
        }
    }

    fn confused(&mut self, function: &'static str) -> CallError {
        self.lost(function, &io::Error::other("another answer than the call asks for"))
    }

    fn hung(&mut self, function: &'static str) -> CallError {
        self.end();
        let reason = format!("no answer within {:?}; its process was ended", self.call_limit);
        self.error(function, reason, Trouble::Hung)
    }

    fn died(&mut self, function: &'static str) -> CallError {
        // Its end of the line is closed, so it is about to be gone; if not, it is made to.
        let how =
            wait(&mut self.child, GRACE).map_or_else(|| "it closed its connection".to_owned(), describe);
        self.end();
        self.error(function, format!("its process died ({how})"), Trouble::Died)
    }

    fn end(&mut self) {
        self.is_gone = true;
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    fn error(&mut self, function: &'static str, reason: String, trouble: Trouble) -> CallError {
        let mut log: Vec<String> = self.log.drain(..).collect();
        // The last lines may still be on their way.
        let until = Instant::now() + Duration::from_millis(500);
        while Arc::strong_count(&self.printed) > 1 && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
        log.extend(self.printed.lock().unwrap_or_else(PoisonError::into_inner).drain(..));
        CallError { trouble, ..CallError::new(function, reason).with_log(log) }
    }
}

fn same_length(function: &'static str, references: usize, values: usize) -> Result<(), CallError> {
    if references == values {
        return Ok(());
    }
    Err(CallError::new(function, format!("not called: {values} values for {references} value references")))
}

/// What a message from the other side is.
enum Heard {
    Log(String),
    Answer,
    Refused(Option<&'static str>, String, Vec<String>),
    Nonsense(io::Error),
}

/// The functions that an error may name besides the one that was called.
const FUNCTIONS: [&str; 2] = ["loading the library", "fmi2SerializedFMUstateSize"];

impl Participant for Isolated {
    fn name(&self) -> &str {
        &self.name
    }

    fn variables(&self) -> &[Variable] {
        &self.description.variables
    }

    fn can_vary_step(&self) -> bool {
        self.description.capabilities.can_handle_variable_step
    }

    fn identity(&self) -> String {
        fmu::identity(&self.description.guid, &self.path)
    }

    fn setup(&mut self, start_ns: i64, stop_ns: Option<i64>) -> Result<(), CallError> {
        self.simple("fmi2SetupExperiment", &Request::Setup { start_ns, stop_ns })
    }

    fn enter_initialization(&mut self) -> Result<(), CallError> {
        self.simple("fmi2EnterInitializationMode", &Request::EnterInitialization)
    }

    fn exit_initialization(&mut self) -> Result<(), CallError> {
        self.simple("fmi2ExitInitializationMode", &Request::ExitInitialization)
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.get(("fmi2GetReal", Type::Real), references, values)
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.get(("fmi2GetInteger", Type::Integer), references, values)
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.get(("fmi2GetBoolean", Type::Boolean), references, values)
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.set(("fmi2SetReal", Type::Real), references, values)
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.set(("fmi2SetInteger", Type::Integer), references, values)
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.set(("fmi2SetBoolean", Type::Boolean), references, values)
    }

    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        self.simple("fmi2DoStep", &Request::DoStep { t_ns, h_ns })
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        if self.is_gone {
            return Ok(());
        }
        self.simple("fmi2Terminate", &Request::Terminate)
    }

    fn reset(&mut self) -> Result<(), CallError> {
        self.simple("fmi2Reset", &Request::Reset)
    }

    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        self.call("fmi2GetFMUstate", &Request::SaveState)?;
        self.state("fmi2GetFMUstate")
    }

    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError> {
        self.simple("fmi2SetFMUstate", &Request::RestoreState(state.0))
    }

    fn forget_state(&mut self, state: StateHandle) {
        // If it fails the next call says so.
        let _ = self.simple("fmi2FreeFMUstate", &Request::ForgetState(state.0));
    }

    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        let function = "fmi2SerializeFMUstate";
        self.call(function, &Request::SerialiseState(state.0))?;
        let bytes = match self.answers.message() {
            Ok(Reply::Bytes(bytes)) => Some(bytes.to_vec()),
            _ => None,
        };
        bytes.ok_or_else(|| self.confused(function))
    }

    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        let function = "fmi2DeSerializeFMUstate";
        self.call(function, &Request::DeserialiseState(bytes))?;
        self.state(function)
    }
}

impl Drop for Isolated {
    fn drop(&mut self) {
        if !self.is_gone {
            // It frees its instance when it sees that nobody asks any more.
            self.calls.close();
            wait(&mut self.child, self.call_limit.min(GRACE));
        }
        self.end();
    }
}

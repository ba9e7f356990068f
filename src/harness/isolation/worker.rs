//! The process that an FMU runs in: takes calls from standard input, which is a socket, and answers them one by one.
//! It ends when the other side does, and may die of the FMU at any time.

use super::protocol::{Receiver, Reply, Request, Sender, Type, Wire, pack, unpack_all};
use crate::harness::fmu::Fmu;
use crate::harness::logger::LogLine;
use crate::harness::participant::{CallError, Participant, StateHandle};
use crate::harness::slave::Slave;
use std::io;
use std::os::fd::{AsFd, AsRawFd};
use std::os::raw::c_int;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

unsafe extern "C" {
    fn dup2(from: c_int, to: c_int) -> c_int;
    #[cfg(target_os = "linux")]
    fn prctl(option: c_int, ...) -> c_int;
}

/// Makes an instance of the FMU at `path`, which is unpacked in `folder`, and answers calls until the other side goes.
/// `parent` is the process that asks.
pub fn serve(folder: &Path, path: &Path, name: &str, parent: u32) -> io::Result<()> {
    die_with_parent(parent);
    let stream = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    let nothing = std::fs::File::open("/dev/null")?;
    // An FMU that reads from standard input would take calls away.
    // SAFETY: two open descriptors; nobody else in this process uses standard input.
    if unsafe { dup2(nothing.as_raw_fd(), 0) } < 0 {
        return Err(io::Error::last_os_error());
    }
    let mut calls = Receiver::new(stream.try_clone()?);
    let answers = Arc::new(Mutex::new(Sender::new(stream)));
    let lines = Arc::clone(&answers);
    // Sent as they come: the next call may be the last.
    let log = Arc::new(move |line: &LogLine| {
        let _ = send(&lines, &Reply::Log { category: &line.category, message: &line.message });
    });
    let fmu = match Fmu::adopt(folder, path) {
        Ok(fmu) => fmu,
        Err(error) => return refuse(&answers, &CallError::new("loading the library", error.to_string())),
    };
    let mut slave = match fmu.instance(name, log) {
        Ok(slave) => slave,
        Err(error) => return refuse(&answers, &error),
    };
    send(&answers, &Reply::Done)?;
    let mut bytes = Vec::new();
    while calls.receive()? {
        bytes.clear();
        match answer(&mut slave, calls.message()?, &mut bytes) {
            Ok(reply) => send(&answers, &reply)?,
            Err(error) => refuse(&answers, &error)?,
        }
    }
    Ok(())
}

fn send(answers: &Mutex<Sender>, reply: &Reply<'_>) -> io::Result<()> {
    answers.lock().unwrap_or_else(PoisonError::into_inner).send(reply)
}

fn refuse(answers: &Mutex<Sender>, error: &CallError) -> io::Result<()> {
    let CallError { function, reason, log, .. } = error;
    send(answers, &Reply::Refused { function, reason, log: log.clone() })
}

fn answer<'a>(
    slave: &mut Slave,
    request: Request<'_>,
    bytes: &'a mut Vec<u8>,
) -> Result<Reply<'a>, CallError> {
    let done = |(): ()| Reply::Done;
    match request {
        Request::Setup { start_ns, stop_ns } => slave.setup(start_ns, stop_ns).map(done),
        Request::EnterInitialization => slave.enter_initialization().map(done),
        Request::ExitInitialization => slave.exit_initialization().map(done),
        Request::Get { kind: Type::Real, references } => get(references, bytes, |r, v| slave.get_real(r, v)),
        Request::Get { kind: Type::Integer, references } => {
            get(references, bytes, |r, v| slave.get_integer(r, v))
        }
        Request::Get { kind: Type::Boolean, references } => {
            get(references, bytes, |r, v| slave.get_boolean(r, v))
        }
        Request::Set { kind: Type::Real, references, values } => {
            slave.set_real(&numbers(references)?, &numbers(values)?).map(done)
        }
        Request::Set { kind: Type::Integer, references, values } => {
            slave.set_integer(&numbers(references)?, &numbers(values)?).map(done)
        }
        Request::Set { kind: Type::Boolean, references, values } => {
            slave.set_boolean(&numbers(references)?, &numbers(values)?).map(done)
        }
        Request::DoStep { t_ns, h_ns } => slave.do_step(t_ns, h_ns).map(done),
        Request::Terminate => slave.terminate().map(done),
        Request::Reset => slave.reset().map(done),
        Request::SaveState => slave.save_state().map(|StateHandle(state)| Reply::State(state)),
        Request::RestoreState(state) => slave.restore_state(StateHandle(state)).map(done),
        Request::ForgetState(state) => {
            slave.forget_state(StateHandle(state));
            Ok(Reply::Done)
        }
        Request::SerialiseState(state) => {
            *bytes = slave.serialise_state(StateHandle(state))?;
            Ok(Reply::Bytes(bytes))
        }
        Request::DeserialiseState(state) => {
            slave.deserialise_state(state).map(|StateHandle(state)| Reply::State(state))
        }
    }
}

fn numbers<T: Wire>(bytes: &[u8]) -> Result<Vec<T>, CallError> {
    unpack_all(bytes).ok_or_else(|| CallError::new("(call)", "a message that ends within a number"))
}

fn get<'a, T: Wire>(
    references: &[u8],
    bytes: &'a mut Vec<u8>,
    read: impl FnOnce(&[u32], &mut [T]) -> Result<(), CallError>,
) -> Result<Reply<'a>, CallError> {
    let references = numbers(references)?;
    let mut values = vec![T::default(); references.len()];
    read(&references, &mut values)?;
    pack(&values, bytes);
    Ok(Reply::Values(bytes))
}

/// An FMU that hangs must not outlive the run that it belongs to; one that waits for a call sees its end anyway.
fn die_with_parent(parent: u32) {
    #[cfg(target_os = "linux")]
    {
        const PR_SET_PDEATHSIG: c_int = 1;
        const SIGKILL: std::os::raw::c_ulong = 9;
        // SAFETY: this option takes one number and touches nothing else.
        unsafe { prctl(PR_SET_PDEATHSIG, SIGKILL) };
    }
    // It may have gone before the line above.
    if std::os::unix::process::parent_id() != parent {
        std::process::exit(1);
    }
}

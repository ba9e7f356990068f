//! The process of an FMU from outside: started, listened to, waited for, its end told in words.

use super::{Isolation, Output};
use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, PipeReader, Read};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Lines kept for the error that may follow.
pub(super) const KEPT: usize = 8;

/// The process, the line to it, and what it printed last, which is let go when it has printed all.
pub(super) type Spawned = (Child, UnixStream, Arc<Mutex<VecDeque<String>>>);

pub(super) fn spawn(path: &Path, folder: &Path, name: &str, isolation: &Isolation) -> io::Result<Spawned> {
    let (program, arguments) = &isolation.command;
    let (ours, theirs) = UnixStream::pair()?;
    let (reader, writer) = io::pipe()?;
    let child = Command::new(program)
        .args(arguments)
        .args([folder, path])
        .args([name, &std::process::id().to_string()])
        .stdin(Stdio::from(OwnedFd::from(theirs)))
        .stdout(writer.try_clone()?)
        .stderr(writer)
        .spawn()?;
    let printed = Arc::new(Mutex::new(VecDeque::with_capacity(KEPT)));
    let (kept, output, name) = (Arc::clone(&printed), isolation.output.clone(), name.to_owned());
    // Read aside, so that an FMU that prints much does not wait for us.
    std::thread::Builder::new().name("output of an FMU".into()).spawn(move || {
        listen(reader, &name, &kept, output.as_deref());
    })?;
    Ok((child, ours, printed))
}

/// Hands on what the FMU prints until it is gone.
fn listen(reader: PipeReader, name: &str, kept: &Mutex<VecDeque<String>>, output: Option<&Output>) {
    let mut reader = BufReader::new(reader);
    let mut line = Vec::new();
    // An endless line is handed on in pieces.
    while reader.by_ref().take(4096).read_until(b'\n', &mut line).is_ok_and(|count| count > 0) {
        let text = String::from_utf8_lossy(&line).trim_end().to_owned();
        if let Some(output) = output {
            output(name, &text);
        }
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() == KEPT {
            kept.pop_front();
        }
        kept.push_back(text);
        line.clear();
    }
}

/// Waits for the process to end, within reason.
pub(super) fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let until = Instant::now() + limit;
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if Instant::now() < until => std::thread::sleep(Duration::from_millis(1)),
            _ => return None,
        }
    }
}

pub(super) fn describe(status: ExitStatus) -> String {
    match status.signal() {
        Some(4) => "signal 4, an illegal instruction".to_owned(),
        Some(6) => "signal 6, an abort".to_owned(),
        Some(7) => "signal 7, a bus error".to_owned(),
        Some(8) => "signal 8, an arithmetic fault".to_owned(),
        Some(9) => "signal 9, killed from outside; perhaps the memory ran out".to_owned(),
        Some(11) => "signal 11, a memory fault".to_owned(),
        Some(signal) => format!("signal {signal}"),
        None => status.to_string(),
    }
}

//! A process of a federation from outside: started with a line to it, listened to, told to stop, ended at last.

use super::super::Failure;
use super::{FederateArgs, broker, failed};
use crate::federation::{FederationError, Helics};
use miette::IntoDiagnostic;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// What a process says.
pub struct Said {
    /// Its place among the children.
    pub child: usize,
    /// One line of its standard output, or none where that is a line of its standard error.
    pub line: Line,
}

/// A line, from where.
pub enum Line {
    /// Standard output.
    Out(String),
    /// Standard error.
    Error(String),
}

/// A process that ends when it is let go.
pub struct Started {
    /// Name for people.
    pub name: String,
    child: Child,
    line: Option<ChildStdin>,
    ended: Option<ExitStatus>,
}

impl Started {
    /// Starts it; what it says goes to `said` under this number.
    pub fn new(
        name: &str,
        number: usize,
        command: &mut Command,
        said: &Sender<Said>,
    ) -> std::io::Result<Self> {
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = piped.spawn()?;
        let (out, error) = (child.stdout.take(), child.stderr.take());
        let line = child.stdin.take();
        if let Some(out) = out {
            listen(out, number, Line::Out, said)?;
        }
        if let Some(error) = error {
            listen(error, number, Line::Error, said)?;
        }
        Ok(Self { name: name.to_owned(), child, line, ended: None })
    }

    /// How it ended, once it has.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        if self.ended.is_none() {
            self.ended = self.child.try_wait().ok().flatten();
        }
        self.ended
    }

    /// Asks it to stop, and says why.
    pub fn stop(&mut self, reason: &str) {
        if let Some(line) = &mut self.line {
            // It may be gone already.
            let _ = writeln!(line, "{}", reason.replace('\n', " "));
        }
    }

    /// Waits for its end within reason, then ends it.
    pub fn end(&mut self, limit: Duration) -> Option<ExitStatus> {
        let until = Instant::now() + limit;
        while self.ended().is_none() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
        if self.ended().is_none() {
            let _ = self.child.kill();
            self.ended = self.child.wait().ok();
        }
        self.ended
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // A cut line stops it; what does not listen is ended.
        self.line = None;
        self.end(Duration::from_secs(1));
    }
}

/// How long taking a dead federate out may take.
pub const FUNERAL: Duration = Duration::from_secs(30);

/// Starts a process of this program with these words.
pub fn spawn(
    (name, number): (&str, usize),
    words: &[String],
    helics: &Helics,
    said: &Sender<Said>,
) -> Result<Started, Failure> {
    let program = std::env::current_exe().into_diagnostic()?;
    let mut command = Command::new(program);
    command.args(words).args(["--helics".as_ref(), helics.path().as_os_str()]);
    if words.first().is_some_and(|word| word != broker::BROKER) {
        command.arg("--child");
    }
    let started = Started::new(name, number, &mut command, said);
    let what = format!("the process of {name} cannot be started");
    started.map_err(|source| failed(FederationError::Process { what, source }))
}

/// Takes a dead federate out, in a process of its own: HELICS may do what it likes there. Whether it succeeded.
pub fn bury(
    args: &FederateArgs,
    helics: &Helics,
    (name, number): (&str, usize),
    (broker_name, folder): (&str, &Path),
    said: &Sender<Said>,
) -> Result<bool, Failure> {
    let mut words = args.member(name, broker_name, folder);
    words.push("--bury".into());
    let mut child = spawn((name, number), &words, helics, said)?;
    Ok(child.end(FUNERAL).is_some_and(|status| status.success()))
}

fn listen(
    from: impl std::io::Read + Send + 'static,
    child: usize,
    line: fn(String) -> Line,
    said: &Sender<Said>,
) -> std::io::Result<()> {
    let said = said.clone();
    std::thread::Builder::new().name("listen".into()).spawn(move || {
        for text in BufReader::new(from).lines().map_while(Result::ok) {
            if said.send(Said { child, line: line(text) }).is_err() {
                break;
            }
        }
    })?;
    Ok(())
}

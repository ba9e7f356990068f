//! The short run, on the side that survives it: starts a process that probes the FMU, listens, waits no longer than
//! asked, and turns an end that nobody wanted into a finding.

use super::finding::{Finding, Place};
use super::probe::MARK;
use super::rules;
use super::{Report, Severity};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

/// How the run is started.
#[derive(Clone, Debug)]
pub struct Runner {
    /// A program and its first arguments that call [`super::probe`] with the path that follows.
    pub command: (PathBuf, Vec<String>),
    /// How long the whole run may take.
    pub patience: Duration,
}

impl Runner {
    /// Runs the FMU and adds what came out.
    pub(super) fn run(&self, path: &Path, report: &mut Report) {
        let skip = |reason: &str, report: &mut Report| {
            let mend = "mend what is found above, or run it in a tool that knows it";
            let place = Place::file("short run");
            report.findings.push(Finding::new(&rules::NOT_RUN, place, reason, "a short run", mend));
        };
        let broken = |rule| report.findings.iter().any(|finding| std::ptr::eq(finding.rule, rule));
        if broken(&rules::ARCHIVE)
            || broken(&rules::METHOD)
            || broken(&rules::NO_DESCRIPTION)
            || broken(&rules::MALFORMED)
            || broken(&rules::VERSION)
        {
            return skip("nothing to run", report);
        }
        if !report.co_simulation {
            return skip("no co-simulation", report);
        }
        match self.start(path) {
            Ok((child, output)) => self.judge(child, output, report),
            Err(error) => skip(&format!("the process for it did not start: {error}"), report),
        }
    }

    fn start(&self, path: &Path) -> std::io::Result<(Child, Receiver<String>)> {
        let (program, arguments) = &self.command;
        let mut child = Command::new(program)
            .args(arguments)
            .arg(path)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let (sender, receiver) = sync_channel(1024);
        if let Some(output) = child.stdout.take() {
            // Read aside, so that a child that hangs does not take this process with it.
            std::thread::spawn(move || {
                for line in BufReader::new(output).split(b'\n').map_while(Result::ok) {
                    let _ = sender.send(String::from_utf8_lossy(&line).trim_end().to_owned());
                }
            });
        }
        Ok((child, receiver))
    }

    fn judge(&self, mut child: Child, lines: Receiver<String>, report: &mut Report) {
        let until = Instant::now() + self.patience;
        let (mut stage, mut done) = ("starting".to_owned(), false);
        let needs_tool = report.findings.iter().any(|f| std::ptr::eq(f.rule, &rules::EXECUTION_TOOL));
        let mut hangs = false;
        loop {
            // A line that waits is received in no time too: one that prints without end must not go on for ever.
            let left = until.saturating_duration_since(Instant::now());
            let next = if left.is_zero() { Err(RecvTimeoutError::Timeout) } else { lines.recv_timeout(left) };
            match next {
                Ok(line) => {
                    match line.strip_prefix(MARK).map(|rest| rest.split_once(' ').unwrap_or((rest, ""))) {
                        Some(("stage", name)) => name.clone_into(&mut stage),
                        // Both runs of the probe may meet the same thing.
                        Some(("finding", json)) => {
                            report
                                .findings
                                .extend(finding(json).filter(|one| !report.findings.contains(one)));
                        }
                        Some(("done", _)) => done = true,
                        _ => {}
                    }
                }
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => {
                    hangs = true;
                    break;
                }
            }
        }
        // Code that closes its output may go on all the same.
        while !hangs && matches!(child.try_wait(), Ok(None)) {
            hangs = Instant::now() >= until;
            std::thread::sleep(Duration::from_millis(2));
        }
        if hangs {
            let _ = child.kill();
        }
        let ended = child.wait();
        let place = Place::file("short run");
        if hangs {
            let found = format!("no end within {} s, in {stage}", self.patience.as_secs());
            let mend = "find out what it waits for; give it more time with --patience";
            report.findings.push(Finding::new(&rules::RUN_HANG, place, found, "an answer", mend));
        } else if !done {
            let how = ended.map_or_else(|error| error.to_string(), died);
            let mend = "run the same calls in a debugger";
            let found = format!("the process died ({how}) in {stage}");
            report.findings.push(Finding::new(&rules::RUN_CRASH, place, found, "a call that returns", mend));
        }
        let failed = report
            .findings
            .iter()
            .any(|finding| finding.place.file == "short run" && finding.rule.severity == Severity::Error);
        let outcome = match (failed, needs_tool) {
            (false, _) => {
                "instantiated twice, initialised, read, stepped, reset and run again: nothing went wrong"
            }
            (true, true) => "failed; the FMU says that it needs its tool on this machine",
            (true, false) => "failed",
        };
        report.fact("short run", outcome);
    }
}

/// A finding as the other process wrote it.
fn finding(json: &str) -> Option<Finding> {
    let value: Value = serde_json::from_str(json).ok()?;
    let text = |key: &str| value.get(key).and_then(Value::as_str).map(str::to_owned);
    let id = text("rule")?;
    let rule = rules::ALL.iter().find(|rule| rule.id == id)?;
    let place = Place { variable: text("variable"), ..Place::file(text("file")?) };
    Some(Finding::new(rule, place, text("found")?, text("expected")?, text("mend")?))
}

#[cfg(unix)]
fn died(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt;
    match status.signal() {
        Some(11) => "signal 11, a memory fault".to_owned(),
        Some(6) => "signal 6, an abort".to_owned(),
        Some(signal) => format!("signal {signal}"),
        None => status.to_string(),
    }
}

#[cfg(not(unix))]
fn died(status: ExitStatus) -> String {
    status.to_string()
}

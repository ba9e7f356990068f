//! Starts broker and federates, watches over them until the end, and puts together what they leave. A federate that dies
//! is taken out of the federation, so that the others go on; a broker that dies takes all of them with it.

use super::super::Failure;
use super::children::{Line, Said, Started, bury, spawn};
use super::merge::Remains;
use super::{Core, FederateArgs, broker, failed, helics_cli, member, merge};
use crate::federation::{Federation, Helics};
use crate::harness::scenario::GRID;
use crate::harness::whole::write_whole;
use crate::scenario::Resolved;
use clap::ValueEnum;
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, WrapErr};
use std::collections::BTreeSet;
use std::net::TcpListener;
use std::path::Path;
use std::process::ExitStatus;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// How long a broker may take until federates may come.
const BROKER_START: Duration = Duration::from_secs(20);
/// Ports tried for it.
const BROKER_TRIALS: u32 = 4;
/// How long an orderly end may take.
const LAST_WORDS: Duration = Duration::from_secs(20);

/// Runs the whole federation, or all of it that is not left to others.
pub fn run(args: &FederateArgs, resolved: &Resolved, federation: &Federation) -> Result<(), Failure> {
    let mut names = federation.names();
    for name in &args.without {
        federation.share(name).map_err(failed)?;
        names.retain(|known| known != name);
    }
    let scenario = &resolved.scenario;
    let is_alone = scenario.compare.is_empty() && scenario.trials.is_empty();
    if !args.quiet && !is_alone {
        eprintln!(
            "note: a federation runs the scenario alone; its `compare` and `trials` are those of `bess run`"
        );
    }
    // A missing library is told once, by this process.
    let helics = args.helics()?;
    let folder = args.folder(resolved);
    std::fs::create_dir_all(&folder).into_diagnostic().wrap_err_with(|| folder.display().to_string())?;
    write_runner_file(args, resolved, &names, &folder)?;
    let begun = Instant::now();
    let (said, listener) = channel();
    let mut watched = Watched {
        args,
        helics: &helics,
        children: Vec::new(),
        broker: None,
        said,
        bar: super::super::run::bar(args.quiet),
        stepping_s: 0.0,
        has_begun: vec![false; names.len()],
        lost: BTreeSet::new(),
    };
    let broker_name = watched.start_broker(names.len() + args.without.len(), &listener)?;
    if !args.without.is_empty() {
        eprintln!("waiting for {} at {broker_name}", args.without.join(", "));
    }
    merge::clear(&folder, &names)?;
    for name in &names {
        let words = args.member(name, &broker_name, &folder);
        let child = watched.spawn(name, &words, watched.children.len())?;
        watched.children.push(child);
    }
    let ended = watched.watch(&listener, &broker_name, &folder);
    watched.bar.finish_and_clear();
    // The broker has nothing to do any more; who is left is ended here.
    drop(watched);
    let ended = ended?;
    let took =
        if ended.stepping_s > 0.0 { Duration::from_secs_f64(ended.stepping_s) } else { begun.elapsed() };
    let remains = Remains { folder: &folder, names: &names, took };
    merge::conclude(args, resolved, federation, &remains, &ended)
}

/// What became of the federates.
#[derive(Debug, Default)]
pub struct Ended {
    /// Those that died, and how.
    pub died: Vec<(String, String)>,
    /// What ended all of it too early.
    pub broken: Option<String>,
    /// Wall time of the slowest federate's run, s; without the time in which processes started and found each other.
    pub stepping_s: f64,
}

struct Watched<'a> {
    args: &'a FederateArgs,
    helics: &'a Helics,
    children: Vec<Started>,
    broker: Option<Started>,
    said: Sender<Said>,
    bar: ProgressBar,
    stepping_s: f64,
    /// Of each child, whether it has told of any progress.
    has_begun: Vec<bool>,
    /// Whom the children have lost at the end.
    lost: BTreeSet<String>,
}

impl Watched<'_> {
    fn spawn(&self, name: &str, words: &[String], number: usize) -> Result<Started, Failure> {
        spawn((name, number), words, self.helics, &self.said)
    }

    /// Starts a broker, unless there is one; its name for federates. A port that somebody else has taken since it was
    /// looked at is given up for another, unless it was asked for.
    fn start_broker(&mut self, federates: usize, listener: &Receiver<Said>) -> Result<String, Failure> {
        let args = self.args;
        if args.broker.is_some() {
            return Ok(args.broker_name(args.address().port));
        }
        for trial in 1..BROKER_TRIALS {
            match self.try_broker(federates, listener, trial) {
                Err(_) if args.port.is_none() && args.core != Core::Ipc => {}
                done => return done,
            }
        }
        self.try_broker(federates, listener, BROKER_TRIALS)
    }

    fn try_broker(
        &mut self,
        federates: usize,
        listener: &Receiver<Said>,
        trial: u32,
    ) -> Result<String, Failure> {
        let args = self.args;
        let port = match args.port {
            Some(port) => port,
            None => free_port(&args.listen, args.core, federates, trial)
                .into_diagnostic()
                .wrap_err_with(|| args.listen.clone())?,
        };
        let name = args.broker_name(port);
        let place = match args.core {
            Core::Ipc => format!(" --local_interface={name}"),
            _ => format!(" --port={port} --local_interface={}", args.listen),
        };
        let options = format!("-f{federates} --dynamic --loglevel=error{place}");
        let words = [broker::BROKER, args.core.name(), &name, &options].map(str::to_owned);
        self.broker = Some(self.spawn("broker", &words, usize::MAX)?);
        let until = Instant::now() + BROKER_START;
        let mut complaints = Vec::new();
        while Instant::now() < until {
            match listener.recv_timeout(Duration::from_millis(50)) {
                Ok(Said { line: Line::Out(line), .. }) if line.starts_with(broker::READY) => return Ok(name),
                Ok(Said { line: Line::Out(line) | Line::Error(line), .. }) => complaints.push(line),
                Err(_) if self.broker.as_mut().is_some_and(|broker| broker.ended().is_some()) => break,
                Err(_) => {}
            }
        }
        let complaints = complaints.join("\n");
        Err(miette::miette!(
            help = "another port: --port",
            "the broker did not start ({options})\n{complaints}"
        )
        .into())
    }

    /// Until all federates have ended.
    fn watch(
        &mut self,
        listener: &Receiver<Said>,
        broker_name: &str,
        folder: &Path,
    ) -> Result<Ended, Failure> {
        let mut ended = Ended::default();
        let mut known: Vec<bool> = vec![false; self.children.len()];
        let mut last_call: Option<Instant> = None;
        loop {
            match listener.recv_timeout(Duration::from_millis(20)) {
                Ok(said) => {
                    self.show(said);
                    continue;
                }
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => {}
            }
            for k in 0..self.children.len() {
                let Some(child) = self.children.get_mut(k) else { continue };
                let (Some(status), Some(false)) = (child.ended(), known.get(k)) else { continue };
                known[k] = true;
                let name = child.name.clone();
                if status.success() {
                    continue;
                }
                ended.died.push((name.clone(), how(status)));
                // Who was never there cannot be taken out: the others would wait for it before the start.
                if self.has_begun.get(k) != Some(&true) && last_call.is_none() {
                    let reason = format!("{name} did not get as far as the start ({})", how(status));
                    self.stop_all(&reason);
                    last_call = Some(Instant::now());
                    ended.broken = Some(reason);
                    continue;
                }
                // Who ended by itself has left the federation properly.
                if cfg!(unix) && status.code().is_some() || last_call.is_some() {
                    continue;
                }
                if name == GRID {
                    self.stop_all(&format!("{GRID} has died ({})", how(status)));
                    last_call = Some(Instant::now());
                    ended.broken = Some(format!("{GRID} has died ({})", how(status)));
                    continue;
                }
                self.bar.suspend(|| {
                    let words = self.args.member(&name, broker_name, folder);
                    let command: Vec<String> = words.iter().map(|word| helics_cli::quoted(word)).collect();
                    eprintln!(
                        "{name} has died ({}); the others go on. To bring it back: bess {} --resume",
                        how(status),
                        command.join(" ")
                    );
                });
                self.bury(k, &name, broker_name, folder)?;
            }
            if known.iter().all(|known| *known) {
                break;
            }
            let is_gone = |broker: &mut Started| broker.ended().is_some_and(|status| !status.success());
            if last_call.is_none() && self.broker.as_mut().is_some_and(is_gone) {
                let status = self.broker.as_mut().and_then(Started::ended).map_or_else(String::new, how);
                let reason = format!("the broker has died ({status})");
                self.stop_all(&reason);
                ended.broken = Some(reason);
                last_call = Some(Instant::now());
            }
            if last_call.is_some_and(|since| since.elapsed() > LAST_WORDS) {
                break;
            }
        }
        while let Ok(said) = listener.try_recv() {
            self.show(said);
        }
        let abroad = self.lost.iter().filter(|name| !self.children.iter().any(|child| child.name == **name));
        ended.died.extend(abroad.map(|name| (name.clone(), "it fell silent".to_owned())));
        ended.stepping_s = self.stepping_s;
        Ok(ended)
    }

    fn stop_all(&mut self, reason: &str) {
        self.children.iter_mut().for_each(|child| child.stop(reason));
    }

    fn bury(&self, number: usize, name: &str, broker_name: &str, folder: &Path) -> Result<(), Failure> {
        if !bury(self.args, self.helics, (name, number), (broker_name, folder), &self.said)? {
            eprintln!("{name} could not be taken out of the federation: the others may wait for it for ever");
        }
        Ok(())
    }

    fn show(&mut self, Said { child, line }: Said) {
        let name = self.children.get(child).map_or("broker", |child| child.name.as_str());
        match line {
            Line::Out(line) => {
                let mut words = line.split(' ');
                let first = words.next();
                if let (Some(member::LOST), Some(name)) = (first, line.split(' ').nth(1)) {
                    self.lost.insert(name.to_owned());
                }
                let mut number = || words.next().and_then(|word| word.parse::<f64>().ok());
                if first == Some(member::TOOK) {
                    self.stepping_s = self.stepping_s.max(number().unwrap_or(0.0));
                } else if let (true, Some(t_s), Some(share)) =
                    (first == Some(member::PROGRESS), number(), number())
                {
                    if let Some(has_begun) = self.has_begun.get_mut(child) {
                        *has_begun = true;
                    }
                    let position = (share * 1000.0) as u64;
                    if position >= self.bar.position() {
                        self.bar.set_position(position);
                        self.bar.set_message(format!("{t_s:.0} s"));
                    }
                }
            }
            Line::Error(line) => self.bar.suspend(|| eprintln!("{name}: {line}")),
        }
    }
}

impl FederateArgs {
    /// The broker as `--broker` takes it.
    pub(super) fn broker_name(&self, port: u16) -> String {
        match (&self.broker, self.core) {
            (Some((host, _)), Core::Ipc) => host.clone(),
            (None, Core::Ipc) => format!("bess{}", std::process::id()),
            (Some((host, given)), _) => named(host, given.unwrap_or(port)),
            (None, _) => named(&self.listen, port),
        }
    }

    /// The command line of one federate.
    pub(super) fn member(&self, name: &str, broker_name: &str, folder: &Path) -> Vec<String> {
        let mut words = vec!["federate".to_owned(), self.scenario.scenario.clone()];
        let mut option = |name: &str, value: String| words.extend([name.to_owned(), value]);
        for (path, value) in &self.scenario.set {
            option("--set", format!("{path}={value}"));
        }
        option("--federate", name.to_owned());
        option("--broker", broker_name.to_owned());
        option("--core", self.core.name().to_owned());
        option("-o", folder.join(name).display().to_string());
        for (key, fmu) in [("--controller", &self.controller), ("--grid", &self.grid)] {
            if let Some(fmu) = fmu {
                option(key, fmu.display().to_string());
            }
        }
        option("--wait", format!("{}s", self.wait as f64 / 1e9));
        option("--patience", format!("{}s", self.patience as f64 / 1e9));
        if let Some(every_ns) = self.checkpoint {
            option("--checkpoint", format!("{}s", every_ns as f64 / 1e9));
        }
        let parts = self.parts.and_then(|parts| parts.to_possible_value());
        for (option, value) in [("--publish", self.publish.to_possible_value()), ("--parts", parts)] {
            words.extend(value.map(|value| format!("{option}={}", value.get_name())));
        }
        words
    }
}

/// As `--broker` reads it: the colons of an IPv6 address are none before a port.
pub(super) fn named(host: &str, port: u16) -> String {
    if host.contains(':') { format!("[{host}]:{port}") } else { format!("{host}:{port}") }
}

fn how(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return format!("signal {signal}");
    }
    status.to_string()
}

/// A port with room behind it: zmq wants two for the broker, and every federate takes two from there on. Below the ports
/// that systems give to anybody who asks, so that nobody comes in between. Each trial begins elsewhere.
fn free_port(listen: &str, core: Core, federates: usize, trial: u32) -> std::io::Result<u16> {
    const FIRST: u32 = 12_000;
    const STARTS: u32 = 256;
    const SPACE: u32 = 64;
    if core == Core::Ipc {
        return Ok(0);
    }
    let wanted = 4 + 2 * federates as u32;
    let is_free = |port: u32| u16::try_from(port).is_ok_and(|port| TcpListener::bind((listen, port)).is_ok());
    // A wrong address is told as such.
    TcpListener::bind((listen, 0))?;
    for k in 0..STARTS {
        let first = FIRST + (std::process::id() + 97 * trial + k) % STARTS * SPACE;
        if (first..first + wanted).all(is_free) {
            return Ok(first as u16);
        }
    }
    Err(std::io::Error::other("no free ports next to each other from 12000 on; name one with --port"))
}

fn write_runner_file(
    args: &FederateArgs,
    resolved: &Resolved,
    names: &[String],
    folder: &Path,
) -> Result<(), Failure> {
    let document = helics_cli::document(args, &resolved.scenario.name, names, folder);
    let path = folder.join(helics_cli::FILE);
    let text = serde_json::to_string_pretty(&document).into_diagnostic()? + "\n";
    Ok(write_whole(&path, &[text.as_bytes()])
        .into_diagnostic()
        .wrap_err_with(|| path.display().to_string())?)
}

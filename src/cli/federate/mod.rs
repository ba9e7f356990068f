//! `bess federate`: a scenario as federates of HELICS, each a process of its own, here or on several machines.

mod broker;
mod children;
mod helics_cli;
mod member;
mod merge;
mod runner;
mod vigil;
mod watch;

pub use broker::{BROKER, BrokerArgs, serve};

use super::{Failure, ScenarioArgs, duration, results_folder};
use crate::federation::{Address, Federation, FederationError, Form, Helics};
use crate::harness::{Cast, Origin, stage_apart};
use crate::models::fleet::Cut;
use crate::scenario::Resolved;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::sync::Arc;

/// How federates and broker talk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Core {
    /// ZeroMQ, HELICS's default
    #[default]
    Zmq,
    /// Plain TCP
    Tcp,
    /// Shared memory, on one machine only
    Ipc,
}

impl Core {
    fn name(self) -> &'static str {
        match self {
            Core::Zmq => "zmq",
            Core::Tcp => "tcp",
            Core::Ipc => "ipc",
        }
    }

    /// HELICS's own default for a broker.
    fn port(self) -> u16 {
        match self {
            Core::Zmq => 23404,
            Core::Tcp => 24160,
            Core::Ipc => 0,
        }
    }
}

/// What is a federate beside the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Parts {
    /// The controller of each cluster: cluster1, cluster2, ...
    Clusters,
    /// The controller of each battery: agent1, agent2, ...
    Agents,
    /// The controller of all batteries: controller
    Whole,
}

/// How the values between grid and controllers are published.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Publish {
    /// One vector for every array: grid/controller/P
    #[default]
    Vectors,
    /// One number for every element: grid/P/1
    Doubles,
    /// One vector for everything: grid/controller/all, the fewest messages
    Packed,
}

/// The command line of `bess federate`.
#[derive(Args, Clone)]
#[command(after_help = "Examples:
  bess federate case1                                        broker, grid, cluster1, cluster2: a process each
  bess federate case1 --parts agents --core tcp              one for every battery; they talk over TCP
  bess federate case1 --federate cluster2 --broker 10.0.0.5  one federate, on a machine of its own
  bess federate mine.json --without grid                     all but the grid: yours takes its place
  bess federate case1 --checkpoint 1s                        a federate that dies can come back:
  bess federate case1 --federate cluster2 --broker 127.0.0.1:23404 -o results/case1/cluster2 --resume

HELICS comes from `pip install helics==3.6.1`. DIR holds afterwards what `bess run` leaves (trajectory.csv, summary.json,
report.html), a folder for each federate with its own trajectory, and helics_runner.json for `helics run --path=`.
docs/distributed.md has the names that are published, and what happens when somebody dies.
Exit codes: 0 done, 1 the run failed, 2 the command line or the scenario is wrong, 3 a federate died and did not come back.")]
pub struct FederateArgs {
    #[command(flatten)]
    scenario: ScenarioArgs,
    /// Folder for the results [default: results/NAME, with --federate results/NAME/FEDERATE]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Run this federate alone
    #[arg(long, value_name = "NAME")]
    federate: Option<String>,
    /// The broker to join [default: one is started; with --federate 127.0.0.1]
    #[arg(long, value_name = "HOST[:PORT]", value_parser = parse_host)]
    broker: Option<(String, Option<u16>)>,
    /// How federates and broker talk
    #[arg(long, value_enum, default_value_t)]
    core: Core,
    /// Address on which the broker that is started listens, so that federates on other machines reach it
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1", conflicts_with_all = ["federate", "broker"])]
    listen: String,
    /// Port of the broker that is started [default: a free one]
    #[arg(long, value_name = "PORT", conflicts_with_all = ["federate", "broker"])]
    port: Option<u16>,
    /// Leave a federate to somebody else (repeatable)
    #[arg(long, value_name = "NAME", conflicts_with = "federate")]
    without: Vec<String>,
    /// How the values between grid and controllers are published
    #[arg(long, value_enum, default_value_t)]
    publish: Publish,
    /// What is a federate beside the grid [default: clusters, or whole with an FMU in the controller's place]
    #[arg(long, value_enum, conflicts_with = "controller")]
    parts: Option<Parts>,
    /// FMU in the controller's place, a federate as a whole [default: control.fmu, or the built-in model]
    #[arg(long, value_name = "FMU")]
    controller: Option<PathBuf>,
    /// FMU in the grid's place [default: grid.fmu, or the built-in model]
    #[arg(long, value_name = "FMU")]
    grid: Option<PathBuf>,
    /// Let every federate keep its state every so many simulated seconds (or 500ms, 2min, 1h), for --resume
    #[arg(long, value_name = "EVERY", value_parser = duration::parse)]
    checkpoint: Option<i64>,
    /// With --federate: come back into a federation under way, from the checkpoint in DIR
    #[arg(long, requires = "federate")]
    resume: bool,
    /// How long to look for the broker
    #[arg(long, value_name = "TIME", default_value = "30s", value_parser = duration::parse)]
    wait: i64,
    /// After how long in one exchange to ask who is still there; who does not answer is taken out, whoever started it
    #[arg(long, value_name = "TIME", default_value = "20s", value_parser = duration::parse)]
    patience: i64,
    /// libhelics, or a folder with it [default: $BESS_HELICS, the package helics of python3, the system's]
    #[arg(long, value_name = "PATH")]
    helics: Option<PathBuf>,
    /// Print what is published, with names, types and units, and run nothing
    #[arg(long)]
    topics: bool,
    /// No report.html
    #[arg(long)]
    no_report: bool,
    /// No progress bar and no table
    #[arg(short, long)]
    quiet: bool,
    /// Talk to the process that started this one
    #[arg(long, hide = true)]
    child: bool,
    /// Leave the federation in the name of a federate that has died
    #[arg(long, hide = true, requires = "federate")]
    bury: bool,
}

/// Runs the federation, or the part of it that is asked for.
pub fn federate(args: &FederateArgs) -> Result<(), Failure> {
    let resolved = args.scenario.resolve()?;
    let federation = args.federation(&resolved)?;
    if args.topics {
        return super::print(&topics_table(&federation));
    }
    let Some(name) = &args.federate else { return runner::run(args, &resolved, &federation) };
    // A wrong name shall not wait for a library, nor a missing library for a broker.
    federation.share(name).map_err(failed)?;
    let helics = args.helics()?;
    let done = match args.bury {
        true => member::bury(args, &helics, federation, name),
        false => member::run(args, &helics, (&resolved, federation), name),
    };
    end(helics, done)
}

/// Says how it went and ends the process, whatever HELICS still waits for.
fn end(helics: Arc<Helics>, done: Result<(), Failure>) -> ! {
    let code = match done {
        Ok(()) => 0,
        Err(Failure { report, code }) => {
            eprintln!("{report:?}");
            code
        }
    };
    helics.end_process(code)
}

impl FederateArgs {
    fn federation(&self, resolved: &Resolved) -> Result<Federation, Failure> {
        let named = Cast::of(resolved);
        let of = |fmu: &Option<PathBuf>, named: Origin| fmu.clone().map_or(named, Origin::Fmu);
        // Somebody else's controller is in one part; who asks for parts has our own.
        let (controller, cut) = match (self.parts, of(&self.controller, named.controller)) {
            (Some(Parts::Whole), controller) | (None, controller @ Origin::Fmu(_)) => (controller, None),
            (None | Some(Parts::Clusters), _) => (Origin::InProcess, Some(Cut::Clusters)),
            (Some(Parts::Agents), _) => (Origin::InProcess, Some(Cut::Agents)),
        };
        let cast = Cast { controller, grid: of(&self.grid, named.grid) };
        let apart = stage_apart(resolved, &cast, cut).map_err(|error| super::run::failed(&error))?;
        let form = match self.publish {
            Publish::Vectors => Form::Vectors,
            Publish::Doubles => Form::Doubles,
            Publish::Packed => Form::Packed,
        };
        Federation::new(apart, form).map_err(failed)
    }

    fn helics(&self) -> Result<Arc<Helics>, Failure> {
        Helics::load(self.helics.as_deref()).map(Arc::new).map_err(failed)
    }

    /// The broker that is named, or HELICS's usual place for one.
    fn address(&self) -> Address {
        let (host, port) = self.broker.clone().unwrap_or_else(|| ("127.0.0.1".into(), None));
        let port = port.unwrap_or(self.core.port());
        let try_ms = (self.wait / 1_000_000 / i64::from(TRIES)).max(1);
        let options = format!("{CORE_OPTIONS} --networktimeout={try_ms}ms --networkretries={}", TRIES - 1);
        Address { core: self.core.name().into(), host, port, options }
    }

    fn folder(&self, resolved: &Resolved) -> PathBuf {
        let of_all = || results_folder(&resolved.scenario.name);
        let default = || self.federate.as_ref().map_or_else(of_all, |name| of_all().join(name));
        self.output.clone().unwrap_or_else(default)
    }
}

/// A federate looks after its broker when nothing has come for two seconds, and waits ten for an answer.
const CORE_OPTIONS: &str = "--tick=2s --timeout=10s --loglevel=error";

/// How often it looks for its broker.
const TRIES: u32 = 6;

/// `host`, `host:23404`, `[::1]:23404`.
fn parse_host(text: &str) -> Result<(String, Option<u16>), String> {
    let expected = "expected HOST or HOST:PORT, as 10.0.0.5:23404";
    let (host, port) = match text.rsplit_once(':') {
        Some((host, port)) if !host.contains(':') || host.ends_with(']') => (host, Some(port)),
        _ => (text, None),
    };
    let host = host.trim_start_matches('[').trim_end_matches(']');
    let port = port.map(|port| port.parse::<u16>().map_err(|_| expected.to_owned())).transpose()?;
    if host.is_empty() || port == Some(0) {
        return Err(expected.to_owned());
    }
    Ok((host.to_owned(), port))
}

/// What the user gave ends with code 2, everything else with 1.
fn failed(error: FederationError) -> Failure {
    let code = match error {
        FederationError::Unknown { .. }
        | FederationError::Algorithm
        | FederationError::Name { .. }
        | FederationError::TooLong { .. } => 2,
        _ => 1,
    };
    Failure { report: miette::miette!("{error}"), code }
}

fn topics_table(federation: &Federation) -> String {
    let mut text = String::from("publication\ttype\tunit\tinput of the receiver\tvariables\n");
    for topic in federation.topics() {
        let kind =
            if topic.is_double { "double".to_owned() } else { format!("vector[{}]", topic.variables.len()) };
        let unit = if topic.unit.is_empty() { "-" } else { &topic.unit };
        let variables = topic.variables.join(" ");
        text += &format!("{}\t{kind}\t{unit}\t{}\t{variables}\n", topic.publication, topic.input);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brokers_are_named_as_people_write_them() {
        let table = [
            ("broker.lab", ("broker.lab", None)),
            ("10.0.0.5:23404", ("10.0.0.5", Some(23404))),
            ("[fe80::1]:24160", ("fe80::1", Some(24160))),
            ("fe80::1", ("fe80::1", None)),
        ];
        for (text, (host, port)) in table {
            assert_eq!(parse_host(text), Ok((host.to_owned(), port)), "{text}");
        }
        for (host, port) in [("10.0.0.5", 1), ("::1", 23404), ("broker.lab", 65535)] {
            assert_eq!(parse_host(&runner::named(host, port)), Ok((host.to_owned(), Some(port))));
        }
        for text in ["", ":1", "a:0", "a:b", "a:70000"] {
            assert!(parse_host(text).is_err(), "{text}");
        }
    }
}

//! The broker of a federation as a process of its own, which says when federates may come.

use super::super::{Failure, print};
use super::watch::Watch;
use super::{Core, end, failed};
use crate::federation::{Broker, Helics};
use clap::Args;
use miette::IntoDiagnostic;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// The hidden command that the broker's process is started with.
pub const BROKER: &str = "serve-broker";
/// What it prints when federates may come.
pub const READY: &str = "ready";

/// The command line of that process.
#[derive(Args)]
pub struct BrokerArgs {
    /// How federates and broker talk
    #[arg(value_enum)]
    core: Core,
    /// Its name, by which ipc finds it
    name: String,
    /// Options as helics_broker takes them
    #[arg(allow_hyphen_values = true)]
    options: String,
    /// libhelics
    #[arg(long)]
    helics: Option<PathBuf>,
}

/// Serves until all federates have left, or nobody is there who wants it.
pub fn serve(args: &BrokerArgs) -> Result<(), Failure> {
    let helics = Helics::load(args.helics.as_deref()).map(Arc::new).map_err(failed)?;
    let done = until_the_end(args, &helics);
    end(helics, done)
}

fn until_the_end(args: &BrokerArgs, helics: &Arc<Helics>) -> Result<(), Failure> {
    let watch = Watch::start(helics).into_diagnostic()?;
    let broker = Broker::start(helics, args.core.name(), &args.name, &args.options).map_err(failed)?;
    if !broker.is_connected() {
        return Err(miette::miette!(
            help = "another port: --port; is another broker running there?",
            "the broker cannot listen ({})",
            args.options
        )
        .into());
    }
    print(&format!("{READY} {}\n", broker.address()))?;
    while watch.reason().is_none() {
        if broker.wait(Duration::from_millis(200)).map_err(failed)? {
            break;
        }
    }
    drop(broker);
    Ok(())
}

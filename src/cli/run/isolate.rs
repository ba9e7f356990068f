//! `--isolate`: how FMUs get processes of their own out of this very program, and what such a process does.

use super::super::Failure;
use crate::harness::{Cast, Isolation, Origin, isolation};
use clap::Args;
use miette::IntoDiagnostic;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// The hidden command that an FMU's process is started with.
pub const WORKER: &str = "serve-fmu";

/// The command line of that process.
#[derive(Args)]
pub struct WorkerArgs {
    /// Where the FMU is unpacked
    folder: PathBuf,
    /// The FMU
    path: PathBuf,
    /// Name of the participant
    name: String,
    /// The process that asks
    parent: u32,
}

/// Answers calls until the other side goes.
pub fn work(args: &WorkerArgs) -> Result<(), Failure> {
    Ok(isolation::serve(&args.folder, &args.path, &args.name, args.parent).into_diagnostic()?)
}

/// Processes of this program; what FMUs print goes to standard error, after the name of the participant.
pub fn isolation(call_limit_ns: i64) -> Result<Isolation, Failure> {
    let program = std::env::current_exe().into_diagnostic()?;
    Ok(Isolation {
        command: (program, vec![WORKER.to_owned(), "--".to_owned()]),
        call_limit: Duration::from_nanos(call_limit_ns.unsigned_abs()),
        output: Some(Arc::new(|name: &str, line: &str| eprintln!("{name}: {line}"))),
    })
}

/// Whether an FMU takes part at all.
pub fn has_fmu(cast: &Cast) -> bool {
    [&cast.controller, &cast.grid].into_iter().any(|origin| matches!(origin, Origin::Fmu(_)))
}

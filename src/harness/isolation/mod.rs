//! An FMU in a process of its own: [`start`] makes the participant on this side, [`serve`] is the loop on the other one,
//! `protocol` what travels between them. A crash or a hang of the FMU ends its process and is an error here. No
//! sandbox: the FMU's code still runs with the user's rights. Unix only, for want of a trial elsewhere.

#[cfg(unix)]
mod isolated;
#[cfg(unix)]
mod process;
#[cfg(unix)]
mod protocol;
#[cfg(unix)]
mod worker;

#[cfg(unix)]
pub use isolated::Isolated;
#[cfg(unix)]
pub use worker::serve;

use super::error::HarnessError;
use super::participant::Participant;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Takes what an FMU prints, line by line, with the name of the participant.
pub type Output = dyn Fn(&str, &str) + Send + Sync;

/// How FMUs are isolated.
#[derive(Clone)]
pub struct Isolation {
    /// A program and its first arguments that call [`serve`] with the four that follow.
    pub command: (PathBuf, Vec<String>),
    /// How long one call may take; the process is ended after that.
    pub call_limit: Duration,
    /// Where lines go that the FMU writes to standard output and standard error; nowhere if there is none.
    pub output: Option<Arc<Output>>,
}

/// An FMU in a process of its own.
#[cfg(unix)]
pub fn start(path: &Path, name: &str, isolation: &Isolation) -> Result<Box<dyn Participant>, HarnessError> {
    Ok(Box::new(Isolated::start(path, name, isolation)?))
}

/// Refuses: nobody has tried it on this system.
#[cfg(not(unix))]
pub fn start(_: &Path, name: &str, _: &Isolation) -> Result<Box<dyn Participant>, HarnessError> {
    let source = super::participant::CallError::new("starting its process", "isolation needs a Unix system");
    Err(HarnessError::Call { participant: name.to_owned(), source })
}

/// Refuses: nobody has tried it on this system.
#[cfg(not(unix))]
pub fn serve(_: &Path, _: &Path, _: &str, _: u32) -> std::io::Result<()> {
    Err(std::io::Error::other("isolation needs a Unix system"))
}

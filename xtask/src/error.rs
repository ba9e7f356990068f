//! What can go wrong in a task, said in one line each.

use std::path::PathBuf;

/// Why a task stopped.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// A program ended with a non-zero exit code or a signal.
    #[error("`{command}` failed ({status})")]
    Command {
        /// The command line, as one would type it.
        command: String,
        /// Exit code or signal.
        status: std::process::ExitStatus,
    },
    /// A program could not be started.
    #[error("cannot start `{command}`: {source}")]
    Start {
        /// The command line, as one would type it.
        command: String,
        /// Why.
        source: std::io::Error,
    },
    /// A file or folder could not be read or written.
    #[error("cannot {action} {path}: {source}", path = path.display())]
    File {
        /// `read`, `write`, ...
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Something from outside that cannot be had where this runs, and what could not be done for it.
    #[error("{0}")]
    Absent(String),
    /// Anything else: what was found, what was expected, how to mend it.
    #[error("{0}")]
    Other(String),
}

impl Failure {
    /// For `map_err` on file operations.
    pub fn file(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Failure {
        let path = path.into();
        move |source| Failure::File { action, path, source }
    }
}

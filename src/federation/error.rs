//! What can go wrong around a federation, with what mends it.

use super::library::WANTED;
use std::path::PathBuf;

/// Everything that keeps a federate from joining, or ends its part early.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum FederationError {
    #[error(
        "HELICS is not on this machine; looked for {looked}. Install it with `pip install helics=={WANTED}`, or name its \
         shared library with --helics"
    )]
    Absent { looked: String },

    #[error("{}: cannot be loaded as HELICS ({reason}); expected libhelics of HELICS {WANTED}", path.display())]
    Load { path: PathBuf, reason: String },

    #[error(
        "{}: is HELICS {found}; expected {WANTED} or a later 3.x. Install it with `pip install helics=={WANTED}`",
        path.display()
    )]
    Version { path: PathBuf, found: String },

    #[error("{federate}: {call}: {reason}{hint}")]
    Call { federate: String, call: &'static str, reason: String, hint: &'static str },

    #[error("a name for HELICS holds a NUL character: {text:?}")]
    Name { text: String },

    #[error("there is no federate \"{found}\" in this scenario; expected one of {known}")]
    Unknown { found: String, known: String },

    #[error(
        "master = gauss_seidel: a federation exchanges all values at the communication point; set master to \"jacobi\" \
         (--set master=jacobi)"
    )]
    Algorithm,

    #[error(
        "{federate} told nothing at t = {time_s:?} s and is gone; without it there is nothing to measure. Start the federation \
         again, or this federate with --resume once it is back"
    )]
    Gone { federate: String, time_s: f64 },

    #[error(
        "stop_s = {stop_s:?}: HELICS counts time in seconds, as a double, whose nanoseconds are exact to {longest_s:?} s; stop sooner"
    )]
    TooLong { stop_s: f64, longest_s: f64 },

    #[error("{what}: {source}")]
    Process { what: String, source: std::io::Error },
}

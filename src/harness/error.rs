//! Why a coupled run could not start or did not reach its end.

use super::archive::ArchiveError;
use super::checkpoint::CheckpointError;
use super::coupling::CouplingError;
use super::description::DescriptionError;
use super::library::LibraryError;
use super::observer::ObserverError;
use super::participant::CallError;

/// Everything that can go wrong between an `.fmu` file and the end of a run.
#[derive(Debug, thiserror::Error)]
pub enum HarnessError {
    /// The `.fmu` file could not be unpacked.
    #[error(transparent)]
    Archive(#[from] ArchiveError),

    /// Its `modelDescription.xml` could not be read.
    #[error(transparent)]
    Description(#[from] DescriptionError),

    /// Its shared library could not be loaded.
    #[error(transparent)]
    Library(#[from] LibraryError),

    /// Names or values of the plan do not fit the participants.
    #[error(transparent)]
    Coupling(#[from] CouplingError),

    /// A participant refused a call outside a run.
    #[error("{participant}: {source}")]
    Call {
        /// Its name.
        participant: String,
        /// What it refused.
        #[source]
        source: CallError,
    },

    /// A participant refused a call within a run.
    #[error("{participant} at t = {time_s:?} s: {source}")]
    Run {
        /// Its name.
        participant: String,
        /// Communication point, s.
        time_s: f64,
        /// What it refused.
        #[source]
        source: CallError,
    },

    /// A connected value does not fit the type of its target.
    #[error(
        "{from} = {found:?} at t = {time_s:?} s cannot become the {expected} {to}; expected a number in \
         the range of that type"
    )]
    Conversion {
        /// The output, `participant.variable`.
        from: String,
        /// The input, `participant.variable`.
        to: String,
        /// Value after factor and offset.
        found: f64,
        /// Type of the input.
        expected: super::value::Kind,
        /// Communication point, s.
        time_s: f64,
    },

    /// A checkpoint cannot be used, or not by this run.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),

    /// A position of another run.
    #[error("the position to go on from has {found} {what}; expected {expected}: it is another run's")]
    Position {
        /// What there is another number of.
        what: &'static str,
        /// In the position.
        found: usize,
        /// In the run.
        expected: usize,
    },

    /// The results could not be kept.
    #[error(transparent)]
    Observer(#[from] ObserverError),
}

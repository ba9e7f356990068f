//! Random calls on the C interface of an FMU, with what must come of each: the sequences behind the coverage-guided
//! target, the seeded run and miri, and the long runs. Needs no FMU on disk: it calls the same `extern "C"`
//! functions that the shared libraries export.
//!
//! What no library can detect is not called: freed pointers, arrays shorter than their count, one component in two
//! threads at once. "Stale" states are those that belong to another instance, another FMU, an earlier life of the
//! instance, or are NULL after they were freed.
#![cfg_attr(miri, feature(c_variadic))]
#![allow(non_upper_case_globals, reason = "the constants are C's")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a finding is a panic")]

pub mod choices;
pub mod fmus;
pub mod functions;
pub mod log;
pub mod seeded;
pub mod soak;
pub mod stranger;
pub mod subject;
pub mod tally;
pub mod verdict;
pub mod world;

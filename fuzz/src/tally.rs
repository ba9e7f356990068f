//! How often each function was called, and with what outcome: what shows that a run reached everything.

use bess_consensus::fmi::Function;
use bess_consensus::fmi::bindings::*;
use std::fmt;

const FUNCTIONS: usize = 34;
const OUTCOMES: usize = 5;

/// Calls by function and fmi2Status.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tally([[u64; OUTCOMES]; FUNCTIONS]);

impl Default for Tally {
    fn default() -> Self {
        Self([[0; OUTCOMES]; FUNCTIONS])
    }
}

impl Tally {
    /// One more.
    pub fn count(&mut self, function: Function, status: fmi2Status) {
        self.0[function as usize][status as usize] += 1;
    }

    /// All of another run too.
    pub fn add(&mut self, other: &Tally) {
        for (mine, others) in self.0.iter_mut().flatten().zip(other.0.iter().flatten()) {
            *mine += others;
        }
    }

    /// Number of calls.
    pub fn calls(&self) -> u64 {
        self.0.iter().flatten().sum()
    }

    /// Calls of one function that had this outcome.
    pub fn of(&self, function: Function, status: fmi2Status) -> u64 {
        self.0[function as usize][status as usize]
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<30}{:>12}{:>12}{:>12}{:>8}", "function", "OK", "discard", "error", "fatal")?;
        for &function in Function::ALL {
            let of = |status| self.of(function, status);
            let [ok, discard, error, fatal] =
                [fmi2Status_fmi2OK, fmi2Status_fmi2Discard, fmi2Status_fmi2Error, fmi2Status_fmi2Fatal]
                    .map(of);
            writeln!(f, "{:<30}{ok:>12}{discard:>12}{error:>12}{fatal:>8}", function.name())?;
        }
        write!(f, "{:<30}{:>12}", "all", self.calls())
    }
}

//! What can go wrong in the grid room, with the numbers a user needs to mend it. Never holds text
//! for a particular front end.

/// Why the grid room refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GridError {
    /// The text of a case or configuration cannot be read.
    #[error("line {line}: {message}")]
    Syntax {
        /// Line, counted from 1.
        line: usize,
        /// What is wrong, what was expected.
        message: String,
    },
    /// A value that cannot be used.
    #[error("{path}: found {found}; expected {expected}")]
    Invalid {
        /// Path of the key, as in JSON: `bess[2].bus`.
        path: String,
        /// What is there.
        found: String,
        /// What would be accepted.
        expected: String,
    },
    /// Newton's method found no power flow.
    #[error(
        "power flow of case \"{case}\": no solution after {iterations} iterations; the largest mismatch is \
         {mismatch_pu:.3e} pu of {quantity} power at bus {bus}; check the data around that bus, or reduce the load"
    )]
    PowerFlow {
        /// Name of the case.
        case: String,
        /// Iterations made.
        iterations: usize,
        /// Largest mismatch, pu of the system base.
        mismatch_pu: f64,
        /// "active" or "reactive".
        quantity: &'static str,
        /// Id of the bus with the largest mismatch.
        bus: u64,
    },
    /// The network equations have no unique solution.
    #[error(
        "the network equations of {what} are singular; check for buses without any path to a source and for \
         load changes that cancel the network's own admittance"
    )]
    Singular {
        /// Which equations.
        what: &'static str,
    },
    /// No synchronous steady state of the given inputs.
    #[error(
        "no steady state of the given inputs after {iterations} iterations (last correction {correction:.3e}); \
         {hint}"
    )]
    SteadyState {
        /// Iterations made.
        iterations: usize,
        /// Largest correction of the last iteration, pu or rad.
        correction: f64,
        /// What to look at.
        hint: &'static str,
    },
    /// The bus voltages of constant-power or constant-current loads were not found.
    #[error(
        "the voltages of the constant-power loads do not converge (residual {residual:.3e} pu): voltage collapse; \
         reduce the load or use the impedance load model"
    )]
    Loads {
        /// Last change of a bus voltage, pu.
        residual: f64,
    },
    /// The integration cannot go on.
    #[error(
        "step at {start_s} s: integration stopped {offset_s:.6e} s after its start, {reason} (internal step \
         {step_s:.3e} s); the state is unchanged; check the setpoints and droop gains"
    )]
    Step {
        /// Communication point at which the step began, s.
        start_s: f64,
        /// Time integrated within the step, s.
        offset_s: f64,
        /// Internal step size, s.
        step_s: f64,
        /// Why.
        reason: &'static str,
    },
    /// A call that makes no sense now.
    #[error("{what}: {why}")]
    Misuse {
        /// The call.
        what: &'static str,
        /// Why it is refused, and what to do first.
        why: &'static str,
    },
}

impl GridError {
    /// A value that cannot be used.
    pub(crate) fn invalid(
        path: impl Into<String>,
        found: impl std::fmt::Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Invalid { path: path.into(), found: found.to_string(), expected: expected.into() }
    }
}

/// Refuses NaN and infinities.
pub(crate) fn finite(path: impl FnOnce() -> String, value: f64) -> Result<(), GridError> {
    if value.is_finite() { Ok(()) } else { Err(GridError::invalid(path(), value, "a finite number")) }
}

/// Refuses what is not greater than zero.
pub(crate) fn positive(path: impl FnOnce() -> String, value: f64) -> Result<(), GridError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(GridError::invalid(path(), value, "a number greater than 0"))
    }
}

/// Refuses negative values.
pub(crate) fn not_negative(path: impl FnOnce() -> String, value: f64) -> Result<(), GridError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(GridError::invalid(path(), value, "a number not less than 0"))
    }
}

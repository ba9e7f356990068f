//! What the master sees of a model, wherever it runs: an FMU in this process ([`super::Slave`]), a
//! model of ours without any C (`InProcess`), or a mock of a test.

use super::description::Variable;
use std::fmt;

/// One participant of a coupled simulation. Times are counted in ns; value references are those of
/// [`Participant::variables`]. A call that fails may leave the participant unusable.
pub trait Participant {
    /// The name under which the plan and the results know it.
    fn name(&self) -> &str;

    /// All variables.
    fn variables(&self) -> &[Variable];

    /// Whether steps of different lengths are allowed; events between communication points need it.
    fn can_vary_step(&self) -> bool {
        true
    }

    /// What a state of this participant belongs to: equal for two whose states mean the same.
    fn identity(&self) -> String {
        String::new()
    }

    /// fmi2SetupExperiment.
    fn setup(&mut self, start_ns: i64, stop_ns: Option<i64>) -> Result<(), CallError>;
    /// fmi2EnterInitializationMode.
    fn enter_initialization(&mut self) -> Result<(), CallError>;
    /// fmi2ExitInitializationMode.
    fn exit_initialization(&mut self) -> Result<(), CallError>;

    /// Reads Reals; as many values as references.
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError>;
    /// Reads Integers.
    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError>;
    /// Reads Booleans as C integers, nonzero being true.
    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError>;
    /// Sets Reals.
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError>;
    /// Sets Integers.
    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError>;
    /// Sets Booleans as C integers, 0 or 1.
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError>;

    /// Advances from `t_ns` by `h_ns` > 0 with the inputs held.
    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError>;
    /// Ends the run; a second call does nothing.
    fn terminate(&mut self) -> Result<(), CallError>;
    /// Back to the state after instantiation.
    fn reset(&mut self) -> Result<(), CallError>;

    /// Keeps a copy of the whole state inside the participant.
    fn save_state(&mut self) -> Result<StateHandle, CallError>;
    /// Goes back to a kept state, which stays kept.
    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError>;
    /// Forgets a kept state; an unknown handle is ignored.
    fn forget_state(&mut self, state: StateHandle);
    /// A kept state as bytes, for another process.
    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError>;
    /// Takes in bytes of [`Participant::serialise_state`] as a kept state.
    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError>;

    /// What went wrong without ending the run, since this was asked last.
    fn take_warnings(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// Names a state kept by one participant; means nothing to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct StateHandle(pub(crate) u64);

/// How a call went wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trouble {
    /// It was refused, by the participant or by this side.
    #[default]
    Refused,
    /// The participant's process died of it.
    Died,
    /// There was no answer within the time limit, and the process was ended.
    Hung,
}

/// A refused call: which function, what it returned, and what the FMU had to say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallError {
    /// The C name of the function.
    pub function: &'static str,
    /// What happened: `returned fmi2Error`, or what this side refused.
    pub reason: String,
    /// The last lines of the participant's log, oldest first.
    pub log: Vec<String>,
    /// Whether the participant still lives.
    pub trouble: Trouble,
}

impl CallError {
    /// An error without log lines.
    pub fn new(function: &'static str, reason: impl Into<String>) -> Self {
        Self { function, reason: reason.into(), log: Vec::new(), trouble: Trouble::Refused }
    }

    /// The same with these log lines.
    pub(super) fn with_log(self, log: Vec<String>) -> Self {
        Self { log, ..self }
    }
}

impl std::error::Error for CallError {}

impl fmt::Display for CallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.function, self.reason)?;
        for line in &self.log {
            write!(f, "\n  {line}")?;
        }
        Ok(())
    }
}

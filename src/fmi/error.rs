//! Why a call was refused: function, variable, what came, what was expected. One line each. A refused
//! call has changed nothing.

use super::call_order::{Function, State};
use super::lookup::Type;
use super::model::ModelError;
use super::state::FormatError;

/// Why a call was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum Error {
    /// The call-order table forbids it.
    #[error("{function}: not allowed in state \"{state}\"; expected one of: {}", function.describe_allowed())]
    CallOrder { function: Function, state: State },

    /// A panic has poisoned the instance earlier.
    #[error("{function}: this instance is unusable after an internal error; free it")]
    Poisoned { function: Function },

    /// A panic in this very call.
    #[error("{function}: internal error, the instance is unusable from now on: {message}")]
    Panic { function: Function, message: String },

    /// A value reference that the model description does not have.
    #[error(
        "{function}: value reference {found} (element {position} of the array) is unknown; \
         expected 1 to {count}"
    )]
    UnknownReference { function: Function, position: usize, found: u32, count: usize },

    /// The variable has another type.
    #[error("{function}: {name} is of type {found}; expected a variable of type {expected}")]
    WrongType { function: Function, name: String, found: Type, expected: Type },

    /// An output, or a fixed parameter too late.
    #[error("{function}: {name} cannot be set: {reason}")]
    NotSettable { function: Function, name: String, reason: &'static str },

    /// Not one that this derivative is for.
    #[error("{function}: {name} is {found}; expected {expected}")]
    NotDifferentiable { function: Function, name: String, found: &'static str, expected: &'static str },

    /// A derivative of an order that there is none of.
    #[error("{function}: derivative of order {found} of {name}; expected order 1")]
    Order { function: Function, name: String, found: i32 },

    /// NaN, infinite or out of range.
    #[error("{function}: {name} = {} is refused; expected {expected}", digits(*found))]
    Value { function: Function, name: String, found: f64, expected: String },

    /// Arrays of different lengths.
    #[error("{function}: {values} values for {references} value references; expected as many of each")]
    Length { function: Function, references: usize, values: usize },

    /// A pointer that cannot be followed.
    #[error("{function}: argument {argument} is {found}; expected {expected}")]
    Pointer { function: Function, argument: &'static str, found: &'static str, expected: &'static str },

    /// A scalar argument.
    #[error("{function}: argument {argument} = {found}; expected {expected}")]
    Argument { function: Function, argument: &'static str, found: String, expected: String },

    /// A communication point that is not where this instance stands.
    #[error(
        "{function}: currentCommunicationPoint is {found_s:?} s, but this instance stands at \
         {expected_s:?} s; expected both to agree within {tolerance_s:e} s"
    )]
    WrongTime { function: Function, found_s: f64, expected_s: f64, tolerance_s: f64 },

    /// The model refused.
    #[error("{function}: {source}")]
    Model { function: Function, source: ModelError },

    /// The FMU does not have this ability, and its model description says so.
    #[error("{function}: {reason}")]
    Unsupported { function: Function, reason: &'static str },

    /// A status that cannot be given (fmi2Discard).
    #[error("{function}: {reason}")]
    Unavailable { function: Function, reason: &'static str },

    /// Serialised bytes that are not a state of this FMU.
    #[error("{function}: {source}")]
    Format { function: Function, source: FormatError },

    /// Something about the FMU's files.
    #[error("{function}: {reason}")]
    Load { function: Function, reason: String },
}

/// A number for a person: a huge or tiny one has hundreds of digits otherwise.
fn digits(value: f64) -> String {
    let size = value.abs();
    let plain = size == 0.0 || (1e-6..1e16).contains(&size) || !value.is_finite();
    if plain { value.to_string() } else { format!("{value:e}") }
}

impl Error {
    /// The call that was refused.
    pub fn function(&self) -> Function {
        match self {
            Self::CallOrder { function, .. }
            | Self::Poisoned { function }
            | Self::Panic { function, .. }
            | Self::UnknownReference { function, .. }
            | Self::WrongType { function, .. }
            | Self::NotSettable { function, .. }
            | Self::NotDifferentiable { function, .. }
            | Self::Order { function, .. }
            | Self::Value { function, .. }
            | Self::Length { function, .. }
            | Self::Pointer { function, .. }
            | Self::Argument { function, .. }
            | Self::WrongTime { function, .. }
            | Self::Model { function, .. }
            | Self::Unsupported { function, .. }
            | Self::Unavailable { function, .. }
            | Self::Format { function, .. }
            | Self::Load { function, .. } => *function,
        }
    }

    /// The line without the function's name: FMI 3.0 has names of its own.
    pub(super) fn reason(&self) -> String {
        let line = self.to_string();
        let prefix = format!("{}: ", self.function());
        line.strip_prefix(&prefix).map(str::to_owned).unwrap_or(line)
    }

    /// The call of the model that failed.
    pub(super) fn model(function: Function) -> impl FnOnce(ModelError) -> Error {
        move |source| Error::Model { function, source }
    }

    /// Bytes that are not a state.
    pub(super) fn format(function: Function) -> impl FnOnce(FormatError) -> Error {
        move |source| Error::Format { function, source }
    }
}

//! Why a call of FMI 3.0 was refused: function, variable, what came, what was expected. One line each. A refused
//! call has changed nothing.

use super::call_order::{Function, State};
use super::table::Type;
use crate::fmi::model::ModelError;
use std::fmt;

/// Why a call was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{function}: {reason}")]
pub struct Error {
    /// The call.
    pub function: Function,
    /// What was wrong with it.
    pub reason: Reason,
}

/// What was wrong with a call.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum Reason {
    /// The call-order table forbids it.
    #[error("not allowed in state \"{state}\"; expected one of: {allowed}")]
    CallOrder { state: State, allowed: String },

    /// A panic has poisoned the instance earlier.
    #[error("this instance is unusable after an internal error; free it")]
    Poisoned,

    /// A panic in this very call.
    #[error("internal error, the instance is unusable from now on: {message}")]
    Panic { message: String },

    /// A value reference that the model description does not have.
    #[error(
        "value reference {found} (element {position} of the array) is unknown; expected 0 to {last}, as in \
         modelDescription.xml"
    )]
    UnknownReference { position: usize, found: u32, last: u32 },

    /// The variable has another type.
    #[error("{name} is of type {found}; expected a variable of type {expected}")]
    WrongType { name: String, found: Type, expected: &'static str },

    /// Arrays that do not hold as many values as the variables have.
    #[error("argument {argument} = {found}; expected {expected}, the elements of {variables} together")]
    Length { argument: &'static str, found: usize, expected: usize, variables: String },

    /// A variable that may not be set, or not now.
    #[error("{name} cannot be set: {why}")]
    NotSettable { name: String, why: &'static str },

    /// A variable whose length is being decided.
    #[error("{name} is not there in configuration mode; expected a structural parameter")]
    NotNow { name: String },

    /// A value out of range.
    #[error("{name} = {found} is refused; expected {expected}")]
    Value { name: String, found: String, expected: String },

    /// A pointer that cannot be followed.
    #[error("argument {argument} is {found}; expected {expected}")]
    Pointer { argument: &'static str, found: &'static str, expected: &'static str },

    /// A scalar argument.
    #[error("argument {argument} = {found}; expected {expected}")]
    Argument { argument: &'static str, found: String, expected: String },

    /// The model refused what it is to be built from.
    #[error("{0}")]
    Model(#[from] ModelError),

    /// What both standards refuse alike.
    #[error("{}", .0.reason())]
    Common(#[from] crate::fmi::Error),

    /// Serialised bytes that are not a state of this FMU.
    #[error("{0}")]
    Format(String),

    /// The FMU does not have this ability, and its model description says so.
    #[error("{0}")]
    Unsupported(&'static str),

    /// Something about the FMU's files.
    #[error("{0}")]
    Load(String),
}

impl Reason {
    /// In this call.
    pub(super) fn of(self, function: Function) -> Error {
        Error { function, reason: self }
    }

    /// A scalar argument that is refused.
    pub(super) fn argument(
        argument: &'static str,
        found: impl fmt::Display,
        expected: impl Into<String>,
    ) -> Self {
        Reason::Argument { argument, found: found.to_string(), expected: expected.into() }
    }
}

/// What a call on an instance comes to.
pub type Outcome<T> = Result<T, Reason>;

//! What must come of a call, and whether it did: status, the one log line and its words.

use crate::log::Line;
use bess_consensus::fmi::Function;
use bess_consensus::fmi::bindings::*;

/// What must come of a call.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// fmi2OK.
    Accept,
    /// fmi2Error, and these words in the log line after the function's name.
    Refuse(Vec<String>),
    /// fmi2Discard.
    Discard,
    /// fmi2Fatal.
    Fatal,
    /// Nothing is known about the instance: all but fmi2Fatal.
    Any,
    /// The network decides: fmi2OK or fmi2Error.
    Either,
}

impl Verdict {
    /// Refused with these words.
    pub fn refuse<const N: usize>(words: [&str; N]) -> Self {
        Self::Refuse(words.map(str::to_owned).to_vec())
    }

    /// Whether the call may be refused.
    pub fn may_refuse(&self) -> bool {
        *self != Self::Accept
    }

    /// What is wrong with this answer, if anything. `may_panic`: a panic of the model is no finding.
    pub fn fault(
        &self,
        function: Function,
        status: fmi2Status,
        lines: Option<&[Line]>,
        may_panic: bool,
    ) -> Option<String> {
        let fits = match (self, status) {
            (Self::Accept | Self::Either, fmi2Status_fmi2OK) => true,
            (Self::Refuse(_) | Self::Either, fmi2Status_fmi2Error) => true,
            (Self::Discard, fmi2Status_fmi2Discard) => true,
            (Self::Fatal, fmi2Status_fmi2Fatal) => true,
            (Self::Any, fmi2Status_fmi2OK | fmi2Status_fmi2Error | fmi2Status_fmi2Discard) => true,
            (Self::Accept | Self::Either | Self::Any, fmi2Status_fmi2Fatal) => may_panic,
            _ => false,
        };
        if !fits {
            return Some(format!("{function} gave status {status} with {lines:?}; expected {self:?}"));
        }
        let lines = lines?;
        let bad: Vec<&Line> = lines.iter().filter(|line| line.status >= fmi2Status_fmi2Discard).collect();
        match (status, &bad[..]) {
            (fmi2Status_fmi2OK, []) => None,
            (fmi2Status_fmi2OK, _) => Some(format!("{function} gave fmi2OK and wrote {bad:?}")),
            (_, [line]) => self.line_fault(function, status, line),
            _ => Some(format!("{function} was refused with {} lines, expected one: {bad:?}", bad.len())),
        }
    }

    fn line_fault(&self, function: Function, status: fmi2Status, line: &Line) -> Option<String> {
        let category = match status {
            fmi2Status_fmi2Discard => "logStatusDiscard",
            fmi2Status_fmi2Fatal => "logStatusFatal",
            _ => "logStatusError",
        };
        let head = format!("{}: ", function.name());
        let body = line.text.strip_prefix(&head);
        let missing: Vec<&String> = match self {
            Self::Refuse(words) => words.iter().filter(|word| !line.text.contains(*word)).collect(),
            _ => Vec::new(),
        };
        let sound = (line.status, line.category.as_str()) == (status, category)
            && body.is_some_and(|body| !body.is_empty())
            && !line.text.contains(['\n', '\r'])
            && missing.is_empty();
        (!sound).then(|| {
            format!("{function}: status {status}, {line:?}; expected {category}, {head:?} and {missing:?}")
        })
    }
}

//! One thing that is wrong: what, where, found, expected, how to mend, and who refuses it.

use super::rules::Rule;
use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::borrow::Borrow;
use std::fmt;

/// How bad it is; the worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Against the standard, or it does not run: some tool refuses it.
    Error,
    /// Allowed or nearly so, but it makes trouble in some tool.
    Warning,
    /// Good to know.
    Note,
}

impl Severity {
    /// In lower case.
    pub fn name(self) -> &'static str {
        match self {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        }
    }
}

/// Where it is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// File within the archive, or what took part in the run.
    pub file: String,
    /// Line, from 1.
    pub line: Option<u32>,
    /// Name of the variable.
    pub variable: Option<String>,
}

impl Place {
    /// A file as a whole.
    pub fn file(file: impl Into<String>) -> Self {
        Self { file: file.into(), ..Self::default() }
    }

    /// A line of `modelDescription.xml`.
    pub fn line(line: u32) -> Self {
        Self { line: Some(line), ..Self::file("modelDescription.xml") }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if let Some(variable) = &self.variable {
            write!(f, ", variable {variable}")?;
        }
        Ok(())
    }
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Which rule it breaks.
    pub rule: &'static Rule,
    /// Where.
    pub place: Place,
    /// What is there.
    pub found: String,
    /// What should be.
    pub expected: String,
    /// What to do about it.
    pub mend: String,
}

impl Finding {
    /// A finding at a place.
    pub fn new(
        rule: &'static Rule,
        place: Place,
        found: impl Into<String>,
        expected: impl Into<String>,
        mend: impl Into<String>,
    ) -> Self {
        Self { rule, place, found: found.into(), expected: expected.into(), mend: mend.into() }
    }
}

/// More names than these are counted and not told.
const SHOWN: usize = 6;

/// The first few of the names, and how many more there are.
pub fn first_of<S: Borrow<str>>(names: &[S]) -> String {
    let shown = names.get(..SHOWN.min(names.len())).unwrap_or_default().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

impl Serialize for Finding {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut out = serializer.serialize_struct("Finding", 9)?;
        out.serialize_field("rule", self.rule.id)?;
        out.serialize_field("severity", self.rule.severity.name())?;
        out.serialize_field("file", &self.place.file)?;
        out.serialize_field("line", &self.place.line)?;
        out.serialize_field("variable", &self.place.variable)?;
        out.serialize_field("found", &self.found)?;
        out.serialize_field("expected", &self.expected)?;
        out.serialize_field("mend", &self.mend)?;
        out.serialize_field("refused_by", self.rule.refused_by)?;
        out.end()
    }
}

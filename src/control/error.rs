//! What is wrong with a configuration, a parameter or a state. Only the report; the checks are in
//! `validate` and `state`.

/// One wrong value: where it stands, what was found, what was expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path}: found {found}, expected {expected}")]
pub struct Problem {
    /// Path of the key in the JSON, array positions from 0: `communication.explicit.topologies[0].edges[3].b`.
    pub path: String,
    /// The value found.
    pub found: String,
    /// What would be accepted, and where it helps, how to get there.
    pub expected: String,
}

/// All problems of one configuration, in the order of its keys; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigError {
    /// At least one problem.
    pub problems: Vec<Problem>,
}

impl std::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (k, problem) in self.problems.iter().enumerate() {
            if k > 0 {
                f.write_str("; ")?;
            }
            write!(f, "{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for ConfigError {}

/// Collects problems while a configuration is looked through.
#[derive(Default)]
pub(super) struct Problems(Vec<Problem>);

impl Problems {
    pub fn add(
        &mut self,
        path: impl Into<String>,
        found: impl std::fmt::Display,
        expected: impl Into<String>,
    ) {
        self.0.push(Problem { path: path.into(), found: found.to_string(), expected: expected.into() });
    }

    pub fn into_result(self) -> Result<(), ConfigError> {
        if self.0.is_empty() { Ok(()) } else { Err(ConfigError { problems: self.0 }) }
    }
}

//! What can be wrong with a scenario, said once and clearly.

use std::path::PathBuf;

/// Why a scenario cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// Neither a file nor a built-in name.
    #[error("{name}: no such scenario file, and no built-in scenario of that name")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The built-in names.
        built_in: Vec<&'static str>,
    },
    /// The file cannot be read.
    #[error("{}: cannot be read: {cause}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// A value that does not fit, with its place in the document.
    #[error("{origin}: {path}: found {found}, expected {expected}")]
    Value {
        /// File or built-in name, with line and column where they are known.
        origin: String,
        /// Path of the key: `bess[2].K_P`.
        path: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        expected: String,
    },
    /// A document that is not JSON, or a key of the wrong name or type.
    #[error("{origin}: {path}: {problem}")]
    Document {
        /// File or built-in name, with line and column.
        origin: String,
        /// Path of the key, as far as it was read.
        path: String,
        /// What was found and what was expected.
        problem: String,
    },
}

impl ScenarioError {
    /// What to do about it.
    pub fn help(&self) -> String {
        match self {
            Self::Unknown { built_in, .. } => {
                format!("give the path of a JSON file, or one of: {}", built_in.join(", "))
            }
            Self::Unreadable { .. } => "check the path and that you may read it".into(),
            Self::Value { .. } | Self::Document { .. } => {
                "`bess schema` prints the JSON Schema, `bess show case1` a scenario to start from".into()
            }
        }
    }
}

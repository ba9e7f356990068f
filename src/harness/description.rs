//! `modelDescription.xml` as data: what an importer needs of it, nothing more. Read by
//! `description_xml`; never written here.

use super::value::{Kind, Value};
use std::fmt;
use std::path::{Path, PathBuf};

/// Bytes of a `modelDescription.xml` at most: two million variables fit.
const LARGEST: u64 = 512 << 20;

/// What an FMI 2.0 co-simulation FMU says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelDescription {
    /// `2.0`.
    pub fmi_version: String,
    /// Name of the model, for a person.
    pub model_name: String,
    /// Must agree with the one in the library.
    pub guid: String,
    /// File name of the library, without its extension.
    pub model_identifier: String,
    /// One sentence, perhaps.
    pub description: Option<String>,
    /// The tool that made the FMU.
    pub generation_tool: Option<String>,
    /// Flags of the element `CoSimulation`.
    pub capabilities: Capabilities,
    /// Suggested times, s.
    pub default_experiment: DefaultExperiment,
    /// Names of the log categories.
    pub log_categories: Vec<String>,
    /// All variables, in order.
    pub variables: Vec<Variable>,
}

impl ModelDescription {
    /// Reads `modelDescription.xml` of an unpacked FMU.
    pub fn read(path: &Path) -> Result<Self, DescriptionError> {
        let refused = |found: String, expected: &str| DescriptionError {
            path: path.to_path_buf(),
            line: 0,
            found,
            expected: expected.into(),
        };
        let unreadable = |source: std::io::Error| refused(source.to_string(), "a readable file");
        let length = std::fs::metadata(path).map_err(unreadable)?.len();
        if length > LARGEST {
            return Err(refused(format!("{length} bytes"), "at most 536870912 bytes"));
        }
        let bytes = std::fs::read(path).map_err(unreadable)?;
        super::description_xml::parse(&bytes, path)
    }

    /// The variable of this name.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name)
    }
}

/// The flags of `CoSimulation`; absent ones are false or 0, as the standard has it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct Capabilities {
    pub needs_execution_tool: bool,
    pub can_handle_variable_step: bool,
    pub can_interpolate_inputs: bool,
    pub max_output_derivative_order: u32,
    pub can_run_asynchronously: bool,
    pub can_be_instantiated_only_once: bool,
    pub can_not_use_memory_management: bool,
    pub can_get_and_set_state: bool,
    pub can_serialise_state: bool,
    pub provides_directional_derivative: bool,
}

/// `DefaultExperiment`; s.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs)]
pub struct DefaultExperiment {
    pub start_s: Option<f64>,
    pub stop_s: Option<f64>,
    pub tolerance: Option<f64>,
    pub step_s: Option<f64>,
}

/// One scalar variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Unique name.
    pub name: String,
    /// Value reference; aliases share it.
    pub reference: u32,
    /// Type.
    pub kind: Kind,
    /// Role.
    pub causality: Causality,
    /// When it may change.
    pub variability: Variability,
    /// How its start value is meant, where the file says so.
    pub initial: Option<Initial>,
    /// Start value; none for Strings.
    pub start: Option<Value>,
    /// Unit, its own or its declared type's.
    pub unit: Option<String>,
    /// For a person.
    pub description: Option<String>,
}

macro_rules! words {
    ($(#[$doc:meta])* $type:ident: $($variant:ident = $word:literal),*) => {
        $(#[$doc])*
        #[allow(missing_docs)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $type { $($variant),* }

        impl $type {
            /// The words of the standard.
            pub const WORDS: &'static [&'static str] = &[$($word),*];

            /// From its word in the standard.
            pub fn from_word(word: &str) -> Option<Self> {
                match word { $($word => Some(Self::$variant),)* _ => None }
            }
        }

        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$variant => $word),* })
            }
        }
    };
}

words! {
    /// FMI causality.
    Causality: Parameter = "parameter", CalculatedParameter = "calculatedParameter", Input = "input",
    Output = "output", Local = "local", Independent = "independent"
}
words! {
    /// FMI variability.
    Variability: Constant = "constant", Fixed = "fixed", Tunable = "tunable", Discrete = "discrete",
    Continuous = "continuous"
}
words! {
    /// FMI initial.
    Initial: Exact = "exact", Approx = "approx", Calculated = "calculated"
}

/// What is wrong with a `modelDescription.xml`, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}, line {line}: found {found}; expected {expected}", path.display())]
pub struct DescriptionError {
    /// The file.
    pub path: PathBuf,
    /// 1-based line; 0 where the file could not be read at all.
    pub line: usize,
    /// What stands there.
    pub found: String,
    /// What should.
    pub expected: String,
}

//! All rules in one table: name, severity, and the tools that refuse or mistreat an FMU that breaks it, with how that
//! is known. "FMPy" is `validate_fmu` of FMPy 0.3.32 (the tests compare verdicts with it); issues are named as
//! PROJECT#NUMBER; an empty list means that no tool is known to mind.

use super::Severity::{self, Error, Note, Warning};

/// A rule.
#[derive(Debug, PartialEq)]
pub struct Rule {
    /// Its name, stable, for scripts.
    pub id: &'static str,
    /// How bad it is to break it.
    pub severity: Severity,
    /// Who refuses such an FMU, and where that is written.
    pub refused_by: &'static [&'static str],
}

macro_rules! rules {
    ($($name:ident = $id:literal, $severity:ident, [$($tool:literal),*];)*) => {
        $(
            #[allow(missing_docs)]
            pub static $name: Rule = Rule { id: $id, severity: $severity, refused_by: &[$($tool),*] };
        )*
        /// All of them.
        pub static ALL: &[&Rule] = &[$(&$name),*];
    };
}

rules! {
    // The archive.
    ARCHIVE = "archive", Error, ["every importer"];
    NO_DESCRIPTION = "archive-description", Error, ["every importer"];
    METHOD = "archive-method", Error, ["bess run"];
    BACKSLASH = "archive-backslash", Error, ["FMPy"];
    STRAY = "archive-stray", Note, [];
    NO_DOCUMENTATION = "documentation", Note, [];

    // The XML, against the schema of FMI 2.0.
    MALFORMED = "xml-malformed", Error, ["every importer"];
    ORDER = "schema-order", Error, ["FMPy"];
    ELEMENT = "schema-element", Error, ["FMPy"];
    MISSING_ELEMENT = "schema-missing-element", Error, ["FMPy"];
    ATTRIBUTE = "schema-attribute", Error, ["FMPy"];
    MISSING_ATTRIBUTE = "schema-missing-attribute", Error, ["FMPy"];
    VALUE = "schema-value", Error, ["FMPy"];

    // The model as a whole.
    VERSION = "fmi-version", Error, ["every importer of FMI 2.0"];
    KIND = "no-implementation", Error, ["every importer"];
    GUID_EMPTY = "guid-empty", Error, [];
    GUID_BRACES = "guid-braces", Warning, ["libcosim (libcosim#533)"];
    IDENTIFIER = "model-identifier", Error, ["bess run", "every importer of FMUs with sources"];
    EXECUTION_TOOL = "execution-tool", Warning, ["every importer on a machine without that tool"];
    SERIALIZE = "serialize-without-state", Error, [];
    ASYNCHRONOUS = "asynchronous", Note, ["bess run (takes fmi2Pending for an error)"];
    ONLY_ONCE = "only-once", Warning, ["every importer that is asked for two instances"];
    NO_EXPERIMENT = "default-experiment", Note, [];
    EXPERIMENT = "default-experiment-range", Warning, [];
    EVENT_INDICATORS = "event-indicators", Error, [];

    // Names and references.
    NAME_UNIQUE = "name-unique", Error, ["FMPy", "bess run"];
    NAME_STRUCTURED = "name-structured", Error, ["FMPy"];
    NAME_FLAT = "name-flat", Error, ["FMPy"];
    NAME_PLAIN = "name-plain", Note, ["Hopsan (Hopsan#2266), which wants plain C identifiers"];
    ARRAY_GAP = "array-gap", Warning, ["importers that fold P[1], P[2], ... into vectors"];
    ALIAS = "reference-alias", Error, [];

    // Causality, variability, initial and start.
    COMBINATION = "causality-variability", Error, ["FMPy"];
    INITIAL = "initial", Error, ["FMPy"];
    INITIAL_OF_INPUT = "initial-of-input", Error, ["FMPy, unless initial is \"exact\""];
    CONTINUOUS = "continuous-not-real", Error, ["FMPy"];
    START_MISSING = "start-missing", Error, ["FMPy"];
    START_FORBIDDEN = "start-forbidden", Error, ["FMPy"];
    START_RANGE = "start-range", Error, [];
    RANGE_EMPTY = "range-empty", Error, [];
    INDEPENDENT = "independent", Warning, ["libcosim (prints a false error, fmi-library#129)"];
    INDEPENDENT_TWICE = "independent-twice", Error, [];
    STRING = "string-in-interface", Warning, ["CoFmuPy", "Hopsan (Hopsan#2266)"];
    ENUMERATION = "enumeration-in-interface", Warning, ["CoFmuPy", "Hopsan (Hopsan#2266)"];
    NOT_REAL_INPUT = "input-not-real", Note, ["CoFmuPy (calls fmi2SetReal on every input)"];
    DERIVATIVE = "derivative", Error, ["FMPy"];

    // Units and types.
    UNIT = "unit-undefined", Error, ["FMPy"];
    DISPLAY_UNIT = "display-unit-undefined", Error, ["FMPy"];
    UNIT_TWICE = "unit-twice", Error, [];
    UNIT_BASE = "unit-without-base", Note, ["tools that convert units or check them across connections"];
    DECLARED_TYPE = "declared-type", Error, ["FMPy"];

    // ModelStructure.
    OUTPUTS = "structure-outputs", Error, ["FMPy (mlfmu#86)"];
    INITIAL_UNKNOWNS = "structure-initial-unknowns", Error, ["FMPy (mlfmu#86)"];
    DERIVATIVES = "structure-derivatives", Error, ["FMPy"];
    INDEX = "structure-index", Error, ["FMPy"];
    UNKNOWN_ORDER = "structure-order", Warning, [];
    DEPENDENCIES = "structure-dependencies", Warning,
        ["OMSimulator (takes all inputs for causes and iterates an algebraic loop at every step)"];
    DEPENDENCY = "structure-dependency", Error, [];
    DEPENDENCY_KIND = "structure-dependencies-kind", Error, ["FMPy"];

    // Binaries.
    NO_BINARY = "no-binary", Error, ["every importer"];
    BINARY_NAME = "binary-name", Error, ["every importer on that platform"];
    PLATFORM = "platform-unknown", Note, [];
    PLATFORMS = "platforms", Note, ["every importer on another platform"];
    BINARY_FORMAT = "binary-format", Error, ["every importer on that platform"];
    FUNCTIONS = "functions", Error,
        ["importers that resolve all functions at once (FMPy#642, FMIKit#375)", "bess run"];
    FOREIGN = "foreign-symbols", Warning, ["tools that load several FMUs with shared symbols into one process"];
    LIBRARY = "needed-library", Warning, ["every importer on a machine without that library"];
    GLIBC = "glibc", Note, ["OMSimulator and others on an older Linux (OMSimulator#1424)"];

    // The short run.
    NOT_RUN = "not-run", Note, [];
    RUN_LOAD = "run-load", Error, ["bess run"];
    RUN_CALL = "run-call", Error, ["bess run"];
    RUN_CRASH = "run-crash", Error, ["every importer that makes the same calls"];
    RUN_HANG = "run-hang", Error, ["every importer that makes the same calls"];
    RUN_SAME_NAME = "run-same-name", Error, ["Ecos", "PyFMI", "CoFmuPy (all give their instances one name)"];
    RUN_START = "run-start", Warning, ["importers that read start values from the description"];
    RUN_NOT_FINITE = "run-not-finite", Warning, ["importers that refuse NaN, bess run among them"];
    RUN_STATE = "run-state", Error, ["masters that step back (Reference-FMUs#635)"];
    RUN_RESET = "run-reset", Warning, ["FMIKit (FMIKit#211) and others that run again after fmi2Reset"];
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique() {
        let names: BTreeSet<&str> = ALL.iter().map(|rule| rule.id).collect();
        assert_eq!(names.len(), ALL.len());
    }
}

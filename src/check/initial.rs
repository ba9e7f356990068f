//! Causality, variability, `initial` and `start` together: the two tables of FMI 2.0.4, section 2.2.7.

use super::document::{Document, Variable};
use super::finding::Finding;
use super::rules::{self, Rule};

/// Which values `initial` may have; the first is the default.
const EXACT: &[&str] = &["exact"];
const COMPUTED: &[&str] = &["calculated", "approx"];
const ANY: &[&str] = &["calculated", "exact", "approx"];
const NONE: &[&str] = &[];

/// The legal combinations of causality and variability, with what `initial` may be.
const LEGAL: [(&str, &str, &[&str]); 16] = [
    ("parameter", "fixed", EXACT),
    ("parameter", "tunable", EXACT),
    ("calculatedParameter", "fixed", COMPUTED),
    ("calculatedParameter", "tunable", COMPUTED),
    ("input", "discrete", NONE),
    ("input", "continuous", NONE),
    ("output", "constant", EXACT),
    ("output", "discrete", ANY),
    ("output", "continuous", ANY),
    ("local", "constant", EXACT),
    ("local", "fixed", COMPUTED),
    ("local", "tunable", COMPUTED),
    ("local", "discrete", ANY),
    ("local", "continuous", ANY),
    ("independent", "continuous", NONE),
    // Not of the table, but importers read it so: an independent variable that is no Real is found elsewhere.
    ("independent", "discrete", NONE),
];

fn legal(causality: &str, variability: &str) -> Option<&'static [&'static str]> {
    LEGAL.iter().find(|(c, v, _)| *c == causality && *v == variability).map(|(_, _, initial)| *initial)
}

/// What a missing `initial` means.
pub fn default(causality: &str, variability: &str) -> Option<&'static str> {
    legal(causality, variability)?.first().copied()
}

/// What is wrong with each variable's combination.
pub fn check(document: &Document<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    for variable in &document.variables {
        one(variable, &mut findings);
    }
    findings
}

fn one(variable: &Variable<'_>, findings: &mut Vec<Finding>) {
    let mut complain = |rule: &'static Rule, found: String, expected: String, mend: &str| {
        findings.push(Finding::new(rule, variable.place(), found, expected, mend));
    };
    let (causality, variability) = (variable.causality, variable.variability);
    if variability == "continuous" && !matches!(variable.kind(), "Real" | "") {
        complain(
            &rules::CONTINUOUS,
            format!("variability=\"continuous\" of type {}", variable.kind()),
            "continuous for Real only".into(),
            "write variability=\"discrete\"",
        );
    }
    let Some(allowed) = legal(causality, variability) else {
        let possible: Vec<&str> =
            LEGAL.iter().filter(|(c, ..)| *c == causality).map(|(_, variability, _)| *variability).collect();
        // A word that is none at all is the schema's matter.
        if !possible.is_empty() {
            complain(
                &rules::COMBINATION,
                format!("causality=\"{causality}\" with variability=\"{variability}\""),
                format!("variability {}", possible.join(" or ")),
                "correct the variability (FMI 2.0.4, section 2.2.7)",
            );
        }
        return;
    };
    if let Some(initial) = variable.node.attribute("initial")
        && !allowed.contains(&initial)
    {
        let found =
            format!("initial=\"{initial}\" with causality=\"{causality}\" variability=\"{variability}\"");
        if allowed.is_empty() {
            let mend = "remove initial: its start is what counts";
            complain(&rules::INITIAL_OF_INPUT, found, "no initial".into(), mend);
        } else {
            let expected = format!("initial {}", allowed.join(" or "));
            complain(&rules::INITIAL, found, expected, "correct initial (FMI 2.0.4, section 2.2.7)");
        }
    }
    let has_start = variable.typed_attribute("start").is_some();
    let needs = causality == "input" || matches!(variable.initial, Some("exact" | "approx"));
    let forbidden = causality == "independent" || variable.initial == Some("calculated");
    if needs && !has_start && variable.typed.is_some() {
        let why = if causality == "input" { "an input" } else { variable.initial.unwrap_or_default() };
        complain(
            &rules::START_MISSING,
            "no start value".into(),
            format!("a start value, because it is {why}"),
            "write start, the value that the FMU begins with",
        );
    }
    if forbidden && has_start {
        let start = variable.typed_attribute("start").unwrap_or_default();
        complain(
            &rules::START_FORBIDDEN,
            format!("start=\"{start}\""),
            format!("no start value, because it is {}", variable.initial.unwrap_or(causality)),
            "remove start, or write initial=\"approx\" or \"exact\"",
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_those_of_the_standards_table() {
        for (causality, variability, expected) in [
            ("parameter", "fixed", Some("exact")),
            ("calculatedParameter", "tunable", Some("calculated")),
            ("input", "continuous", None),
            ("output", "constant", Some("exact")),
            ("output", "continuous", Some("calculated")),
            ("local", "fixed", Some("calculated")),
            ("input", "fixed", None),
        ] {
            assert_eq!(default(causality, variability), expected, "{causality} {variability}");
        }
    }
}

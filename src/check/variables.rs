//! What importers cannot take in a variable: strings, enumerations, an independent variable, starts out of range.

use super::document::{Document, Variable};
use super::finding::Finding;
use super::numbers::double;
use super::rules::{self, Rule};

/// What is wrong with each variable by itself.
pub fn check(document: &Document<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    for variable in &document.variables {
        interface(variable, &mut findings);
        range(variable, &mut findings);
        derivative(document, variable, &mut findings);
    }
    independent(document, &mut findings);
    inputs(document, &mut findings);
    findings
}

fn interface(variable: &Variable<'_>, findings: &mut Vec<Finding>) {
    let public = matches!(variable.causality, "input" | "output" | "parameter");
    let rule = match variable.kind() {
        "String" => &rules::STRING,
        "Enumeration" => &rules::ENUMERATION,
        _ => return,
    };
    if public {
        findings.push(Finding::new(
            rule,
            variable.place(),
            format!("{} as {}", variable.kind(), variable.causality),
            "Real, Integer or Boolean",
            "make it an Integer, or keep it out of the interface (causality=\"local\")",
        ));
    }
}

fn range(variable: &Variable<'_>, findings: &mut Vec<Finding>) {
    let number = |name| variable.typed_attribute(name).and_then(double);
    let (min, max) = (number("min"), number("max"));
    let mut complain = |rule: &'static Rule, found: String, expected: String| {
        findings.push(Finding::new(rule, variable.place(), found, expected, "correct start, min or max"));
    };
    if let (Some(min), Some(max)) = (min, max)
        && min > max
    {
        complain(&rules::RANGE_EMPTY, format!("min=\"{min}\" max=\"{max}\""), "min at most max".into());
    }
    let Some(start) = number("start") else { return };
    let (low, high) = (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
    if !start.is_finite() || start < low || start > high {
        complain(
            &rules::START_RANGE,
            format!("start=\"{start}\""),
            format!("a finite value from {low} to {high}"),
        );
    }
}

fn derivative(document: &Document<'_>, variable: &Variable<'_>, findings: &mut Vec<Finding>) {
    let Some(state) = variable.typed_attribute("derivative") else { return };
    let index = state.trim().parse::<usize>().ok().and_then(|index| index.checked_sub(1));
    let real = index.and_then(|index| document.variables.get(index)).is_some_and(|v| v.kind() == "Real");
    if !real {
        findings.push(Finding::new(
            &rules::DERIVATIVE,
            variable.place(),
            format!("derivative=\"{state}\""),
            format!("the index, from 1 to {}, of a Real", document.variables.len()),
            "write the position of its state in <ModelVariables>, not its value reference",
        ));
    }
}

fn independent(document: &Document<'_>, findings: &mut Vec<Finding>) {
    let all = document.variables.iter().filter(|variable| variable.causality == "independent");
    for (count, variable) in all.enumerate() {
        findings.push(Finding::new(
            if count == 0 { &rules::INDEPENDENT } else { &rules::INDEPENDENT_TWICE },
            variable.place(),
            if count == 0 { "an independent variable" } else { "a second independent variable" },
            if count == 0 { "none: time is known without it" } else { "at most one" },
            "remove it",
        ));
    }
}

/// One note for all inputs that are no Reals.
fn inputs(document: &Document<'_>, findings: &mut Vec<Finding>) {
    let mut others = document
        .variables
        .iter()
        .filter(|v| v.causality == "input" && matches!(v.kind(), "Integer" | "Boolean"));
    if let Some(first) = others.next() {
        findings.push(Finding::new(
            &rules::NOT_REAL_INPUT,
            first.place(),
            format!("{} inputs of type Integer or Boolean", 1 + others.count()),
            "nothing else, unless that tool is used",
            "for it export Reals in their place, as `bess export --portable` does",
        ));
    }
}

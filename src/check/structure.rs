//! ModelStructure: complete, ascending, with dependencies (FMI 2.0.4, section 2.2.8).

use super::document::{Document, Variable, place};
use super::finding::{Finding, Place, first_of};
use super::numbers::unsigned;
use super::rules::{self, Rule};
use roxmltree::Node;
use std::collections::BTreeSet;

/// What is wrong with ModelStructure. Indices count variables from 1.
pub fn check(document: &Document<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let of = |condition: &dyn Fn(&Variable<'_>) -> bool| -> BTreeSet<usize> {
        let all = document.variables.iter().enumerate();
        all.filter(|(_, v)| condition(v)).map(|(at, _)| at + 1).collect()
    };
    let outputs = of(&|v| v.causality == "output");
    let computed = |v: &Variable<'_>| matches!(v.initial, Some("approx" | "calculated"));
    let mut initial =
        of(&|v| (v.causality == "output" && computed(v)) || v.causality == "calculatedParameter");

    let listed = listed(document, "Derivatives", &mut findings);
    let derivatives = of(&|v| v.typed_attribute("derivative").is_some());
    let exchange = document.implementations.iter().any(|node| node.has_tag_name("ModelExchange"));
    // In co-simulation they may be listed; in model exchange they must.
    if exchange || !listed.is_subset(&derivatives) {
        differences(document, "Derivatives", &listed, &derivatives, &rules::DERIVATIVES, &mut findings);
    }
    for derivative in &listed {
        let variable = document.variables.get(derivative.wrapping_sub(1));
        let state = variable.and_then(|v| v.typed_attribute("derivative")?.trim().parse::<usize>().ok());
        for index in [Some(*derivative), state].into_iter().flatten() {
            if document.variables.get(index.wrapping_sub(1)).is_some_and(computed) {
                initial.insert(index);
            }
        }
    }
    let found = self::listed(document, "Outputs", &mut findings);
    differences(document, "Outputs", &found, &outputs, &rules::OUTPUTS, &mut findings);
    let found = self::listed(document, "InitialUnknowns", &mut findings);
    differences(document, "InitialUnknowns", &found, &initial, &rules::INITIAL_UNKNOWNS, &mut findings);
    findings
}

/// The indices listed in one part, after a look at each entry.
fn listed(document: &Document<'_>, part: &str, findings: &mut Vec<Finding>) -> BTreeSet<usize> {
    let mut indices = BTreeSet::new();
    let (mut last, mut silent) = (0, None);
    let mut complain = |rule: &'static Rule, at: Place, found: String, expected: &str, mend: &str| {
        findings.push(Finding::new(rule, at, found, expected, mend));
    };
    for unknown in document.unknowns(part) {
        let Some(index) = unknown.attribute("index").and_then(unsigned) else { continue };
        let index = index as usize;
        if index == 0 || index > document.variables.len() || !indices.insert(index) {
            complain(
                &rules::INDEX,
                place(unknown),
                format!("index=\"{index}\" in <{part}>"),
                "each position in <ModelVariables> at most once, from 1",
                "write the position of the variable, counted from 1, not its value reference",
            );
        } else if index < last {
            complain(
                &rules::UNKNOWN_ORDER,
                place(unknown),
                format!("index=\"{index}\" after {last} in <{part}>"),
                "ascending indices",
                "sort the entries",
            );
        }
        last = index;
        match unknown.attribute("dependencies") {
            None => silent = silent.or(Some(unknown)),
            Some(list) => dependencies(document, unknown, list, &mut complain),
        }
        kinds(unknown, part, &mut complain);
    }
    if let Some(first) = silent.filter(|_| part == "Outputs") {
        let count = document.unknowns(part).iter().filter(|n| n.attribute("dependencies").is_none()).count();
        complain(
            &rules::DEPENDENCIES,
            place(first),
            format!("{count} entries of <{part}> without dependencies, which means: on all inputs"),
            "dependencies written out, empty where there are none",
            "write dependencies=\"\" where an output follows no input within a step",
        );
    }
    indices
}

fn dependencies(
    document: &Document<'_>,
    unknown: Node<'_, '_>,
    list: &str,
    complain: &mut impl FnMut(&'static Rule, Place, String, &str, &str),
) {
    let indices: Vec<usize> =
        list.split_whitespace().filter_map(unsigned).map(|index| index as usize).collect();
    let outside = indices.iter().find(|index| **index == 0 || **index > document.variables.len());
    if let Some(outside) = outside {
        complain(
            &rules::DEPENDENCY,
            place(unknown),
            format!("dependencies on index {outside}"),
            "positions in <ModelVariables>, from 1",
            "write positions, not value references",
        );
    }
    if !indices.is_sorted_by(|a, b| a < b) {
        complain(
            &rules::UNKNOWN_ORDER,
            place(unknown),
            format!("dependencies=\"{}\"", shortened(list)),
            "ascending indices, each once",
            "sort them",
        );
    }
}

fn kinds(
    unknown: Node<'_, '_>,
    part: &str,
    complain: &mut impl FnMut(&'static Rule, Place, String, &str, &str),
) {
    let Some(kinds) = unknown.attribute("dependenciesKind") else { return };
    let count = |text: &str| text.split_whitespace().count();
    let dependencies = unknown.attribute("dependencies").map(count);
    if dependencies != Some(count(kinds)) {
        let found = match dependencies {
            None => "dependenciesKind without dependencies".to_owned(),
            Some(n) => format!("{} kinds for {n} dependencies", count(kinds)),
        };
        complain(
            &rules::DEPENDENCY_KIND,
            place(unknown),
            found,
            "one kind for each dependency",
            "write as many, or leave them out",
        );
    }
    let only_known = |kind: &str| matches!(kind, "dependent" | "constant");
    if part == "InitialUnknowns" && !kinds.split_whitespace().all(only_known) {
        complain(
            &rules::DEPENDENCY_KIND,
            place(unknown),
            format!("dependenciesKind=\"{}\" in <InitialUnknowns>", shortened(kinds)),
            "dependent or constant there",
            "write dependent",
        );
    }
}

fn differences(
    document: &Document<'_>,
    part: &str,
    found: &BTreeSet<usize>,
    expected: &BTreeSet<usize>,
    rule: &'static Rule,
    findings: &mut Vec<Finding>,
) {
    let at = document.part("ModelStructure").map_or_else(|| Place::file("modelDescription.xml"), place);
    for (wrong, what, mend) in [
        (expected.difference(found).collect::<Vec<_>>(), "missing", "add"),
        (found.difference(expected).collect::<Vec<_>>(), "too many", "remove"),
    ] {
        let names: Vec<&str> = wrong
            .iter()
            .filter_map(|index| document.variables.get(index.wrapping_sub(1)))
            .map(|variable| variable.name)
            .collect();
        // An index that is no variable's has its own finding.
        if names.is_empty() {
            continue;
        }
        let expectation = match part {
            "Outputs" => "every variable with causality=\"output\"",
            "Derivatives" => "every variable with an attribute derivative",
            _ => "every output with initial approx or calculated, every calculatedParameter, and such states",
        };
        findings.push(Finding::new(
            rule,
            at.clone(),
            format!("{what} in <{part}>: {}", first_of(&names)),
            format!("exactly {expectation}"),
            format!("{mend} <Unknown index=\"...\"/> for each"),
        ));
    }
}

fn shortened(text: &str) -> String {
    if text.chars().count() <= 40 {
        text.to_owned()
    } else {
        text.chars().take(39).chain(['\u{2026}']).collect()
    }
}

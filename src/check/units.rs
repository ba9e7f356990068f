//! Units: each that is named is defined once, with its display units; and can be converted.

use super::document::{Document, children, place};
use super::finding::Finding;
use super::rules;
use std::collections::{BTreeMap, BTreeSet};

/// What is wrong with units and their use.
pub fn check(document: &Document<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut defined: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let definitions = document.part("UnitDefinitions");
    for unit in definitions.into_iter().flat_map(children).filter(|node| node.has_tag_name("Unit")) {
        let name = unit.attribute("name").unwrap_or_default();
        let display: BTreeSet<&str> = children(unit)
            .filter(|node| node.has_tag_name("DisplayUnit"))
            .filter_map(|node| node.attribute("name"))
            .collect();
        if defined.insert(name, display).is_some() {
            findings.push(Finding::new(
                &rules::UNIT_TWICE,
                place(unit),
                format!("a second definition of the unit \"{name}\""),
                "one definition for each unit",
                "remove one of them",
            ));
        }
        if !children(unit).any(|node| node.has_tag_name("BaseUnit")) {
            findings.push(Finding::new(
                &rules::UNIT_BASE,
                place(unit),
                format!("the unit \"{name}\" without <BaseUnit>"),
                "its exponents of the SI base units",
                "add <BaseUnit .../>, empty for a pure number",
            ));
        }
    }
    for variable in &document.variables {
        let declared = variable.typed_attribute("declaredType").and_then(|name| document.types.get(name));
        let of = |name: &str| {
            let inherited = || declared.and_then(|node| node.attribute(name));
            variable.typed_attribute(name).or_else(inherited)
        };
        let unit = of("unit");
        if let Some(unit) = unit.filter(|unit| !defined.contains_key(unit)) {
            let known: Vec<&str> = defined.keys().copied().collect();
            findings.push(Finding::new(
                &rules::UNIT,
                variable.place(),
                format!("unit=\"{unit}\", which is not defined"),
                if known.is_empty() { "no unit, or <UnitDefinitions>".to_owned() } else { known.join(", ") },
                "define it in <UnitDefinitions>",
            ));
        }
        if let Some(display) = of("displayUnit") {
            let known = unit.and_then(|unit| defined.get(unit)).is_some_and(|units| units.contains(display));
            if !known && Some(display) != unit {
                findings.push(Finding::new(
                    &rules::DISPLAY_UNIT,
                    variable.place(),
                    format!("displayUnit=\"{display}\""),
                    format!("a <DisplayUnit> of the unit \"{}\"", unit.unwrap_or("(none)")),
                    "define it within that unit",
                ));
            }
        }
    }
    findings
}

//! Elements and attributes against the schema: order, presence, types. Says nothing of meaning.

use super::document::{children, place};
use super::finding::{Finding, Place};
use super::numbers;
use super::rules::{self, Rule};
use super::schema_table::{Element, Particle, ROOT, Type};
use roxmltree::{Document, Node};

/// Everything in the tree that the schema does not allow.
pub fn check(tree: &Document<'_>) -> Vec<Finding> {
    let root = tree.root_element();
    let mut findings = Vec::new();
    if root.tag_name().name() != ROOT.name || root.tag_name().namespace().is_some() {
        findings.push(Finding::new(
            &rules::ELEMENT,
            place(root),
            format!("<{}> as root", root.tag_name().name()),
            "<fmiModelDescription> without a namespace",
            "export the FMU again, as FMI 2.0",
        ));
        return findings;
    }
    element(root, &ROOT, &mut findings);
    findings
}

fn element(node: Node<'_, '_>, expected: &'static Element, findings: &mut Vec<Finding>) {
    attributes(node, expected, findings);
    if expected.open {
        return;
    }
    let mut at = 0;
    let mut counts = vec![0_u32; expected.sequence.len()];
    for child in children(node) {
        let name = child.tag_name().name();
        let find = |particles: &[Particle]| {
            particles.iter().position(|p| p.any_of.iter().any(|candidate| candidate.name == name))
        };
        let Some(position) = find(expected.sequence) else {
            let known = names(expected.sequence);
            let expected_text = if known.is_empty() { "no element".to_owned() } else { known };
            findings.push(complain(
                &rules::ELEMENT,
                child,
                format!("<{name}> in <{}>", expected.name),
                expected_text,
                "remove it, or move it to VendorAnnotations",
            ));
            continue;
        };
        let Some(particle) = expected.sequence.get(position) else { continue };
        if position < at {
            let order = names(expected.sequence);
            findings.push(complain(
                &rules::ORDER,
                child,
                format!("<{name}> after an element that follows it"),
                format!("the order {order}"),
                format!("move <{name}> forward"),
            ));
        }
        at = at.max(position);
        if let Some(count) = counts.get_mut(position) {
            *count += 1;
            if *count == particle.most.saturating_add(1) {
                let found = format!("<{name}> more than {} times in <{}>", particle.most, expected.name);
                let most = format!("at most {}", particle.most);
                findings.push(complain(&rules::ELEMENT, child, found, most, "merge them"));
            }
        }
        if let Some(inner) = particle.any_of.iter().find(|candidate| candidate.name == name) {
            element(child, inner, findings);
        }
    }
    for (particle, count) in expected.sequence.iter().zip(counts) {
        if count < particle.least {
            let wanted: Vec<String> = particle.any_of.iter().map(|e| format!("<{}>", e.name)).collect();
            let wanted = wanted.join(" or ");
            findings.push(complain(
                &rules::MISSING_ELEMENT,
                node,
                format!("<{}> without {wanted}", expected.name),
                wanted,
                "add it",
            ));
        }
    }
}

fn attributes(node: Node<'_, '_>, expected: &Element, findings: &mut Vec<Finding>) {
    for attribute in node.attributes() {
        // xsi:noNamespaceSchemaLocation and its like are allowed everywhere.
        if attribute.namespace().is_some() {
            continue;
        }
        let (name, value) = (attribute.name(), attribute.value());
        let Some((_, kind, _)) = expected.attributes().find(|(known, ..)| *known == name) else {
            let known: Vec<&str> = expected.attributes().map(|(known, ..)| *known).collect();
            // The standard spells it so.
            let mend = if name.eq_ignore_ascii_case("canRunAsynchronously") {
                "spell it canRunAsynchronuously, as the schema does".to_owned()
            } else {
                format!("remove {name}")
            };
            findings.push(complain(
                &rules::ATTRIBUTE,
                node,
                format!("{name}=\"{value}\" of <{}>", expected.name),
                format!(
                    "only {}",
                    if known.is_empty() { "no attributes".to_owned() } else { known.join(", ") }
                ),
                mend,
            ));
            continue;
        };
        if let Err(wanted) = is_of(value, *kind) {
            findings.push(complain(
                &rules::VALUE,
                node,
                format!("{name}=\"{value}\" of <{}>", expected.name),
                wanted,
                "correct the value",
            ));
        }
    }
    for (name, _, required) in expected.attributes() {
        if *required && node.attribute(*name).is_none() {
            findings.push(complain(
                &rules::MISSING_ATTRIBUTE,
                node,
                format!("<{}> without {name}", expected.name),
                format!("an attribute {name}"),
                "add it",
            ));
        }
    }
}

/// Whether the text is of that type; if not, what would be.
fn is_of(text: &str, kind: Type) -> Result<(), String> {
    let of = |good: bool, wanted: &str| if good { Ok(()) } else { Err(wanted.to_owned()) };
    match kind {
        Type::Text => Ok(()),
        Type::Bool => of(numbers::boolean(text).is_some(), "true, false, 1 or 0"),
        Type::Int => of(numbers::int(text).is_some(), "an integer from -2147483648 to 2147483647"),
        Type::Unsigned => of(numbers::unsigned(text).is_some(), "an integer from 0 to 4294967295"),
        Type::Double => of(numbers::double(text).is_some(), "a number, INF, -INF or NaN"),
        Type::DateTime => of(numbers::is_date_time(text), "a date and time such as 2026-01-31T12:00:00Z"),
        Type::Words(words) => of(words.contains(&text.trim()), &format!("one of {}", words.join(", "))),
        Type::UnsignedList => {
            of(text.split_whitespace().all(|one| numbers::unsigned(one).is_some()), "a list of indices")
        }
        Type::Kinds(words) => of(
            text.split_whitespace().all(|one| words.contains(&one)),
            &format!("a list of {}", words.join(", ")),
        ),
    }
}

fn names(sequence: &[Particle]) -> String {
    let all: Vec<&str> = sequence.iter().flat_map(|p| p.any_of.iter().map(|e| e.name)).collect();
    all.join(", ")
}

fn complain(
    rule: &'static Rule,
    node: Node<'_, '_>,
    found: String,
    expected: String,
    mend: impl Into<String>,
) -> Finding {
    // The variable is known by its own name or by that of the element around.
    let named = node.ancestors().find(|n| n.has_tag_name("ScalarVariable"));
    let variable = named.and_then(|n| n.attribute("name")).map(str::to_owned);
    Finding::new(rule, Place { variable, ..place(node) }, found, expected, mend)
}

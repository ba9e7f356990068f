//! Names: unique, written as the naming convention says, arrays without gaps; and value references.

use super::document::{Document, Variable};
use super::finding::Finding;
use super::rules;
use std::collections::{BTreeMap, BTreeSet};

/// Fewer names with an index than these are taken for no array.
const FEW: usize = 3;

/// What is wrong with names and references.
pub fn check(document: &Document<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let structured = document.root.attribute("variableNamingConvention") == Some("structured");
    let mut seen = BTreeSet::new();
    for variable in &document.variables {
        let name = variable.name;
        if !seen.insert(name) && !name.is_empty() {
            findings.push(Finding::new(
                &rules::NAME_UNIQUE,
                variable.place(),
                format!("a second variable \"{name}\""),
                "unique names",
                "rename one of them",
            ));
        }
        if structured && !is_structured(name) {
            findings.push(Finding::new(
                &rules::NAME_STRUCTURED,
                variable.place(),
                format!("the name \"{name}\""),
                "a name such as bus.P[1,2], der(x) or 'any text' (FMI 2.0.4, section 2.2.9)",
                "rename it, or write variableNamingConvention=\"flat\"",
            ));
        } else if !structured && name.contains(['\r', '\n', '\t']) {
            findings.push(Finding::new(
                &rules::NAME_FLAT,
                variable.place(),
                "a name with a tab or a line break",
                "a name in one line",
                "rename it",
            ));
        }
    }
    plain(document, &mut findings);
    gaps(document, &mut findings);
    aliases(document, &mut findings);
    findings
}

/// One note for all names that are no C identifiers.
fn plain(document: &Document<'_>, findings: &mut Vec<Finding>) {
    let is_plain = |name: &str| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let mut others = document.variables.iter().filter(|variable| !is_plain(variable.name));
    if let Some(first) = others.next() {
        findings.push(Finding::new(
            &rules::NAME_PLAIN,
            first.place(),
            format!("{} names that are no C identifiers", 1 + others.count()),
            "nothing else, unless one of these tools is used",
            "for them export with plain names, as `bess export --portable` does",
        ));
    }
}

/// Arrays whose indices leave gaps, whatever the first.
fn gaps(document: &Document<'_>, findings: &mut Vec<Finding>) {
    let mut arrays: BTreeMap<&str, Vec<(u64, &Variable<'_>)>> = BTreeMap::new();
    for variable in &document.variables {
        let Some((array, index)) = variable.name.strip_suffix(']').and_then(|n| n.rsplit_once('[')) else {
            continue;
        };
        if let Ok(index) = index.parse() {
            arrays.entry(array).or_default().push((index, variable));
        }
    }
    for (array, mut elements) in arrays {
        elements.sort_by_key(|(index, _)| *index);
        let first = elements.first().map_or(1, |(index, _)| *index);
        // Wraps where an index is as large as can be: then the next is a gap too.
        let expected = |k: usize| first.wrapping_add(k as u64);
        let broken = elements.iter().enumerate().find(|(k, (index, _))| *index != expected(*k));
        if let Some((k, (index, variable))) = broken.filter(|_| elements.len() >= FEW) {
            let expected = expected(k);
            findings.push(Finding::new(
                &rules::ARRAY_GAP,
                variable.place(),
                format!("{array}[{index}] where {array}[{expected}] should follow"),
                "indices without gaps or doubles",
                "number the elements one after the other",
            ));
        }
    }
}

/// Variables of one type that share a reference must agree (FMI 2.0.4, section 2.2.7, alias variables).
fn aliases(document: &Document<'_>, findings: &mut Vec<Finding>) {
    let mut sets: BTreeMap<(&str, u32), Vec<&Variable<'_>>> = BTreeMap::new();
    for variable in &document.variables {
        if let Some(reference) = variable.reference {
            let kind = if variable.kind() == "Enumeration" { "Integer" } else { variable.kind() };
            sets.entry((kind, reference)).or_default().push(variable);
        }
    }
    for ((kind, reference), set) in sets {
        let starts = |v: &&&Variable<'_>| v.typed_attribute("start").is_some() && v.variability != "constant";
        let mut settable = set.iter().filter(starts);
        let Some((first, second)) = settable.next().zip(settable.next()) else { continue };
        findings.push(Finding::new(
            &rules::ALIAS,
            second.place(),
            format!(
                "{kind} reference {reference}, which {} has too, and both have a start value",
                first.name
            ),
            "at most one start value among variables with one reference",
            "give it a reference of its own, or remove one start value",
        ));
    }
}

/// The grammar of structured names: `a.b[1,2].'any text'`, perhaps within `der(...)`.
fn is_structured(name: &str) -> bool {
    if let Some(inner) = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')')) {
        let (identifier, order) = match inner.rsplit_once(',') {
            // A comma may also stand within an index.
            Some((identifier, order)) if is_number(order) && !identifier.ends_with('[') => (identifier, true),
            _ => (inner, false),
        };
        return is_identifier(identifier) || (order && is_identifier(inner));
    }
    is_identifier(name)
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())
}

fn is_identifier(text: &str) -> bool {
    let mut rest = text;
    loop {
        let Some(after) = base(rest).and_then(indices) else { return false };
        if after.is_empty() {
            return true;
        }
        let Some(next) = after.strip_prefix('.') else { return false };
        rest = next;
    }
}

/// What follows a B-name.
fn base(text: &str) -> Option<&str> {
    if let Some(quoted) = text.strip_prefix('\'') {
        let mut escaped = false;
        for (at, c) in quoted.char_indices() {
            match c {
                _ if escaped => escaped = false,
                '\\' => escaped = true,
                '\'' => return if at > 0 { quoted.get(at + 1..) } else { None },
                ' '..='~' => {}
                _ => return None,
            }
        }
        return None;
    }
    let end = text.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(text.len());
    let starts_well = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    if starts_well { text.get(end..) } else { None }
}

/// What follows array indices, if there are any.
fn indices(text: &str) -> Option<&str> {
    let Some(inner) = text.strip_prefix('[') else { return Some(text) };
    let (list, rest) = inner.split_once(']')?;
    if list.split(',').all(is_number) { Some(rest) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `gaps` finds among variables of these names.
    fn found(names: &[&str]) -> Vec<String> {
        let variable = |name: &&str| format!("<ScalarVariable name=\"{name}\"><Real/></ScalarVariable>");
        let variables: String = names.iter().map(variable).collect();
        let text = format!("<x><ModelVariables>{variables}</ModelVariables></x>");
        let tree = roxmltree::Document::parse(&text).unwrap();
        let mut findings = Vec::new();
        gaps(&Document::of(&tree), &mut findings);
        findings.into_iter().map(|finding| finding.found).collect()
    }

    #[test]
    fn gaps_are_found_however_large_the_index() {
        assert!(found(&["a[2]", "a[4]", "a[3]", "b[1]", "b[7]"]).is_empty());
        assert_eq!(found(&["a[1]", "a[2]", "a[4]"]), ["a[4] where a[3] should follow"]);
        assert_eq!(found(&["a[1]", "a[2]", "a[2]"]), ["a[2] where a[3] should follow"]);
        let most = format!("a[{}]", u64::MAX);
        assert_eq!(found(&[&most, &most, &most]), [format!("{most} where a[0] should follow")]);
    }

    #[test]
    fn structured_names_follow_the_grammar() {
        for good in
            ["a", "_1", "a.b[1,2].c", "der(a.b[3])", "der(x,2)", "der(x[1,2])", "'any text!'.b", "'a\\'b'"]
        {
            assert!(is_structured(good), "{good}");
        }
        for bad in [
            "", "1a", "a b", "a.", ".a", "a[]", "a[i]", "a[1", "a[1]b", "der(a", "a-b", "''", "'a", "b\u{e4}",
        ] {
            assert!(!is_structured(bad), "{bad}");
        }
    }
}

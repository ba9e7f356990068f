//! Declared types: each that is named is defined, and of the variable's own type.

use super::document::Document;
use super::finding::Finding;
use super::rules;

/// What is wrong with `declaredType`.
pub fn check(document: &Document<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    for variable in &document.variables {
        let Some(declared) = variable.typed_attribute("declaredType") else { continue };
        let found = match document.types.get(declared) {
            None => format!("declaredType=\"{declared}\", which is not defined"),
            Some(node) if node.tag_name().name() != variable.kind() => {
                format!("declaredType=\"{declared}\", which is of type {}", node.tag_name().name())
            }
            Some(_) => continue,
        };
        findings.push(Finding::new(
            &rules::DECLARED_TYPE,
            variable.place(),
            found,
            format!("the name of a SimpleType of type {}", variable.kind()),
            "define the type in <TypeDefinitions>, or remove declaredType",
        ));
    }
    findings
}

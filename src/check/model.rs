//! The model as a whole: version, GUID, identifier, flags, suggested experiment. Looks at no variable.

use super::document::{Document, place};
use super::finding::{Finding, Place};
use super::numbers;
use super::rules;
use roxmltree::Node;

/// What is wrong with the root element, the implementations and the experiment.
pub fn check(document: &Document<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let root = document.root;
    let at = place(root);
    guid(root, &at, &mut findings);
    if document.implementations.is_empty() {
        findings.push(Finding::new(
            &rules::KIND,
            at.clone(),
            "neither <ModelExchange> nor <CoSimulation>",
            "at least one of them",
            "add the one that the library implements",
        ));
    }
    for node in &document.implementations {
        implementation(*node, &mut findings);
    }
    let exchange = document.implementations.iter().any(|node| node.has_tag_name("ModelExchange"));
    if exchange && root.attribute("numberOfEventIndicators").is_none() {
        findings.push(Finding::new(
            &rules::EVENT_INDICATORS,
            at,
            "no numberOfEventIndicators",
            "their number, for model exchange (FMI 2.0.4, section 2.2.1)",
            "add numberOfEventIndicators, 0 if there are none",
        ));
    }
    experiment(document, &mut findings);
    findings
}

/// Whether it is another version of FMI.
pub fn version(document: &Document<'_>) -> Option<Finding> {
    let version = document.root.attribute("fmiVersion").filter(|version| version.trim() != "2.0")?;
    let mend = if version.trim().starts_with("3.") {
        "nothing else was looked at: check it with `fmpy validate FILE` (pip install FMPy), or export it as FMI 2.0"
    } else {
        "export the FMU as FMI 2.0; nothing else was looked at"
    };
    let found = format!("fmiVersion=\"{version}\"");
    Some(Finding::new(&rules::VERSION, place(document.root), found, "fmiVersion=\"2.0\"", mend))
}

fn guid(root: Node<'_, '_>, at: &Place, findings: &mut Vec<Finding>) {
    let Some(guid) = root.attribute("guid") else { return };
    if guid.trim().is_empty() {
        findings.push(Finding::new(
            &rules::GUID_EMPTY,
            at.clone(),
            "an empty guid",
            "a text that the library knows too",
            "give the FMU a GUID, in the XML and in the library",
        ));
    } else if guid.contains(['{', '}']) {
        findings.push(Finding::new(
            &rules::GUID_BRACES,
            at.clone(),
            format!("guid=\"{guid}\""),
            "a GUID without braces",
            "take the braces off, in the XML and in the library",
        ));
    }
}

fn implementation(node: Node<'_, '_>, findings: &mut Vec<Finding>) {
    let at = place(node);
    let name = node.tag_name().name();
    let flag = |attribute| node.attribute(attribute).and_then(numbers::boolean).unwrap_or(false);
    if let Some(identifier) = node.attribute("modelIdentifier") {
        let head = identifier.chars().next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
        if !head || !identifier.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            findings.push(Finding::new(
                &rules::IDENTIFIER,
                at.clone(),
                format!("modelIdentifier=\"{identifier}\""),
                "a C identifier",
                "use letters, digits and underscores, here and in the name of the library",
            ));
        }
    }
    if flag("needsExecutionTool") {
        findings.push(Finding::new(
            &rules::EXECUTION_TOOL,
            at.clone(),
            format!("needsExecutionTool=\"true\" of <{name}>"),
            "an FMU that runs by itself",
            "export it with its solver, if the tool can",
        ));
    }
    if flag("canSerializeFMUstate") && !flag("canGetAndSetFMUstate") {
        findings.push(Finding::new(
            &rules::SERIALIZE,
            at.clone(),
            "canSerializeFMUstate without canGetAndSetFMUstate",
            "both: only a state that was got can be serialised",
            "set both or none",
        ));
    }
    if flag("canRunAsynchronuously") {
        findings.push(Finding::new(
            &rules::ASYNCHRONOUS,
            at.clone(),
            "canRunAsynchronuously=\"true\"",
            "fmi2DoStep that is done when it returns",
            "set it to false unless fmi2Pending is really returned",
        ));
    }
    if flag("canBeInstantiatedOnlyOncePerProcess") {
        findings.push(Finding::new(
            &rules::ONLY_ONCE,
            at,
            "canBeInstantiatedOnlyOncePerProcess=\"true\"",
            "any number of instances",
            "keep all state in the instance, none in globals",
        ));
    }
}

fn experiment(document: &Document<'_>, findings: &mut Vec<Finding>) {
    let Some(node) = document.part("DefaultExperiment") else {
        findings.push(Finding::new(
            &rules::NO_EXPERIMENT,
            place(document.root),
            "no <DefaultExperiment>",
            "start, stop and step that suit the model",
            "add it before <ModelVariables>",
        ));
        return;
    };
    let number = |name| node.attribute(name).and_then(numbers::double);
    let start = number("startTime").unwrap_or(0.0);
    let mut complain = |found: String, expected: &str| {
        findings.push(Finding::new(
            &rules::EXPERIMENT,
            place(node),
            found,
            expected,
            "correct <DefaultExperiment>",
        ));
    };
    if let Some(stop) = number("stopTime")
        && (stop.is_nan() || stop <= start)
    {
        complain(format!("stopTime {stop} with startTime {start}"), "a stop after the start");
    }
    for name in ["stepSize", "tolerance"] {
        if let Some(value) = number(name)
            && !(value > 0.0 && value.is_finite())
        {
            complain(format!("{name}=\"{value}\""), "a number greater than 0");
        }
    }
}

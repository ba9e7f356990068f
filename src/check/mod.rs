//! `bess check`: what is wrong with an FMU, found without running it and then by a short run in a process of
//! its own. Any FMI 2.0 FMU, whoever made it. Changes no file, prints nothing, loads no library in this process.
//!
//! Each file asks one kind of question and answers with [`Finding`]s; [`rules`] is the list of all questions, each
//! with how bad it is and which tools refuse such an FMU.
#![forbid(unsafe_code)]

mod archive;
mod binary;
mod document;
mod finding;
mod initial;
mod model;
mod names;
mod numbers;
mod probe;
pub mod rules;
mod run;
mod schema;
mod schema_table;
mod structure;
mod types;
mod units;
mod variables;

pub use finding::{Finding, Place, Severity};
pub use probe::probe;
pub use rules::Rule;
pub use run::Runner;

use document::Document;
use std::path::Path;

/// What was found, and what was looked at.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Worst first; within a severity in the order of the file.
    pub findings: Vec<Finding>,
    /// What is there, for a person: name, kind, platforms, what ran.
    pub facts: Vec<(String, String)>,
    /// Whether there is a co-simulation FMU to run.
    co_simulation: bool,
}

impl Report {
    /// How many findings of this severity there are.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.rule.severity == severity).count()
    }

    fn add(&mut self, findings: Vec<Finding>) {
        self.findings.extend(findings);
    }

    fn fact(&mut self, name: &str, value: impl Into<String>) {
        self.facts.push((name.to_owned(), value.into()));
    }
}

/// Checks the FMU at `path`; with a `runner`, also by running it, which executes its code.
pub fn check(path: &Path, runner: Option<&Runner>) -> Report {
    let mut report = Report::default();
    statically(path, &mut report);
    if let Some(runner) = runner {
        runner.run(path, &mut report);
    }
    report.findings.sort_by_key(|finding| finding.rule.severity);
    report
}

fn statically(path: &Path, report: &mut Report) {
    let Some(contents) = archive::read(path, report) else { return };
    let Some(bytes) = contents.description.as_deref() else { return };
    let text = match document::decode(bytes) {
        Ok(text) => text,
        Err(finding) => return report.findings.push(*finding),
    };
    let tree = match document::parse(&text) {
        Ok(tree) => tree,
        Err(finding) => return report.findings.push(*finding),
    };
    let document = Document::of(&tree);
    // Another version has another schema: nothing below would mean anything.
    if let Some(finding) = model::version(&document) {
        report.fact("model", document.summary());
        return report.findings.push(finding);
    }
    report.co_simulation = document.implementations.iter().any(|node| node.has_tag_name("CoSimulation"));
    report.add(schema::check(&tree));
    report.fact("model", document.summary());
    report.add(model::check(&document));
    report.add(names::check(&document));
    report.add(variables::check(&document));
    report.add(initial::check(&document));
    report.add(types::check(&document));
    report.add(units::check(&document));
    report.add(structure::check(&document));
    let found = binary::check(&document, &contents, &mut report.facts);
    report.add(found);
}

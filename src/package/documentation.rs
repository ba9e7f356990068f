//! What an FMU carries for people: `documentation/index.html`, `model.png`, the licences. The table of
//! variables is that of the model; prose and drawing are files beside this one. Decides nothing about the model.

pub mod three;

use super::PackageError;
use super::archive::Entries;
use crate::fmi::lookup::Value;
use crate::fmi::{Causality, Group, Interface, Model, Registry, Variability};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// What is written by hand for one model.
pub struct Papers {
    title: &'static str,
    prose: &'static str,
    /// Where the prose begins to say how to start, in FMI 3.0.
    start_3: &'static str,
    /// The drawing, as SVG and rendered.
    drawing: &'static str,
    icon: &'static [u8],
    third_party: &'static str,
    /// What is linked into the shared libraries, in CycloneDX.
    materials: &'static str,
}

/// Of `BessConsensus.fmu`.
pub const CONTROLLER: Papers = Papers {
    title: "Finite-time consensus controller for battery storage",
    prose: include_str!("documentation/controller.html"),
    start_3: include_str!("documentation/controller_start_3.html"),
    drawing: include_str!("icons/BessConsensus.svg"),
    icon: include_bytes!("icons/BessConsensus.png"),
    third_party: include_str!("licenses/BessConsensus.txt"),
    materials: include_str!("sbom/BessConsensus.cdx.json"),
};

/// Of `BessGrid.fmu`.
pub const GRID: Papers = Papers {
    title: "Power network with droop-controlled battery inverters",
    prose: include_str!("documentation/grid.html"),
    start_3: include_str!("documentation/grid_start_3.html"),
    drawing: include_str!("icons/BessGrid.svg"),
    icon: include_bytes!("icons/BessGrid.png"),
    third_party: include_str!("licenses/BessGrid.txt"),
    materials: include_str!("sbom/BessGrid.cdx.json"),
};

const STYLE: &str = include_str!("documentation/page.css");
const LICENCE: &str = include_str!("documentation/licence.html");

/// More different values than these are shown by their range.
const MAX_VALUES: usize = 8;

/// All entries of the archive that are there for people.
pub fn entries<M: Model>(model: &M, interface: Interface, papers: &Papers) -> Result<Entries, PackageError> {
    let mut entries = licences(papers);
    entries.insert("documentation/index.html".to_owned(), page(model, interface, papers)?.into_bytes());
    entries.insert("model.png".to_owned(), papers.icon.to_vec());
    Ok(entries)
}

/// What is the same in every edition.
fn licences(papers: &Papers) -> Entries {
    let text = |name: &str, text: &str| (format!("documentation/{name}"), text.as_bytes().to_vec());
    [
        text("licenses/license.txt", include_str!("licenses/license.txt")),
        text("licenses/LICENSE-MIT", include_str!("../../LICENSE-MIT")),
        text("licenses/LICENSE-APACHE", include_str!("../../LICENSE-APACHE")),
        text("licenses/FMI-headers-BSD-2-Clause.txt", include_str!("../fmi/headers/LICENSE")),
        text("licenses/third-party.txt", papers.third_party),
        // FMI 2.0 knows no folder `extra/`, and `resources/` is what the library reads.
        text("sbom.cdx.json", papers.materials),
    ]
    .into()
}

fn page<M: Model>(model: &M, interface: Interface, papers: &Papers) -> Result<String, PackageError> {
    let registry = Registry::new(model, interface)?;
    let mut html = head(M::IDENTIFIER, papers, "2.0");
    html.push_str(&filled(papers.prose, M::IDENTIFIER, &registry, interface));
    let _ = write!(
        html,
        "<h2 id=\"variables\">All variables</h2>\n<p>{} variables; arrays count from 1. A value outside the accepted \
         ones, and any that is not finite, is refused by name and changes nothing.</p>\n",
        registry.len()
    );
    table(&mut html, &registry, model, interface);
    foot(&mut html);
    Ok(html)
}

/// From the beginning to the prose, for this version of FMI.
fn head(identifier: &str, papers: &Papers, version_of_fmi: &str) -> String {
    let mut html = String::from("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    let (title, version) = (escaped(papers.title), env!("CARGO_PKG_VERSION"));
    let _ = write!(
        html,
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{identifier}: {title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <header>{}<div><h1>{title}</h1>\n\
         <p class=\"subtitle\">{identifier}.fmu, an FMI {version_of_fmi} co-simulation FMU of bess-consensus {version}</p></div></header>\n\
         <nav><a href=\"#what\">What it is</a> &middot; <a href=\"#quick-start\">Quick start</a> &middot; \
         <a href=\"#connect\">Connect</a> &middot; <a href=\"#parameters\">Parameters</a> &middot; \
         <a href=\"#variables\">All variables</a> &middot; <a href=\"#licence\">Licence</a></nav>\n",
        papers.drawing,
    );
    html
}

/// From the end of the table.
fn foot(html: &mut String) {
    html.push_str(LICENCE);
    let version = env!("CARGO_PKG_VERSION");
    let _ = write!(html, "<footer>bess-consensus {version}</footer>\n</body>\n</html>\n");
}

/// The prose with the names as this interface spells them.
fn filled<M: Model>(prose: &str, identifier: &str, registry: &Registry<M>, interface: Interface) -> String {
    let batteries = registry.group("omega_set").map_or(0, |(_, group)| group.len());
    let truth = match interface {
        Interface::Structured => "True",
        Interface::Portable => "1.0",
    };
    let mut html = prose
        .replace("{{n}}", &batteries.to_string())
        .replace("{{file}}", &format!("{identifier}.fmu"))
        .replace("{{true}}", truth);
    for (_, group) in registry.groups() {
        for index in ["1", "i"] {
            let name = element(group.name, index, interface);
            html = html.replace(&format!("{{{{{}_{index}}}}}", group.name), &name);
        }
    }
    html
}

fn element(group: &str, index: &str, interface: Interface) -> String {
    match interface {
        Interface::Structured => format!("{group}[{index}]"),
        Interface::Portable => format!("{group}_{index}"),
    }
}

/// A part of the table: its heading, and which groups belong to it.
type Kind<M> = (&'static str, fn(&Group<M>) -> bool);

fn table<M: Model>(html: &mut String, registry: &Registry<M>, model: &M, interface: Interface) {
    html.push_str(
        "<div class=\"table\"><table id=\"variable-table\">\n<thead><tr><th>name</th><th>type</th><th>unit</th>\
         <th>start</th><th>accepted</th><th>meaning</th></tr></thead>\n<tbody>\n",
    );
    let kinds: [Kind<M>; 4] = [
        ("Inputs", |g| g.causality == Causality::Input),
        ("Outputs", |g| g.causality == Causality::Output),
        ("Parameters, tunable: may be set between steps", |g| {
            g.causality == Causality::Parameter && g.variability == Variability::Tunable
        }),
        ("Parameters, fixed: may be set until initialisation ends", |g| {
            g.causality == Causality::Parameter && g.variability != Variability::Tunable
        }),
    ];
    for (heading, belongs) in kinds {
        let mut groups = registry.groups().filter(|(_, g)| belongs(g) && !g.is_empty()).peekable();
        if groups.peek().is_some() {
            let _ = writeln!(html, "<tr class=\"group\"><th colspan=\"6\">{heading}</th></tr>");
        }
        for (_, group) in groups {
            let name = match group.count {
                None => group.name.to_owned(),
                Some(count) => element(group.name, &format!("1\u{2026}{count}"), interface),
            };
            let start = if group.causality == Causality::Output {
                "calculated".to_owned()
            } else {
                starts(group, model, interface)
            };
            let accepted = match group.causality {
                Causality::Output => String::new(),
                _ => {
                    group.range.to_string().replace("a finite value ", "").replace("a finite value", "finite")
                }
            };
            let accepted = if matches!(group.value(model, 0, interface), Value::Boolean(_)) {
                String::new()
            } else {
                accepted
            };
            let _ = writeln!(
                html,
                "<tr><td><code>{}</code></td><td>{}</td><td>{}</td><td class=\"start\">{}</td><td>{}</td><td>{}</td></tr>",
                escaped(&name),
                group.type_in(interface),
                escaped(group.unit.map_or("", |unit| unit.name())),
                escaped(&start),
                escaped(&accepted),
                escaped(group.description),
            );
        }
    }
    html.push_str("</tbody>\n</table></div>\n");
}

/// The start values of a group: one if all agree, all if they are few, else from least to greatest.
fn starts<M: Model>(group: &Group<M>, model: &M, interface: Interface) -> String {
    let number = |value: Value| match value {
        Value::Real(value) => format!("{value}"),
        Value::Integer(value) => value.to_string(),
        Value::Boolean(value) => value.to_string(),
    };
    let all: Vec<String> = (0..group.len()).map(|k| number(group.value(model, k, interface))).collect();
    let different: BTreeSet<&str> = all.iter().map(String::as_str).collect();
    match (different.len(), all.first()) {
        (1, Some(only)) => only.clone(),
        _ if all.len() <= MAX_VALUES => all.join(", "),
        _ => {
            let reals = || all.iter().filter_map(|text| text.parse::<f64>().ok());
            let (low, high) =
                (reals().fold(f64::INFINITY, f64::min), reals().fold(f64::NEG_INFINITY, f64::max));
            format!("{low} to {high}")
        }
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

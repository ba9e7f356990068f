//! What an FMU of FMI 3.0 carries for people: the same page with arrays in the place of elements, the same licences, the
//! icon where FMI 3.0 looks for it.

use super::{Entries, Papers, escaped, filled, foot, head, licences, table};
use crate::fmi::{Interface, Model, Registry, Shape, Values};
use crate::package::PackageError;
use std::fmt::Write as _;

const ICON: &str = include_str!("icon.xml");

/// All entries of the archive that are there for people.
pub fn entries<M: Model>(model: &M, papers: &Papers) -> Result<Entries, PackageError> {
    let mut entries = licences(papers);
    entries.insert("documentation/index.html".to_owned(), page(model, papers)?.into_bytes());
    entries.insert("terminalsAndIcons/icon.png".to_owned(), papers.icon.to_vec());
    entries.insert("terminalsAndIcons/icon.svg".to_owned(), papers.drawing.as_bytes().to_vec());
    entries.insert("terminalsAndIcons/terminalsAndIcons.xml".to_owned(), ICON.as_bytes().to_vec());
    Ok(entries)
}

fn page<M: Model>(model: &M, papers: &Papers) -> Result<String, PackageError> {
    let interface = Interface::Structured;
    let registry = Registry::new(model, interface)?;
    let mut html = head(M::IDENTIFIER, papers, "3.0");
    let prose = with_start(papers.prose, papers.start_3);
    let prose = filled(&prose, M::IDENTIFIER, &registry, interface);
    html.push_str(&prose);
    let shape = model.shape();
    let count = 1 + registry.groups().len() + shape.sizes.len() + shape.arrays.len();
    let _ = write!(
        html,
        "<h2 id=\"variables\">All variables</h2>\n<p>{count} variables; <code>P[1\u{2026}7]</code> is one, the array \
         <code>P</code>. A value outside the accepted ones, and any that is not finite, is refused by name and changes \
         nothing.</p>\n"
    );
    let mut rows = String::new();
    table(&mut rows, &registry, model, interface);
    for (two, three) in [("Real", "Float64"), ("Integer", "Int32")] {
        rows = rows.replace(&format!("<td>{two}</td>"), &format!("<td>{three}</td>"));
    }
    let end = "</tbody>";
    html.push_str(&rows.replacen(end, &format!("{}{end}", shape_rows(&shape)), 1));
    foot(&mut html);
    Ok(html)
}

/// The prose with another quick start.
fn with_start(prose: &str, start: &str) -> String {
    let parts = prose
        .split_once("<h2 id=\"quick-start\">")
        .and_then(|(what, rest)| Some((what, rest.split_once("<h2 id=\"connect\">")?.1)));
    match parts {
        Some((what, rest)) => format!("{what}{start}<h2 id=\"connect\">{rest}"),
        None => prose.to_owned(),
    }
}

/// The rows of sizes, arrays and the time.
fn shape_rows(shape: &Shape) -> String {
    let mut rows = String::new();
    let heading = |rows: &mut String, text| {
        let _ = writeln!(rows, "<tr class=\"group\"><th colspan=\"6\">{text}</th></tr>");
    };
    heading(&mut rows, "Structural parameters: set in configuration mode");
    for size in &shape.sizes {
        let accepted =
            if size.min == size.max { size.min.to_string() } else { format!("{} to {}", size.min, size.max) };
        let _ = writeln!(
            rows,
            "<tr><td><code>{}</code></td><td>UInt64</td><td></td><td class=\"start\">{}</td><td>{accepted}</td><td>{}</td></tr>",
            size.name,
            size.value,
            escaped(size.description)
        );
    }
    if !shape.arrays.is_empty() {
        heading(&mut rows, "Graph: may be set until initialisation ends");
    }
    for array in &shape.arrays {
        let kind = if matches!(array.values, Values::UInt64(_)) { "UInt64" } else { "Float64" };
        let accepted = array.at_most.map_or(">= 0".to_owned(), |size| format!("0 to {size}"));
        let _ = writeln!(
            rows,
            "<tr><td><code>{}[1\u{2026}{}]</code></td><td>{kind}</td><td>{}</td><td class=\"start\">0</td><td>{}</td><td>{}</td></tr>",
            array.name,
            array.size,
            escaped(array.unit.map_or("", |unit| unit.name())),
            escaped(&accepted),
            escaped(array.description)
        );
    }
    heading(&mut rows, "Time");
    rows.push_str(
        "<tr><td><code>time</code></td><td>Float64</td><td>s</td><td class=\"start\">calculated</td><td></td>\
         <td>Simulation time</td></tr>\n",
    );
    rows
}

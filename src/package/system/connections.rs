//! Who feeds whom: the scenario's table first, then equal names, as `bess run` connects.

use super::SystemError;
use super::part::{Part, Variable};
use crate::fmi::Causality;
use crate::scenario::connection::Wire;
use std::collections::BTreeSet;

/// One wire of the system: `to = factor from + offset`.
pub struct Connection<'a> {
    /// Component and output.
    pub from: (&'a Part, &'a Variable),
    /// Component and input.
    pub to: (&'a Part, &'a Variable),
    /// In units of `to` per unit of `from`.
    pub factor: f64,
    /// In units of `to`.
    pub offset: f64,
}

impl Connection<'_> {
    /// Whether this is the source of that input.
    pub fn feeds(&self, part: &Part, variable: &Variable) -> bool {
        self.to.0.name == part.name && self.to.1.name == variable.name
    }
}

/// All wires, in the order of table, components and inputs.
pub fn between<'a>(parts: &'a [Part], table: &[Wire]) -> Result<Vec<Connection<'a>>, SystemError> {
    let mut all: Vec<Connection<'a>> = Vec::new();
    for line in table {
        let path = format!("connections, {} to {}", line.from, line.to);
        let from = endpoint(parts, &path, &line.from, Causality::Output, "output; as grid.P[1]")?;
        let to = endpoint(parts, &path, &line.to, Causality::Input, "input; as controller.P[1]")?;
        if from.1.kind != to.1.kind {
            return Err(SystemError::Types {
                path,
                from: line.from.clone(),
                from_type: from.1.kind.to_string(),
                to: line.to.clone(),
                to_type: to.1.kind.to_string(),
            });
        }
        if all.iter().any(|c| c.feeds(to.0, to.1)) {
            return Err(SystemError::Refused { path, reason: format!("{} already has a source", line.to) });
        }
        all.push(Connection { from, to, factor: line.factor, offset: line.offset });
    }
    let taken: BTreeSet<(&str, &str)> = all.iter().map(|c| (c.to.0.name, c.to.1.name.as_str())).collect();
    let mut equal = Vec::new();
    for part in parts {
        let open =
            |v: &&Variable| v.causality == Causality::Input && !taken.contains(&(part.name, v.name.as_str()));
        for input in part.variables.iter().filter(open) {
            let mut others = parts.iter().filter(|other| other.name != part.name);
            let source = others.find_map(|other| {
                let output = other.find(&input.structured, Causality::Output)?;
                (output.kind == input.kind).then_some((other, output))
            });
            if let Some(from) = source {
                equal.push(Connection { from, to: (part, input), factor: 1.0, offset: 0.0 });
            }
        }
    }
    all.extend(equal);
    Ok(all)
}

fn endpoint<'a>(
    parts: &'a [Part],
    path: &str,
    name: &str,
    causality: Causality,
    expected: &'static str,
) -> Result<(&'a Part, &'a Variable), SystemError> {
    let found = name.split_once('.').and_then(|(owner, variable)| {
        let part = parts.iter().find(|part| part.name == owner)?;
        Some((part, part.find(variable, causality)?))
    });
    found.ok_or_else(|| SystemError::Unknown { path: path.to_owned(), found: name.to_owned(), expected })
}

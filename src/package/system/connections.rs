//! Who feeds whom: the scenario's table first, then equal names, as `bess run` connects.

use super::SystemError;
use super::part::{Part, Variable};
use crate::fmi::Causality;
use crate::scenario::connection::Wire;
use crate::scenario::equal_names::EqualNames;
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

/// The wires of a table, in its order.
pub fn listed<'a>(parts: &'a [Part], table: &[Wire]) -> Result<Vec<Connection<'a>>, SystemError> {
    let mut all: Vec<Connection<'a>> = Vec::new();
    for wire in table {
        let path = format!("connections[{}]", wire.line);
        let from = endpoint(parts, &path, ("from", &wire.from), Causality::Output, "output; as grid.P[1]")?;
        let to = endpoint(parts, &path, ("to", &wire.to), Causality::Input, "input; as controller.P[1]")?;
        if from.1.kind != to.1.kind {
            return Err(SystemError::Types {
                path,
                from: wire.from.clone(),
                from_type: from.1.kind.to_string(),
                to: wire.to.clone(),
                to_type: to.1.kind.to_string(),
            });
        }
        if all.iter().any(|c| c.feeds(to.0, to.1)) {
            let (path, reason) = (path + ".to", format!("{} already has a source", wire.to));
            return Err(SystemError::Refused { path, reason });
        }
        all.push(Connection { from, to, factor: wire.factor, offset: wire.offset });
    }
    Ok(all)
}

/// All wires, in the order of table, components and inputs.
pub fn between<'a>(parts: &'a [Part], table: &[Wire]) -> Result<Vec<Connection<'a>>, SystemError> {
    let mut all = listed(parts, table)?;
    let taken: BTreeSet<(&str, &str)> = all.iter().map(|c| (&*c.to.0.name, &*c.to.1.name)).collect();
    let of = |causality: Causality| {
        let variables = |part: &'a Part| part.variables.iter().map(move |variable| (part, variable));
        parts.iter().flat_map(variables).filter(move |(_, variable)| variable.causality == causality)
    };
    let outputs = of(Causality::Output);
    let names = EqualNames::of(outputs.map(|output| (&*output.0.name, output.1.structured.as_str(), output)));
    let mut equal = Vec::new();
    for to in of(Causality::Input).filter(|(part, input)| !taken.contains(&(&*part.name, &*input.name))) {
        let (part, input) = to;
        let source = names.source(&part.name, &input.structured).map_err(|sources| SystemError::Refused {
            path: "connections".to_owned(),
            reason: format!("{}.{} could be fed by each of {sources}", part.name, input.structured),
        })?;
        // `bess run` converts types; whoever opens the system need not.
        if let Some((_, from)) = source.filter(|(_, (_, output))| output.kind == input.kind) {
            equal.push(Connection { from, to, factor: 1.0, offset: 0.0 });
        }
    }
    all.extend(equal);
    Ok(all)
}

fn endpoint<'a>(
    parts: &'a [Part],
    path: &str,
    (key, name): (&str, &str),
    causality: Causality,
    expected: &'static str,
) -> Result<(&'a Part, &'a Variable), SystemError> {
    let found = name.split_once('.').and_then(|(owner, variable)| {
        let part = parts.iter().find(|part| part.name == owner)?;
        Some((part, part.find(variable, causality)?))
    });
    found.ok_or_else(|| SystemError::Unknown {
        path: format!("{path}.{key}"),
        found: name.to_owned(),
        expected,
    })
}

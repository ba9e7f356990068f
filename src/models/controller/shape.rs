//! What a user may choose about a controller before it is initialised, by FMI 3.0: the number of agents, and a
//! communication graph by its edges and pins. Only the way from arrays to a configuration and back to their names.

use crate::control::communication::{ExplicitEdge, ExplicitPin};
use crate::control::config::Config;
use crate::control::error::{ConfigError, Problem};
use crate::fmi::{Array, ModelError, Range, Shape, Size, Values};
use std::collections::BTreeMap;

/// More agents would need more memory than a machine has: an instance keeps about a kilobyte for each.
const MOST_AGENTS: u64 = 1 << 20;
/// The same of edges.
const MOST_EDGES: u64 = 1 << 23;

/// The shape of a controller whose file has `n` agents: nothing chosen.
pub fn shape(n: usize) -> Shape {
    let n = n as u64;
    let size = |name, description, value, min, max: u64, mend| Size {
        name,
        description,
        value,
        min,
        max: max.max(value),
        mend,
    };
    let array = |name, description, size, at_most, values| Array {
        name,
        description,
        unit: None,
        size,
        at_most,
        range: Range::NOT_NEGATIVE,
        values,
    };
    Shape {
        sizes: vec![
            size("n", "Number of agents", n, 1, MOST_AGENTS, "use several FMUs for more agents"),
            size("n_edges", "Number of rows of edge_*", 1, 0, MOST_EDGES, "use several FMUs for more edges"),
        ],
        arrays: vec![
            array(
                "edge_from",
                "One end of a communication edge; rows of zeros are left out",
                "n_edges",
                Some("n"),
                Values::UInt64(vec![0]),
            ),
            array("edge_to", "Its other end", "n_edges", Some("n"), Values::UInt64(vec![0])),
            array("edge_weight", "Its weight w_ij = w_ji", "n_edges", None, Values::Float64(vec![0.0])),
            array(
                "pin_weight",
                "Weight a_0i to the virtual leader; all 0: agent 1 alone, weight 1",
                "n",
                None,
                Values::Float64(vec![0.0; n as usize]),
            ),
        ],
    }
}

/// The configuration of a shape: that of the file for another number of agents, with the graph that is written. Where no
/// edge is written it is the file's own for as many agents as there, else a ring.
pub fn configured(file: &Config, shape: &Shape) -> Result<Config, ModelError> {
    let n = shape.size("n").and_then(|n| usize::try_from(n).ok()).unwrap_or(file.agents());
    let config = file.sized(n);
    let (edges, pins) = (edges(shape)?, pins(shape)?);
    match (edges.is_empty(), pins.is_empty()) {
        (true, true) => Ok(config),
        (true, false) if n > 1 && n == file.agents() => {
            let pinned = pins.first().map_or(1, |pin| pin.agent);
            Err(ModelError::new(format!(
                "pin_weight[{pinned}]: found a weight and no edges; expected edge_from, edge_to and edge_weight too, \
                 because the file's graphs have pins of their own"
            )))
        }
        (no_edges, no_pins) => {
            let edges = if no_edges { crate::control::sized::ring(n) } else { edges };
            let pins = if no_pins { vec![ExplicitPin { agent: 1, weight: 1.0 }] } else { pins };
            let config = config.with_graph("written".to_owned(), edges, pins);
            config.validate().map_err(|error| in_words(&error))?;
            Ok(config)
        }
    }
}

/// The rows that are not zeros, each pair of agents once.
fn edges(shape: &Shape) -> Result<Vec<ExplicitEdge>, ModelError> {
    let (from, to, weight) =
        (shape.numbers("edge_from"), shape.numbers("edge_to"), shape.reals("edge_weight"));
    let (mut edges, mut rows) = (Vec::new(), BTreeMap::new());
    for (row, ((&from, &to), &weight)) in (1..).zip(from.iter().zip(to).zip(weight)) {
        if (from, to) == (0, 0) && weight == 0.0 {
            continue;
        }
        let refused = |name, found: &dyn std::fmt::Display, expected: &str| {
            Err(ModelError::new(format!("{name}[{row}]: found {found}, expected {expected}")))
        };
        for (name, agent) in [("edge_from", from), ("edge_to", to)] {
            if agent == 0 {
                return refused(name, &agent, "the number of an agent, from 1; a row of zeros is left out");
            }
        }
        if weight < Range::SMALLEST {
            return refused("edge_weight", &weight, "a weight > 0; a row of zeros is left out");
        }
        if from == to {
            return refused("edge_to", &to, "another agent than in edge_from");
        }
        if let Some(first) = rows.insert((from.min(to), from.max(to)), row) {
            let found = format!("agents {from} and {to} again, as in row {first}");
            return refused("edge_from, edge_to", &found, "each pair of agents once");
        }
        // No agent number is larger than n, which is far below this.
        edges.push(ExplicitEdge { a: from as u32, b: to as u32, weight, delay_s: None });
    }
    Ok(edges)
}

/// Those whose weight is not 0.
fn pins(shape: &Shape) -> Result<Vec<ExplicitPin>, ModelError> {
    let weights = (1..).zip(shape.reals("pin_weight")).filter(|(_, weight)| **weight > 0.0);
    let pin = |(agent, &weight): (u32, &f64)| {
        if weight < Range::SMALLEST {
            let text =
                format!("pin_weight[{agent}]: found {weight}, expected 0 or at least {}", Range::SMALLEST);
            return Err(ModelError::new(text));
        }
        Ok(ExplicitPin { agent, weight })
    };
    weights.map(pin).collect()
}

/// Problems of the graph by the names of the arrays.
fn in_words(error: &ConfigError) -> ModelError {
    let renamed = |problem: &Problem| {
        let path = if problem.path.ends_with(".edges") {
            "edge_from, edge_to"
        } else if problem.path.ends_with(".pins") {
            "pin_weight"
        } else {
            &problem.path
        };
        Problem { path: path.to_owned(), ..problem.clone() }.to_string()
    };
    ModelError::new(error.problems.iter().map(renamed).collect::<Vec<_>>().join("; "))
}

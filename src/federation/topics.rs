//! What travels between federates, as data: one topic for each array (or each element of it) that a federate tells
//! another, with the names under which HELICS knows it. Made from a plan's connections, the same in every federate.

use crate::harness::{Connection, Participant};
use std::collections::BTreeMap;

/// Whether arrays travel as one vector for each receiver, or each element as a number of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// `grid/controller/P`, a vector in the order of the receiver's inputs.
    #[default]
    Vectors,
    /// `grid/P/1`, a double for every element.
    Doubles,
}

/// What one federate tells another at every communication point.
#[derive(Clone, Debug, PartialEq)]
pub struct Topic {
    /// Who tells it.
    pub from: String,
    /// Who is told.
    pub to: String,
    /// Name of the publication.
    pub publication: String,
    /// Name of the receiver's input.
    pub input: String,
    /// Unit of the values, if the sender's variables have one.
    pub unit: String,
    /// Names of the sender's variables, in order.
    pub variables: Vec<String>,
    /// Whether it is one double.
    pub is_double: bool,
}

/// All topics of a federation, sorted by sender, receiver and quantity.
pub fn topics(participants: &[Box<dyn Participant>], connections: &[Connection], form: Form) -> Vec<Topic> {
    let mut topics: BTreeMap<(String, String, String, usize), Topic> = BTreeMap::new();
    let between = connections.iter().filter(|c| c.from.participant != c.to.participant);
    for connection in between {
        let (from, to) = (&connection.from.participant, &connection.to.participant);
        let variable = &connection.from.variable;
        let quantity = variable.split('[').next().unwrap_or(variable);
        let path = path_of(variable);
        let order = if form == Form::Doubles { index_of(variable) } else { 0 };
        let key = (from.clone(), to.clone(), quantity.to_owned(), order);
        let topic = topics.entry(key).or_insert_with(|| {
            let declared = participants.iter().filter(|p| p.name() == from).flat_map(|p| p.variables());
            let unit = declared.into_iter().find(|v| v.name == *variable).and_then(|v| v.unit.clone());
            let is_double = form == Form::Doubles || quantity == variable;
            let publication = match form {
                Form::Vectors => format!("{from}/{to}/{quantity}"),
                Form::Doubles => format!("{from}/{path}"),
            };
            Topic {
                from: from.clone(),
                to: to.clone(),
                publication,
                input: format!("{to}/from/{from}/{}", if form == Form::Doubles { &path } else { quantity }),
                unit: unit.unwrap_or_default(),
                variables: Vec::new(),
                is_double,
            }
        });
        if !topic.variables.contains(variable) {
            topic.variables.push(variable.clone());
        }
    }
    topics.into_values().collect()
}

/// What of a federation one federate tells and hears.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Share {
    /// Topics that it hears; their values stand one after the other.
    pub heard: Vec<Topic>,
    /// Topics that it tells.
    pub told: Vec<Topic>,
    /// Its own variables that it tells, each once.
    pub told_variables: Vec<String>,
}

impl Share {
    /// The share of the federate of this name.
    pub fn of(name: &str, topics: &[Topic]) -> Self {
        let mut share = Share {
            heard: topics.iter().filter(|topic| topic.to == name).cloned().collect(),
            told: topics.iter().filter(|topic| topic.from == name).cloned().collect(),
            told_variables: Vec::new(),
        };
        for variable in share.told.iter().flat_map(|topic| &topic.variables) {
            if !share.told_variables.contains(variable) {
                share.told_variables.push(variable.clone());
            }
        }
        share
    }

    /// Number of values heard.
    pub fn heard_count(&self) -> usize {
        self.heard.iter().map(|topic| topic.variables.len()).sum()
    }
}

/// `P/3` of `P[3]`, `bus/V/12` of `bus.V[12]`.
fn path_of(variable: &str) -> String {
    let parts = variable.split(['[', ']', ',', '.']).filter(|part| !part.is_empty());
    parts.collect::<Vec<_>>().join("/")
}

fn index_of(variable: &str) -> usize {
    let index = variable.split_once('[').and_then(|(_, rest)| rest.strip_suffix(']'));
    index.and_then(|text| text.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::Endpoint;

    fn connection(from: (&str, &str), to: (&str, &str)) -> Connection {
        Connection::new(Endpoint::new(from.0, from.1), Endpoint::new(to.0, to.1))
    }

    #[test]
    fn arrays_become_vectors_in_the_order_of_the_connections() {
        let connections = [
            connection(("grid", "P[2]"), ("cluster1", "P[1]")),
            connection(("grid", "P[1]"), ("cluster1", "P[2]")),
            connection(("grid", "P[3]"), ("cluster2", "P[1]")),
            connection(("cluster1", "omega_set[1]"), ("grid", "omega_set[2]")),
            connection(("cluster1", "a"), ("cluster1", "b")),
        ];
        let found = topics(&[], &connections, Form::Vectors);
        let names: Vec<&str> = found.iter().map(|topic| topic.publication.as_str()).collect();
        assert_eq!(names, ["cluster1/grid/omega_set", "grid/cluster1/P", "grid/cluster2/P"]);
        assert_eq!(found[1].variables, ["P[2]", "P[1]"]);
        assert_eq!(found[1].input, "cluster1/from/grid/P");
        let found = topics(&[], &connections, Form::Doubles);
        let names: Vec<&str> = found.iter().map(|topic| topic.publication.as_str()).collect();
        assert_eq!(names, ["cluster1/omega_set/1", "grid/P/1", "grid/P/2", "grid/P/3"]);
        assert!(found.iter().all(|topic| topic.is_double && topic.variables.len() == 1));
    }
}

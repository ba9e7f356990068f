//! What travels between federates, as data: one topic for each array (or each element of it) that a federate tells
//! another, with the names under which HELICS knows it. Made from a plan's connections, the same in every federate.

use crate::harness::{Causality, Connection, Kind, Participant, Value, Variability, Variable};
use std::collections::BTreeMap;

/// What becomes a topic of its own between the grid and a controller. Among each other controllers always tell all in one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// `grid/controller/P`: each array, a vector in the order of the receiver's inputs.
    #[default]
    Vectors,
    /// `grid/P/1`: each element, a double.
    Doubles,
    /// `grid/controller/all`: everything, one vector. The fewest messages.
    Packed,
}

/// Quantity of a topic that holds everything.
const ALL: &str = "all";

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

/// All topics of a federation, sorted by sender, receiver and quantity; `plant` is the participant to which `form` applies.
pub fn topics(
    participants: &[Box<dyn Participant>],
    connections: &[Connection],
    (form, plant): (Form, &str),
) -> Vec<Topic> {
    let mut topics: BTreeMap<(String, String, String, usize, String), Topic> = BTreeMap::new();
    let between = connections.iter().filter(|c| c.from.participant != c.to.participant);
    for connection in between {
        let (from, to) = (&connection.from.participant, &connection.to.participant);
        let variable = &connection.from.variable;
        let form = if from == plant || to == plant { form } else { Form::Packed };
        let array = array_of(variable);
        let array = array.as_str();
        let quantity = if form == Form::Packed { ALL } else { array };
        let path = path_of(variable);
        // Elements by their numbers; what else has brackets, `inverter[2].P`, by its name.
        let (order, own) = match form {
            Form::Doubles => (index_of(variable), variable.clone()),
            Form::Vectors | Form::Packed => (0, String::new()),
        };
        let key = (from.clone(), to.clone(), quantity.to_owned(), order, own);
        let topic = topics.entry(key).or_insert_with(|| {
            let declared = participants.iter().filter(|p| p.name() == from).flat_map(|p| p.variables());
            let unit = declared.into_iter().find(|v| v.name == *variable).and_then(|v| v.unit.clone());
            let is_double = form == Form::Doubles || quantity == variable;
            let (publication, heard) = match form {
                Form::Vectors | Form::Packed => (format!("{from}/{to}/{quantity}"), quantity),
                Form::Doubles => (format!("{from}/{path}"), path.as_str()),
            };
            let unit = unit.filter(|_| form != Form::Packed);
            Topic {
                from: from.clone(),
                to: to.clone(),
                publication,
                input: format!("{to}/from/{from}/{heard}"),
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

    /// As variables of the others: what is heard are outputs, `grid.P[1]`, what is told inputs, `omega_set[1]`; all Real,
    /// with references that count on.
    pub fn variables(&self) -> Vec<Variable> {
        let heard = self.heard.iter().flat_map(|topic| {
            let unit = Some(topic.unit.clone()).filter(|unit| !unit.is_empty());
            let name = |variable: &String| format!("{}.{variable}", topic.from);
            topic.variables.iter().map(move |variable| (name(variable), Causality::Output, unit.clone()))
        });
        let told = self.told_variables.iter().map(|name| (name.clone(), Causality::Input, None));
        let variable =
            |(k, (name, causality, unit)): (usize, (String, Causality, Option<String>))| Variable {
                name,
                reference: k as u32,
                kind: Kind::Real,
                causality,
                variability: Variability::Continuous,
                initial: None,
                start: (causality == Causality::Input).then_some(Value::Real(0.0)),
                unit,
                description: None,
            };
        heard.chain(told).enumerate().map(variable).collect()
    }
}

/// `P/3` of `P[3]`, `bus/V/12` of `bus.V[12]`.
fn path_of(variable: &str) -> String {
    let parts = variable.split(['[', ']', ',', '.']).filter(|part| !part.is_empty());
    parts.collect::<Vec<_>>().join("/")
}

/// `P` of `P[3]`, `inverter.P` of `inverter[2].P`.
fn array_of(variable: &str) -> String {
    let mut depth = 0;
    let is_outside = |letter: &char| {
        depth += i32::from(*letter == '[');
        let is_outside = depth == 0;
        depth -= i32::from(*letter == ']');
        is_outside
    };
    variable.chars().filter(is_outside).collect()
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
        let found = topics(&[], &connections, (Form::Vectors, "grid"));
        let names: Vec<&str> = found.iter().map(|topic| topic.publication.as_str()).collect();
        assert_eq!(names, ["cluster1/grid/omega_set", "grid/cluster1/P", "grid/cluster2/P"]);
        assert_eq!(found[1].variables, ["P[2]", "P[1]"]);
        assert_eq!(found[1].input, "cluster1/from/grid/P");
        let found = topics(&[], &connections, (Form::Doubles, "grid"));
        let names: Vec<&str> = found.iter().map(|topic| topic.publication.as_str()).collect();
        assert_eq!(names, ["cluster1/omega_set/1", "grid/P/1", "grid/P/2", "grid/P/3"]);
        assert!(found.iter().all(|topic| topic.is_double && topic.variables.len() == 1));
        let found = topics(&[], &connections, (Form::Packed, "grid"));
        let names: Vec<&str> = found.iter().map(|topic| topic.publication.as_str()).collect();
        assert_eq!(names, ["cluster1/grid/all", "grid/cluster1/all", "grid/cluster2/all"]);
    }

    #[test]
    fn elements_of_other_names_stay_apart() {
        let names = ["inverter[1].P", "inverter[2].P", "inverter[1].V", "A[1,2]", "A[2,1]"];
        let connections: Vec<Connection> = names
            .iter()
            .enumerate()
            .map(|(k, name)| connection(("grid", name), ("controller", &format!("x[{k}]"))))
            .collect();
        let found = topics(&[], &connections, (Form::Doubles, "grid"));
        let told: Vec<(&str, &[String])> =
            found.iter().map(|topic| (topic.publication.as_str(), &topic.variables[..])).collect();
        let own = |name: &str| [name.to_owned()];
        assert_eq!(
            told,
            [
                ("grid/A/1/2", &own("A[1,2]")[..]),
                ("grid/A/2/1", &own("A[2,1]")),
                ("grid/inverter/1/P", &own("inverter[1].P")),
                ("grid/inverter/2/P", &own("inverter[2].P")),
                ("grid/inverter/1/V", &own("inverter[1].V")),
            ]
        );
        let found = topics(&[], &connections, (Form::Vectors, "grid"));
        let told: Vec<(&str, usize)> =
            found.iter().map(|topic| (topic.publication.as_str(), topic.variables.len())).collect();
        let prefix = "grid/controller";
        let expected = ["A", "inverter.P", "inverter.V"].map(|array| format!("{prefix}/{array}"));
        assert_eq!(told, expected.iter().map(String::as_str).zip([2, 2, 1]).collect::<Vec<_>>());
    }

    #[test]
    fn controllers_tell_each_other_everything_at_once() {
        let connections = [
            connection(("cluster1", "local_p[1]"), ("cluster2", "remote_p[1]")),
            connection(("cluster1", "local_omega[1]"), ("cluster2", "remote_omega[1]")),
        ];
        for form in [Form::Vectors, Form::Doubles, Form::Packed] {
            let found = topics(&[], &connections, (form, "grid"));
            assert_eq!(found.len(), 1);
            assert_eq!(found[0].publication, "cluster1/cluster2/all");
            assert_eq!(found[0].variables, ["local_p[1]", "local_omega[1]"]);
        }
    }
}

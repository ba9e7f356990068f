//! A plan compiled against its participants: names become indices into one array of recorded values,
//! grouped so that a communication step makes one read and one set for each participant and type.

use super::coupling::{Connection, CouplingError, Endpoint};
use super::description::{Causality, Variable};
use super::lookup::Lookup;
use super::observer::Column;
use super::participant::{CallError, Participant};
use super::value::{Kind, Value, to_boolean, to_integer};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// All index arrays of a run.
pub(super) struct Wiring {
    pub columns: Vec<Column>,
    /// One for each participant.
    pub ports: Vec<Port>,
    /// Column of each variable that an event sets.
    set_columns: BTreeMap<Endpoint, usize>,
}

/// What is read from and set in one participant.
#[derive(Default)]
pub(super) struct Port {
    /// Connected outputs that are Real.
    sources: Sources,
    /// Whether a connected output is not Real.
    has_other_sources: bool,
    real: Outputs<f64>,
    integer: Outputs<i32>,
    boolean: Outputs<i32>,
    real_in: Inputs<f64>,
    integer_in: Inputs<i32>,
    boolean_in: Inputs<i32>,
}

#[derive(Default)]
struct Outputs<T> {
    references: Vec<u32>,
    first_column: usize,
    scratch: Vec<T>,
}

#[derive(Default)]
struct Sources {
    references: Vec<u32>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

#[derive(Default)]
struct Inputs<T> {
    references: Vec<u32>,
    links: Vec<Link>,
    values: Vec<T>,
}

struct Link {
    column: usize,
    factor: f64,
    offset: f64,
    to: String,
}

/// What was last set in one participant: its connected inputs of each type.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Written {
    real: Vec<f64>,
    integer: Vec<i32>,
    boolean: Vec<i32>,
}

/// Why inputs could not be set.
pub(super) enum WriteError {
    Call(CallError),
    Conversion { column: usize, to: String, found: f64, expected: Kind },
}

impl From<CallError> for WriteError {
    fn from(error: CallError) -> Self {
        WriteError::Call(error)
    }
}

/// Values for one participant, grouped by type.
#[derive(Clone, Debug, Default)]
pub(super) struct Values {
    real: (Vec<u32>, Vec<f64>),
    integer: (Vec<u32>, Vec<i32>),
    boolean: (Vec<u32>, Vec<i32>),
}

impl Values {
    pub fn push(&mut self, reference: u32, value: Value) {
        match value {
            Value::Real(value) => {
                self.real.0.push(reference);
                self.real.1.push(value);
            }
            Value::Integer(value) => {
                self.integer.0.push(reference);
                self.integer.1.push(value);
            }
            Value::Boolean(value) => {
                self.boolean.0.push(reference);
                self.boolean.1.push(i32::from(value));
            }
        }
    }

    pub fn apply(&self, participant: &mut dyn Participant) -> Result<(), CallError> {
        if !self.real.0.is_empty() {
            participant.set_real(&self.real.0, &self.real.1)?;
        }
        if !self.integer.0.is_empty() {
            participant.set_integer(&self.integer.0, &self.integer.1)?;
        }
        if !self.boolean.0.is_empty() {
            participant.set_boolean(&self.boolean.0, &self.boolean.1)?;
        }
        Ok(())
    }
}

impl Port {
    /// Reads all outputs into their columns.
    pub fn read(&mut self, participant: &mut dyn Participant, values: &mut [f64]) -> Result<(), CallError> {
        let reals = self.real.first_column..self.real.first_column + self.real.references.len();
        if let (false, Some(target)) = (reals.is_empty(), values.get_mut(reals)) {
            participant.get_real(&self.real.references, target)?;
        }
        if !self.integer.references.is_empty() {
            participant.get_integer(&self.integer.references, &mut self.integer.scratch)?;
            for (value, found) in values.iter_mut().skip(self.integer.first_column).zip(&self.integer.scratch)
            {
                *value = f64::from(*found);
            }
        }
        if !self.boolean.references.is_empty() {
            participant.get_boolean(&self.boolean.references, &mut self.boolean.scratch)?;
            for (value, found) in values.iter_mut().skip(self.boolean.first_column).zip(&self.boolean.scratch)
            {
                *value = f64::from(u8::from(*found != 0));
            }
        }
        Ok(())
    }

    /// Reads the connected outputs alone into their columns.
    pub fn read_sources(
        &mut self,
        participant: &mut dyn Participant,
        values: &mut [f64],
    ) -> Result<(), CallError> {
        if self.has_other_sources {
            return self.read(participant, values);
        }
        if !self.sources.references.is_empty() {
            participant.get_real(&self.sources.references, &mut self.sources.values)?;
            for (column, found) in self.sources.columns.iter().zip(&self.sources.values) {
                if let Some(value) = values.get_mut(*column) {
                    *value = *found;
                }
            }
        }
        Ok(())
    }

    /// Sets the connected inputs where one of them is new; says whether.
    pub fn write(&mut self, participant: &mut dyn Participant, values: &[f64]) -> Result<bool, WriteError> {
        let real = self.real_in.fill(values, Kind::Real, Some)?;
        let integer = self.integer_in.fill(values, Kind::Integer, to_integer)?;
        let boolean =
            self.boolean_in.fill(values, Kind::Boolean, |value| to_boolean(value).map(i32::from))?;
        if real {
            participant.set_real(&self.real_in.references, &self.real_in.values)?;
        }
        if integer {
            participant.set_integer(&self.integer_in.references, &self.integer_in.values)?;
        }
        if boolean {
            participant.set_boolean(&self.boolean_in.references, &self.boolean_in.values)?;
        }
        Ok(real || integer || boolean)
    }
}

impl Port {
    /// What the inputs were last set to.
    pub fn written(&self) -> Written {
        Written {
            real: self.real_in.values.clone(),
            integer: self.integer_in.values.clone(),
            boolean: self.boolean_in.values.clone(),
        }
    }

    /// Takes the inputs for set to these; the number found and the number expected.
    pub fn restore(&mut self, written: &Written) -> (usize, usize) {
        let Written { real, integer, boolean } = written;
        let counts = [
            (real.len(), self.real_in.values.len()),
            (integer.len(), self.integer_in.values.len()),
            (boolean.len(), self.boolean_in.values.len()),
        ];
        self.real_in.values.clone_from(real);
        self.integer_in.values.clone_from(integer);
        self.boolean_in.values.clone_from(boolean);
        counts.into_iter().find(|(found, expected)| found != expected).unwrap_or((0, 0))
    }

    fn add_source(&mut self, from: &Variable, column: usize) {
        let sources = &mut self.sources;
        if from.kind != Kind::Real {
            self.has_other_sources = true;
        } else if !sources.columns.contains(&column) {
            sources.references.push(from.reference);
            sources.columns.push(column);
            sources.values.push(0.0);
        }
    }
}

impl<T: Copy + PartialEq> Inputs<T> {
    fn fill(
        &mut self,
        columns: &[f64],
        expected: Kind,
        convert: fn(f64) -> Option<T>,
    ) -> Result<bool, WriteError> {
        let mut is_new = false;
        for (value, link) in self.values.iter_mut().zip(&self.links) {
            let source = columns.get(link.column).copied().unwrap_or(f64::NAN);
            let found = link.factor * source + link.offset;
            let Some(converted) = convert(found) else {
                return Err(WriteError::Conversion {
                    column: link.column,
                    to: link.to.clone(),
                    found,
                    expected,
                });
            };
            is_new |= converted != *value;
            *value = converted;
        }
        Ok(is_new)
    }

    fn push(&mut self, reference: u32, link: Link, value: T) {
        self.references.push(reference);
        self.links.push(link);
        self.values.push(value);
    }
}

impl Wiring {
    /// Compiles the connections; `recorded` are the variables that events set, each becoming a column.
    pub fn compile(
        participants: &[Box<dyn Participant>],
        connections: &[Connection],
        recorded: &BTreeSet<Endpoint>,
    ) -> Result<Self, CouplingError> {
        let mut wiring = Wiring { columns: Vec::new(), ports: Vec::new(), set_columns: BTreeMap::new() };
        let mut column_of = BTreeMap::new();
        let mut names = BTreeSet::new();
        for participant in participants {
            if !names.insert(participant.name()) {
                return Err(CouplingError::TwoParticipants { name: participant.name().to_owned() });
            }
            wiring.add_columns(participant.as_ref(), recorded, &mut column_of);
        }
        wiring.connect(participants, connections, &column_of)?;
        Ok(wiring)
    }

    /// The column in which a variable set by events is recorded.
    pub fn set_column(&self, endpoint: &Endpoint) -> Option<usize> {
        self.set_columns.get(endpoint).copied()
    }

    fn add_columns(
        &mut self,
        participant: &dyn Participant,
        recorded: &BTreeSet<Endpoint>,
        column_of: &mut BTreeMap<Endpoint, usize>,
    ) {
        let mut port = Port::default();
        let mut references = [Vec::new(), Vec::new(), Vec::new()];
        let mut first = [0; 3];
        for (slot, kind) in [Kind::Real, Kind::Integer, Kind::Boolean].into_iter().enumerate() {
            first[slot] = self.columns.len();
            for variable in participant.variables() {
                if variable.causality == Causality::Output && variable.kind == kind {
                    references[slot].push(variable.reference);
                    column_of.insert(
                        Endpoint::new(participant.name(), variable.name.as_str()),
                        self.columns.len(),
                    );
                    self.columns.push(column(participant, variable));
                }
            }
        }
        let [real, integer, boolean] = references;
        port.real = Outputs { first_column: first[0], scratch: Vec::new(), references: real };
        port.integer =
            Outputs { first_column: first[1], scratch: vec![0; integer.len()], references: integer };
        port.boolean =
            Outputs { first_column: first[2], scratch: vec![0; boolean.len()], references: boolean };
        for variable in participant.variables() {
            let endpoint = Endpoint::new(participant.name(), variable.name.as_str());
            if recorded.contains(&endpoint) {
                self.set_columns.insert(endpoint, self.columns.len());
                self.columns.push(column(participant, variable));
            }
        }
        self.ports.push(port);
    }

    fn connect(
        &mut self,
        participants: &[Box<dyn Participant>],
        connections: &[Connection],
        column_of: &BTreeMap<Endpoint, usize>,
    ) -> Result<(), CouplingError> {
        let lookup = Lookup::new(participants);
        let mut sources: BTreeMap<&Endpoint, &Endpoint> = BTreeMap::new();
        for (number, connection) in connections.iter().enumerate() {
            let place = format!("connection {} ({} to {})", number + 1, connection.from, connection.to);
            let (source, from) = lookup.find(&place, &connection.from)?;
            let (target, to) = lookup.find(&place, &connection.to)?;
            let role = |name: &Endpoint, found: String, expected| CouplingError::Role {
                place: place.clone(),
                name: name.clone(),
                found,
                expected,
            };
            let Some(column) = column_of.get(&connection.from).copied() else {
                let found = format!("{} {}", from.causality, from.kind);
                return Err(role(&connection.from, found, "an output of type Real, Integer or Boolean"));
            };
            if to.causality != Causality::Input || to.kind == Kind::String {
                let found = format!("{} {}", to.causality, to.kind);
                return Err(role(&connection.to, found, "an input of type Real, Integer or Boolean"));
            }
            let (factor, offset) = (connection.factor, connection.offset);
            if !factor.is_finite() || !offset.is_finite() {
                return Err(CouplingError::Scaling { place, factor, offset });
            }
            if let Some(first) = sources.insert(&connection.to, &connection.from) {
                return Err(CouplingError::TwoSources {
                    place,
                    to: connection.to.clone(),
                    first: first.to_string(),
                });
            }
            if self.set_columns.contains_key(&connection.to) {
                return Err(CouplingError::TwoSources {
                    place,
                    to: connection.to.clone(),
                    first: "an event".into(),
                });
            }
            if let Some(port) = self.ports.get_mut(source) {
                port.add_source(from, column);
            }
            let link = Link { column, factor, offset, to: to.name.clone() };
            let Some(port) = self.ports.get_mut(target) else { continue };
            match to.kind {
                // NaN is unlike everything, so the first value set counts as new.
                Kind::Real => port.real_in.push(to.reference, link, f64::NAN),
                Kind::Integer => port.integer_in.push(to.reference, link, i32::MIN),
                Kind::Boolean => port.boolean_in.push(to.reference, link, i32::MIN),
                Kind::String => {}
            }
        }
        Ok(())
    }
}

fn column(participant: &dyn Participant, variable: &Variable) -> Column {
    Column {
        participant: participant.name().to_owned(),
        variable: variable.name.clone(),
        kind: variable.kind,
        unit: variable.unit.clone(),
    }
}

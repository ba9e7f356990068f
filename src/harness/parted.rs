//! A controller in parts as one participant: its variables are those of the whole controller, each step of it is
//! one of every part, and the parts' messages are passed on between steps, as they would be by any master. Knows names
//! and places; never what a message means.

use super::description::Variable;
use super::participant::{CallError, Participant, StateHandle};
use super::value::Kind;
use crate::models::fleet::Fleet;
use std::collections::BTreeMap;

/// A fleet of controllers.
pub(super) struct Parted {
    name: String,
    parts: Vec<Box<dyn Participant>>,
    variables: Vec<Variable>,
    /// Part and reference of each variable, by reference; several where all parts have it.
    places: Vec<Vec<(usize, u32)>>,
    real: Lines<f64>,
    integer: Lines<i32>,
    boolean: Lines<i32>,
    states: BTreeMap<u64, Vec<StateHandle>>,
    next_state: u64,
}

type Get<T> = fn(&mut dyn Participant, &[u32], &mut [T]) -> Result<(), CallError>;
type Set<T> = fn(&mut dyn Participant, &[u32], &[T]) -> Result<(), CallError>;

/// What a part is told of one type: by reference the value, and from which source and place it comes.
struct Sink<T> {
    part: usize,
    references: Vec<u32>,
    values: Vec<T>,
    from: Vec<(usize, usize)>,
}

/// The messages of one type: what is read from each part, and where each part gets it from.
#[derive(Default)]
struct Lines<T> {
    sources: Vec<(usize, Vec<u32>, Vec<T>)>,
    sinks: Vec<Sink<T>>,
}

impl<T: Copy + Default> Lines<T> {
    fn connect(&mut self, (from, output): (usize, u32), (to, input): (usize, u32)) {
        let source = self.sources.iter().position(|(part, ..)| *part == from).unwrap_or_else(|| {
            self.sources.push((from, Vec::new(), Vec::new()));
            self.sources.len() - 1
        });
        let (_, references, values) = &mut self.sources[source];
        let place = references.iter().position(|r| *r == output).unwrap_or_else(|| {
            references.push(output);
            values.push(T::default());
            references.len() - 1
        });
        let sink = self.sinks.iter().position(|sink| sink.part == to).unwrap_or_else(|| {
            let (references, values, from) = (Vec::new(), Vec::new(), Vec::new());
            self.sinks.push(Sink { part: to, references, values, from });
            self.sinks.len() - 1
        });
        let Sink { references, values, from, .. } = &mut self.sinks[sink];
        references.push(input);
        values.push(T::default());
        from.push((source, place));
    }

    fn read(&mut self, parts: &mut [Box<dyn Participant>], get: Get<T>) -> Result<(), CallError> {
        self.sources
            .iter_mut()
            .try_for_each(|(part, references, values)| get(parts[*part].as_mut(), references, values))
    }

    fn write(&mut self, parts: &mut [Box<dyn Participant>], set: Set<T>) -> Result<(), CallError> {
        for Sink { part, references, values, from } in &mut self.sinks {
            for (value, &(source, place)) in values.iter_mut().zip(from.iter()) {
                *value = self.sources[source].2[place];
            }
            set(parts[*part].as_mut(), references, values)?;
        }
        Ok(())
    }
}

impl Parted {
    /// The parts of a fleet, in its order, with the variables of the whole controller as far as parts have them.
    pub fn new(name: &str, fleet: &Fleet, whole: &[Variable], parts: Vec<Box<dyn Participant>>) -> Self {
        let by_name: Vec<BTreeMap<&str, &Variable>> = parts
            .iter()
            .map(|part| part.variables().iter().map(|variable| (variable.name.as_str(), variable)).collect())
            .collect();
        let find = |part: usize, name: &str| by_name.get(part)?.get(name).copied();
        let (mut variables, mut places) = (Vec::new(), Vec::new());
        for variable in whole {
            let here = fleet.places(&variable.name).into_iter();
            let here: Vec<(usize, u32)> = here
                .filter_map(|(part, name)| Some((part, find(part, &name)?)))
                .filter(|(_, found)| found.causality == variable.causality && found.kind == variable.kind)
                .map(|(part, found)| (part, found.reference))
                .collect();
            if !here.is_empty() {
                variables.push(Variable { reference: variables.len() as u32 + 1, ..variable.clone() });
                places.push(here);
            }
        }
        let (mut real, mut integer, mut boolean) = (Lines::default(), Lines::default(), Lines::default());
        for way in fleet.ways() {
            for word in &fleet.words {
                let output = find(way.from.0, &format!("local_{word}[{}]", way.from.1));
                let input = find(way.to.0, &format!("remote_{word}[{}]", way.to.1));
                let (Some(output), Some(input)) = (output, input) else { continue };
                let ends = ((way.from.0, output.reference), (way.to.0, input.reference));
                match output.kind {
                    Kind::Real => real.connect(ends.0, ends.1),
                    Kind::Integer => integer.connect(ends.0, ends.1),
                    Kind::Boolean => boolean.connect(ends.0, ends.1),
                    Kind::String => {}
                }
            }
        }
        drop(by_name);
        let (name, states) = (name.to_owned(), BTreeMap::new());
        Self { name, parts, variables, places, real, integer, boolean, states, next_state: 0 }
    }

    /// Passes all messages on.
    fn exchange(&mut self) -> Result<(), CallError> {
        self.real.read(&mut self.parts, |part, references, values| part.get_real(references, values))?;
        self.integer
            .read(&mut self.parts, |part, references, values| part.get_integer(references, values))?;
        self.boolean
            .read(&mut self.parts, |part, references, values| part.get_boolean(references, values))?;
        self.real.write(&mut self.parts, |part, references, values| part.set_real(references, values))?;
        self.integer
            .write(&mut self.parts, |part, references, values| part.set_integer(references, values))?;
        self.boolean.write(&mut self.parts, |part, references, values| part.set_boolean(references, values))
    }

    /// The largest of what the parts say.
    fn get<T: Copy + PartialOrd + Default>(
        &mut self,
        function: &'static str,
        (references, values): (&[u32], &mut [T]),
        get: Get<T>,
    ) -> Result<(), CallError> {
        let Self { places, parts, .. } = self;
        for (&reference, value) in references.iter().zip(values) {
            let mut found: Option<T> = None;
            for &(part, at) in places_of(places, function, reference)? {
                let mut one = [T::default()];
                get(parts[part].as_mut(), &[at], &mut one)?;
                found = Some(found.map_or(one[0], |found| if one[0] > found { one[0] } else { found }));
            }
            *value = found.unwrap_or_default();
        }
        Ok(())
    }

    fn set<T: Copy>(
        &mut self,
        function: &'static str,
        (references, values): (&[u32], &[T]),
        set: Set<T>,
    ) -> Result<(), CallError> {
        let Self { places, parts, .. } = self;
        for (&reference, &value) in references.iter().zip(values) {
            for &(part, at) in places_of(places, function, reference)? {
                set(parts[part].as_mut(), &[at], &[value])?;
            }
        }
        Ok(())
    }

    fn each(
        &mut self,
        mut call: impl FnMut(&mut dyn Participant) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.parts.iter_mut().try_for_each(|part| call(part.as_mut()))
    }

    /// Keeps a state of every part as one; of a part that refuses, those of the parts before it are let go.
    fn keep(
        &mut self,
        mut of: impl FnMut(usize, &mut dyn Participant) -> Result<StateHandle, CallError>,
    ) -> Result<StateHandle, CallError> {
        let mut states = Vec::with_capacity(self.parts.len());
        for k in 0..self.parts.len() {
            match of(k, self.parts[k].as_mut()) {
                Ok(state) => states.push(state),
                Err(error) => {
                    self.parts.iter_mut().zip(states).for_each(|(part, state)| part.forget_state(state));
                    return Err(error);
                }
            }
        }
        let handle = self.next_state;
        self.next_state += 1;
        self.states.insert(handle, states);
        Ok(StateHandle(handle))
    }

    fn kept(&self, function: &'static str, state: StateHandle) -> Result<Vec<StateHandle>, CallError> {
        let refused = || CallError::new(function, format!("not called: state {} is not kept here", state.0));
        self.states.get(&state.0).cloned().ok_or_else(refused)
    }
}

impl Participant for Parted {
    fn name(&self) -> &str {
        &self.name
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn can_vary_step(&self) -> bool {
        self.parts.iter().all(|part| part.can_vary_step())
    }

    fn identity(&self) -> String {
        self.parts.iter().map(|part| part.identity()).collect::<Vec<_>>().join(" ")
    }

    fn setup(&mut self, start_ns: i64, stop_ns: Option<i64>) -> Result<(), CallError> {
        self.each(|part| part.setup(start_ns, stop_ns))
    }

    fn enter_initialization(&mut self) -> Result<(), CallError> {
        self.each(|part| part.enter_initialization())
    }

    fn exit_initialization(&mut self) -> Result<(), CallError> {
        // What is told follows what is measured, and nothing that is told follows what is heard: once is enough.
        self.exchange()?;
        self.each(|part| part.exit_initialization())
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.get("fmi2GetReal", (references, values), |part, r, v| part.get_real(r, v))
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.get("fmi2GetInteger", (references, values), |part, r, v| part.get_integer(r, v))
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.get("fmi2GetBoolean", (references, values), |part, r, v| part.get_boolean(r, v))
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.set("fmi2SetReal", (references, values), |part, r, v| part.set_real(r, v))
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.set("fmi2SetInteger", (references, values), |part, r, v| part.set_integer(r, v))
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.set("fmi2SetBoolean", (references, values), |part, r, v| part.set_boolean(r, v))
    }

    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        self.each(|part| part.do_step(t_ns, h_ns))?;
        self.exchange()
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.each(|part| part.terminate())
    }

    fn reset(&mut self) -> Result<(), CallError> {
        self.each(|part| part.reset())
    }

    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        self.keep(|_, part| part.save_state())
    }

    fn restore_state(&mut self, state: StateHandle) -> Result<(), CallError> {
        let states = self.kept("fmi2SetFMUstate", state)?;
        let before = self.save_state()?;
        let done = self.parts.iter_mut().zip(states).try_for_each(|(part, state)| part.restore_state(state));
        if done.is_err() {
            // All parts or none: those before the one that refuses go back.
            let states = self.kept("fmi2SetFMUstate", before)?;
            self.parts.iter_mut().zip(states).for_each(|(part, state)| drop(part.restore_state(state)));
        }
        self.forget_state(before);
        done
    }

    fn forget_state(&mut self, state: StateHandle) {
        let states = self.states.remove(&state.0).unwrap_or_default();
        self.parts.iter_mut().zip(states).for_each(|(part, state)| part.forget_state(state));
    }

    fn serialise_state(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        let function = "fmi2SerializeFMUstate";
        let states = self.kept(function, state)?.into_iter();
        let all = self.parts.iter_mut().zip(states).map(|(part, state)| part.serialise_state(state));
        let bytes: Vec<Vec<u8>> = all.collect::<Result<_, _>>()?;
        postcard::to_stdvec(&bytes).map_err(|error| CallError::new(function, error.to_string()))
    }

    fn deserialise_state(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        let refused = |reason: String| CallError::new("fmi2DeSerializeFMUstate", reason);
        let all: Vec<Vec<u8>> = postcard::from_bytes(bytes).map_err(|error| refused(error.to_string()))?;
        if all.len() != self.parts.len() {
            return Err(refused(format!("states of {} parts, expected {}", all.len(), self.parts.len())));
        }
        self.keep(|k, part| part.deserialise_state(&all[k]))
    }

    fn take_warnings(&mut self) -> Vec<String> {
        let parts = self.parts.iter_mut();
        parts
            .flat_map(|part| {
                let name = part.name().to_owned();
                part.take_warnings().into_iter().map(move |warning| format!("{name}: {warning}"))
            })
            .collect()
    }
}

/// Where the variable of this reference is.
fn places_of<'a>(
    places: &'a [Vec<(usize, u32)>],
    function: &'static str,
    reference: u32,
) -> Result<&'a [(usize, u32)], CallError> {
    let found = places.get((reference as usize).wrapping_sub(1));
    found.map(Vec::as_slice).ok_or_else(|| {
        let expected = format!("1 to {}", places.len());
        CallError::new(function, format!("value reference: found {reference}, expected {expected}"))
    })
}

#[cfg(test)]
mod tests {
    use super::Lines;

    #[test]
    fn a_message_to_two_parts_is_read_once() {
        let mut lines = Lines::<f64>::default();
        lines.connect((0, 7), (1, 3));
        lines.connect((0, 7), (2, 4));
        lines.connect((1, 8), (2, 5));
        assert_eq!(lines.sources.len(), 2);
        assert_eq!(lines.sources[0].1, [7]);
        assert_eq!(lines.sinks[1].from, [(0, 0), (1, 0)]);
    }
}

//! Connections that nobody wrote: an input without a source takes the output of its name of another participant.
//! One rule for `bess run` and for the systems that `bess export` writes. Knows names and nothing of FMUs.

use std::collections::BTreeMap;

/// Outputs by name, each with its participant and what the caller knows it by.
pub struct EqualNames<'a, T>(BTreeMap<&'a str, Vec<(&'a str, T)>>);

impl<'a, T: Copy> EqualNames<'a, T> {
    /// Of these outputs: participant, name, what the caller knows it by.
    pub fn of(outputs: impl IntoIterator<Item = (&'a str, &'a str, T)>) -> Self {
        let mut by_name: BTreeMap<&str, Vec<(&str, T)>> = BTreeMap::new();
        for (participant, name, output) in outputs {
            by_name.entry(name).or_default().push((participant, output));
        }
        Self(by_name)
    }

    /// The source of this input of `participant`, which never feeds itself; none if nobody has an output of that
    /// name. Fails with the participants that have one where they are several.
    pub fn source(&self, participant: &str, input: &str) -> Result<Option<(&'a str, T)>, String> {
        let all = self.0.get(input).map_or(&[][..], Vec::as_slice);
        let others: Vec<(&'a str, T)> =
            all.iter().filter(|(owner, _)| *owner != participant).copied().collect();
        match others.as_slice() {
            [] => Ok(None),
            [one] => Ok(Some(*one)),
            several => Err(several.iter().map(|(owner, _)| *owner).collect::<Vec<_>>().join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::EqualNames;

    #[test]
    fn an_input_takes_the_one_output_of_its_name_of_another() {
        let names = EqualNames::of([("a", "y", 1), ("b", "y", 2), ("c", "z", 3), ("a", "x", 4)]);
        assert_eq!(names.source("a", "y"), Ok(Some(("b", 2))));
        assert_eq!(names.source("b", "z"), Ok(Some(("c", 3))));
        assert_eq!(names.source("a", "x"), Ok(None), "nobody feeds himself");
        assert_eq!(names.source("a", "w"), Ok(None));
        assert_eq!(names.source("c", "y"), Err("a, b".to_owned()));
    }
}

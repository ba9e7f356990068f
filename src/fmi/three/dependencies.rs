//! What each output follows: element by element for those who ask an instance, variable by variable for the model
//! description.

use super::call_order::{Function, State};
use super::error::{Outcome, Reason};
use super::instance::Instance;
use super::table::{Table, Variable};
use crate::fmi::model::Model;
use crate::fmi::registry::{Causality, Dependencies, Group};
use std::collections::BTreeSet;

/// One element of a variable follows one of another. Elements count from 1; 0 stands for all of a variable's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dependency {
    /// The element that follows.
    pub element: usize,
    /// Value reference of the variable that it follows.
    pub independent: u32,
    /// The element of that.
    pub independent_element: usize,
}

impl<M: Model> Instance<M> {
    /// fmi3GetVariableDependencies: what a variable follows within a step, or while the initial state is looked for.
    pub fn dependencies(&mut self, function: Function, reference: u32) -> Outcome<Vec<Dependency>> {
        self.allow(function)?;
        // A graph that has been set decides who follows whom.
        self.on_built(|_| Ok(()))?;
        let (table, model) = (self.table(), self.model());
        let Variable::Group(_, group) = table.at(0, reference)? else { return Ok(Vec::new()) };
        if group.causality != Causality::Output {
            return Ok(Vec::new());
        }
        let whole = |independent| Dependency { element: 0, independent, independent_element: 0 };
        let initial = matches!(self.state(), State::Instantiated | State::Initialization);
        if initial && M::INITIAL_STATE_FOLLOWS_INPUTS {
            return Ok(knowns(&table).into_iter().map(whole).collect());
        }
        let named = |name: &str| {
            let problem = || Reason::Load(format!("{} depends on {name}, which is no variable", group.name));
            let reference = table.reference(name).ok_or_else(problem)?;
            let is_scalar =
                matches!(table.get(reference), Some(Variable::Group(_, Group { count: None, .. })));
            Ok::<_, Reason>((reference, is_scalar))
        };
        let pair = |element: usize, name: &str, index: usize| {
            let (independent, is_scalar) = named(name)?;
            let independent_element = if is_scalar { 0 } else { index + 1 };
            Ok(Dependency { element, independent, independent_element })
        };
        // A scalar is all of itself.
        let element = |index: usize| if group.count.is_none() { 0 } else { index + 1 };
        match &group.dependencies {
            Dependencies::None => Ok(Vec::new()),
            Dependencies::All(names) => names.iter().map(|name| Ok(whole(named(name)?.0))).collect(),
            Dependencies::SameIndex(names) => (0..group.len())
                .flat_map(|index| names.iter().map(move |name| (index, *name)))
                .map(|(index, name)| pair(element(index), name, index))
                .collect(),
            Dependencies::Of(list) => (0..group.len())
                .flat_map(|index| {
                    list(model, index).into_iter().map(move |(name, other)| (index, name, other))
                })
                .map(|(index, name, other)| pair(element(index), name, other))
                .collect(),
        }
    }
}

/// Value references of the variables that some element of a group follows within a step, ascending.
pub(super) fn of_group<M: Model>(table: &Table<'_, M>, model: &M, group: &Group<M>) -> Vec<u32> {
    let names: BTreeSet<&'static str> = match &group.dependencies {
        Dependencies::None => BTreeSet::new(),
        Dependencies::SameIndex(names) | Dependencies::All(names) => names.iter().copied().collect(),
        Dependencies::Of(list) => {
            (0..group.len()).flat_map(|index| list(model, index)).map(|(name, _)| name).collect()
        }
    };
    let references: BTreeSet<u32> = names.into_iter().filter_map(|name| table.reference(name)).collect();
    references.into_iter().collect()
}

/// Value references of all inputs and parameters, ascending.
pub(super) fn knowns<M: Model>(table: &Table<'_, M>) -> Vec<u32> {
    let is_known = |reference: &u32| match table.get(*reference) {
        Some(Variable::Group(_, group)) => group.causality != Causality::Output,
        Some(Variable::Size(..) | Variable::Array(..)) => true,
        _ => false,
    };
    (1..=table.last()).filter(is_known).collect()
}

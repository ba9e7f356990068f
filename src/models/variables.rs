//! Short spellings for the groups of both models, so that a list of variables reads as a list.

use crate::fmi::{Access, Causality, Dependencies, Group, Range, Row, Unit, Variability};

type Get<M, T> = fn(&M, usize) -> T;
type Set<M, T> = fn(&mut M, usize, T);

/// A group with nothing but a name yet.
pub fn group<M>(
    name: &'static str,
    description: &'static str,
    causality: Causality,
    access: Access<M>,
) -> Group<M> {
    let variability = match (causality, &access) {
        (Causality::Parameter, _) => Variability::Fixed,
        (_, Access::Real(..)) => Variability::Continuous,
        _ => Variability::Discrete,
    };
    Group {
        name,
        description,
        unit: matches!(access, Access::Real(..)).then_some(Unit::One),
        count: None,
        size: None,
        causality,
        variability,
        access,
        range: Range::ANY,
        dependencies: Dependencies::None,
        row: Row::NONE,
    }
}

/// A Real input.
pub fn input<M>(
    name: &'static str,
    description: &'static str,
    get: Get<M, f64>,
    set: Set<M, f64>,
) -> Group<M> {
    group(name, description, Causality::Input, Access::Real(get, Some(set)))
}

/// A Boolean input.
pub fn switch<M>(
    name: &'static str,
    description: &'static str,
    get: Get<M, bool>,
    set: Set<M, bool>,
) -> Group<M> {
    group(name, description, Causality::Input, Access::Boolean(get, Some(set)))
}

/// A Real output.
pub fn output<M>(name: &'static str, description: &'static str, get: Get<M, f64>) -> Group<M> {
    group(name, description, Causality::Output, Access::Real(get, None))
}

/// A fixed Real parameter.
pub fn parameter<M>(
    name: &'static str,
    description: &'static str,
    get: Get<M, f64>,
    set: Set<M, f64>,
) -> Group<M> {
    group(name, description, Causality::Parameter, Access::Real(get, Some(set)))
}

/// What may follow the first four words about a group.
pub trait GroupExt<M> {
    /// `count` variables, `name[1]` to `name[count]`.
    fn each(self, count: usize) -> Self;
    /// In this unit.
    fn unit(self, unit: Unit) -> Self;
    /// Only these values.
    fn range(self, range: Range) -> Self;
    /// May be set between steps.
    #[cfg(feature = "controller")]
    fn tunable(self) -> Self;
    /// Read, and where it is an input set, together.
    #[cfg(feature = "controller")]
    fn in_row(self, get: fn(&M) -> Option<&[f64]>, set: fn(&mut M) -> Option<&mut [f64]>) -> Self;
    /// Follows these within a step.
    fn follows(self, dependencies: Dependencies<M>) -> Self;
}

impl<M> GroupExt<M> for Group<M> {
    fn each(self, count: usize) -> Self {
        Self { count: Some(count), ..self }
    }
    fn unit(self, unit: Unit) -> Self {
        Self { unit: Some(unit), ..self }
    }
    fn range(self, range: Range) -> Self {
        Self { range, ..self }
    }
    #[cfg(feature = "controller")]
    fn tunable(self) -> Self {
        Self { variability: Variability::Tunable, ..self }
    }
    #[cfg(feature = "controller")]
    fn in_row(self, get: fn(&M) -> Option<&[f64]>, set: fn(&mut M) -> Option<&mut [f64]>) -> Self {
        Self { row: Row { get, set }, ..self }
    }
    fn follows(self, dependencies: Dependencies<M>) -> Self {
        Self { dependencies, ..self }
    }
}

//! Directional derivatives, input derivatives and output derivatives (FMI 2.0.4, sections 2.1.9 and 4.2.1), all
//! through the model's tangents. As for values: everything is checked before anything changes. In step mode
//! nothing allocates but refusals and the first of each call, which makes room for all.
//!
//! Input derivatives are of order 1. They are set with respect to the beginning of a communication step and
//! belong to the next step alone, in whatever order value and derivative were set: during it the input is
//! u_0 + du (t - t_0). When it is done the input stands at u_0 + du h, which is what fmi2GetReal then reads and
//! what the outputs follow, and rests there until it is set anew.

use super::call_order::Function;
use super::error::Error;
use super::instance::Instance;
use super::lookup::Type;
use super::model::{Along, Model, Phase, Plane, Step};
use super::registry::{Access, Causality, Group, Range, Variability};
use serde::{Deserialize, Serialize};

/// Rates of the inputs during the next step, per s, by position among all variables; empty when none has
/// been set. Memory that was in use once stays.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Ramps(Vec<f64>);

impl Ramps {
    /// Whether none has been set.
    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether no input moves.
    pub fn is_flat(&self) -> bool {
        self.0.iter().all(|rate| *rate == 0.0)
    }

    /// All inputs rest.
    pub fn end(&mut self) {
        self.0.clear();
    }

    /// Whether all are numbers.
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|rate| rate.is_finite())
    }

    fn set(&mut self, reference: u32, rate: f64) {
        let position = reference as usize;
        if self.0.len() < position {
            self.0.resize(position, 0.0);
        }
        if let Some(place) = self.0.get_mut(position.wrapping_sub(1)) {
            *place = rate;
        }
    }

    /// (value reference, rate) of the inputs that move.
    fn moving(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        (1..).zip(self.0.iter().copied()).filter(|(_, rate)| *rate != 0.0)
    }
}

const NO_TANGENTS: [(Function, &str); 3] = [
    (Function::GetDirectionalDerivative, "providesDirectionalDerivative is false in modelDescription.xml"),
    (
        Function::SetRealInputDerivatives,
        "canInterpolateInputs is false in modelDescription.xml; inputs are held over a step",
    ),
    (Function::GetRealOutputDerivatives, "maxOutputDerivativeOrder is 0 in modelDescription.xml"),
];

impl<M: Model> Instance<M> {
    /// fmi2GetDirectionalDerivative: `results` = d unknowns / d knowns times `seeds`. Knowns are continuous Real
    /// inputs and tunable Real parameters, unknowns continuous Real outputs; states are held in step mode, while
    /// in initialization mode they follow the inputs.
    pub fn get_directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seeds: &[f64],
        results: &mut [f64],
    ) -> Result<(), Error> {
        let function = Function::GetDirectionalDerivative;
        self.has_tangents(function, unknowns.len() + knowns.len())?;
        self.check_differentiable(function, unknowns, results.len(), "a continuous Real output", is_unknown)?;
        let expected = "a continuous Real input or a tunable Real parameter";
        self.check_differentiable(function, knowns, seeds.len(), expected, is_known)?;
        self.check_rates(function, knowns, seeds)?;
        self.in_line(function, |instance| {
            instance.model.look_at(Plane::Tangents);
            for (reference, seed) in knowns.iter().zip(seeds) {
                instance.add_tangent(*reference, *seed);
            }
            instance.read_tangents(function, Along::Knowns, unknowns, results)
        })
    }

    /// fmi2SetRealInputDerivatives.
    pub fn set_real_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        rates: &[f64],
    ) -> Result<(), Error> {
        let function = Function::SetRealInputDerivatives;
        self.has_tangents(function, references.len())?;
        self.check_differentiable(function, references, rates.len(), "a continuous Real input", is_input)?;
        self.check_orders(function, references, orders)?;
        self.check_rates(function, references, rates)?;
        if references.is_empty() {
            return Ok(());
        }
        if self.ramps.is_empty() {
            let last = self.registry.groups().filter(|(_, group)| is_input(group));
            let last = last.map(|(first, group)| first + group.len() as u32 - 1).last();
            self.ramps.set(last.unwrap_or_default(), 0.0);
        }
        for (reference, rate) in references.iter().zip(rates) {
            self.ramps.set(*reference, *rate);
        }
        Ok(())
    }

    /// fmi2GetRealOutputDerivatives, at the end of the last step: by the states' own equations and the input
    /// derivatives set since.
    pub fn get_real_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        rates: &mut [f64],
    ) -> Result<(), Error> {
        let function = Function::GetRealOutputDerivatives;
        self.has_tangents(function, references.len())?;
        self.check_differentiable(function, references, rates.len(), "a continuous Real output", is_unknown)?;
        self.check_orders(function, references, orders)?;
        self.in_line(function, |instance| {
            instance.look_at_ramps();
            instance.read_tangents(function, Along::Time, references, rates)
        })
    }

    /// A step with inputs that move; they stand at the ends of their ramps afterwards.
    pub(super) fn step_ramped(&mut self, step: Step) -> Result<(), Error> {
        let function = Function::DoStep;
        let h_s = step.duration_s();
        for (reference, rate) in self.ramps.moving() {
            if let Some((group, index)) = self.registry.locate(reference)
                && let Access::Real(get, _) = group.access
            {
                let end = get(&self.model, index) + rate * h_s;
                self.check_value(function, reference, group, end, group.range.contains(end))?;
            }
        }
        self.look_at_ramps();
        self.model.look_at(Plane::Values);
        self.model.step_ramped(step, &mut self.logger).map_err(Error::model(function))?;
        for (reference, rate) in self.ramps.moving() {
            if let Some((group, index)) = self.registry.locate(reference)
                && let Access::Real(get, Some(set)) = group.access
            {
                let end = get(&self.model, index) + rate * h_s;
                set(&mut self.model, index, end);
            }
        }
        Ok(())
    }

    /// The rates of the inputs as tangents; the model is left looking at them.
    fn look_at_ramps(&mut self) {
        self.model.look_at(Plane::Tangents);
        for (reference, rate) in self.ramps.moving() {
            if let Some((group, index)) = self.registry.locate(reference)
                && let Access::Real(_, Some(set)) = group.access
            {
                set(&mut self.model, index, rate);
            }
        }
    }

    /// A known that is named twice counts twice.
    fn add_tangent(&mut self, reference: u32, seed: f64) {
        if let Some((group, index)) = self.registry.locate(reference)
            && let Access::Real(get, Some(set)) = group.access
        {
            let sum = get(&self.model, index) + seed;
            set(&mut self.model, index, sum);
        }
    }

    /// Differentiates, reads and looks back at the values, whatever happens.
    fn read_tangents(
        &mut self,
        function: Function,
        along: Along,
        references: &[u32],
        results: &mut [f64],
    ) -> Result<(), Error> {
        let made = self.model.differentiate(along, self.phase());
        if made.is_ok() {
            for (reference, result) in references.iter().zip(results) {
                if let Some((group, index)) = self.registry.locate(*reference)
                    && let Access::Real(get, _) = group.access
                {
                    *result = get(&self.model, index);
                }
            }
        }
        self.model.look_at(Plane::Values);
        made.map_err(Error::model(function))
    }

    fn phase(&self) -> Phase {
        if self.life.initialized { Phase::Step } else { Phase::Initialization }
    }

    /// Differentiates where the outputs follow what has been set. Should that fail, nothing has happened: between
    /// steps a model's state does not depend on whether its outputs have followed, before that it does.
    fn in_line(
        &mut self,
        function: Function,
        differentiate: impl FnOnce(&mut Self) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let stale = self.life.stale;
        let before = (stale && !self.life.initialized).then(|| self.model.state().clone());
        if stale {
            self.bring_in_line(function)?;
        }
        differentiate(self).inspect_err(|_| {
            self.life.stale = stale;
            if let Some(before) = before {
                // A state that the model has just had fits it.
                let _ = self.model.set_state(&before);
            }
        })
    }

    /// A model without tangents has none of these, and its description says so; asking for nothing is fine.
    fn has_tangents(&self, function: Function, asked: usize) -> Result<(), Error> {
        self.allow(function)?;
        let reason = NO_TANGENTS.iter().find(|(name, _)| *name == function).map(|(_, reason)| *reason);
        match reason {
            Some(reason) if !M::HAS_TANGENTS && asked > 0 => Err(Error::Unsupported { function, reason }),
            _ => Ok(()),
        }
    }

    fn check_differentiable(
        &self,
        function: Function,
        references: &[u32],
        values: usize,
        expected: &'static str,
        fits: fn(&Group<M>) -> bool,
    ) -> Result<(), Error> {
        self.check_call(function, Type::Real, references, values, |run| {
            if fits(run.group) {
                return Ok(());
            }
            let name = self.name_of(run.references);
            Err(Error::NotDifferentiable { function, name, found: describe(run.group), expected })
        })
    }

    fn check_orders(&self, function: Function, references: &[u32], orders: &[i32]) -> Result<(), Error> {
        if references.len() != orders.len() {
            return Err(Error::Length { function, references: references.len(), values: orders.len() });
        }
        match references.iter().zip(orders).find(|(_, order)| **order != 1) {
            None => Ok(()),
            Some((reference, found)) => {
                Err(Error::Order { function, name: self.name_of(&[*reference]), found: *found })
            }
        }
    }

    fn check_rates(&self, function: Function, references: &[u32], rates: &[f64]) -> Result<(), Error> {
        match references.iter().zip(rates).find(|(_, rate)| !Range::ANY.contains(**rate)) {
            None => Ok(()),
            Some((reference, found)) => {
                let name = format!("the derivative of {}", self.name_of(&[*reference]));
                Err(Error::Value { function, name, found: *found, expected: Range::ANY.instead_of(*found) })
            }
        }
    }
}

fn is_real<M>(group: &Group<M>) -> bool {
    matches!(group.access, Access::Real(..))
}

fn is_input<M>(group: &Group<M>) -> bool {
    is_real(group) && group.causality == Causality::Input && group.variability == Variability::Continuous
}

pub(super) fn is_known<M>(group: &Group<M>) -> bool {
    let tunable = group.causality == Causality::Parameter && group.variability == Variability::Tunable;
    is_input(group) || (is_real(group) && tunable)
}

pub(super) fn is_unknown<M>(group: &Group<M>) -> bool {
    is_real(group) && group.causality == Causality::Output && group.variability == Variability::Continuous
}

pub(super) fn describe<M>(group: &Group<M>) -> &'static str {
    match (group.causality, group.variability) {
        (Causality::Input, Variability::Continuous) => "a continuous input",
        (Causality::Input, _) => "a discrete input",
        (Causality::Output, Variability::Continuous) => "a continuous output",
        (Causality::Output, _) => "a discrete output",
        (Causality::Parameter, Variability::Tunable) => "a tunable parameter",
        (Causality::Parameter, _) => "a fixed parameter",
    }
}

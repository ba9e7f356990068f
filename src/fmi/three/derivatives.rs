//! Directional derivatives and output derivatives of arrays: seeds and results have as many elements as the
//! variables have. The derivatives themselves are those of FMI 2.0.

use super::call_order::Function;
use super::error::{Outcome, Reason};
use super::instance::{Instance, Scratch};
use super::table::{Type, Variable};
use super::values::elements;
use crate::fmi::call_order::Function as CommonFunction;
use crate::fmi::derivatives::{describe, is_known, is_unknown};
use crate::fmi::model::Model;
use crate::fmi::registry::Group;

impl<M: Model> Instance<M> {
    /// fmi3GetDirectionalDerivative: `results` = d unknowns / d knowns times `seeds`. Knowns are continuous inputs and
    /// tunable parameters, unknowns continuous outputs, all of type Float64.
    pub fn get_directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seeds: &[f64],
        results: &mut [f64],
    ) -> Outcome<()> {
        self.allow(Function::GetDirectionalDerivative)?;
        if !M::HAS_TANGENTS {
            let reason = "providesDirectionalDerivatives is false in modelDescription.xml";
            return Err(Reason::Unsupported(reason));
        }
        let expected = "a continuous Float64 output";
        self.check_differentiable(unknowns, ("nSensitivity", results.len()), expected, is_unknown)?;
        let expected = "a continuous Float64 input or a tunable Float64 parameter";
        self.check_differentiable(knowns, ("nSeed", seeds.len()), expected, is_known)?;
        let mut scratch = std::mem::take(&mut self.scratch);
        let done = {
            let Scratch { all, some: [first, second], .. } = &mut scratch;
            let table = self.table();
            let unknowns = elements(&table, all, first, unknowns);
            let knowns = elements(&table, all, second, knowns);
            self.on_built(|inner| Ok(inner.get_directional_derivative(unknowns, knowns, seeds, results)?))
        };
        if self.scratch.all.is_empty() {
            self.scratch = scratch;
        }
        done
    }

    /// fmi3GetOutputDerivatives, of order 1, at the end of the last step.
    pub fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        rates: &mut [f64],
    ) -> Outcome<()> {
        self.allow(Function::GetOutputDerivatives)?;
        if !M::HAS_TANGENTS {
            return Err(Reason::Unsupported("maxOutputDerivativeOrder is 0 in modelDescription.xml"));
        }
        let expected = "a continuous Float64 output";
        self.check_differentiable(references, ("nValues", rates.len()), expected, is_unknown)?;
        if let Some((reference, found)) = references.iter().zip(orders).find(|(_, order)| **order != 1) {
            let name = self.table().get(*reference).map_or("", |variable| variable.name()).to_owned();
            let function = CommonFunction::GetRealOutputDerivatives;
            return Err(crate::fmi::Error::Order { function, name, found: *found }.into());
        }
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.ones.resize(rates.len().max(scratch.ones.len()), 1);
        let orders = scratch.ones.get(..rates.len()).unwrap_or_default();
        let references = elements(&self.table(), &scratch.all, &mut scratch.some[0], references);
        let done = self.inner.get_real_output_derivatives(references, orders, rates);
        self.scratch = scratch;
        Ok(done?)
    }

    fn check_differentiable(
        &self,
        references: &[u32],
        (argument, values): (&'static str, usize),
        expected: &'static str,
        fits: fn(&Group<M>) -> bool,
    ) -> Outcome<()> {
        let table = self.table();
        let elements = table.count(references, Type::Float64)?;
        for variable in references.iter().filter_map(|reference| table.get(*reference)) {
            let found = match &variable {
                Variable::Group(_, group) if fits(group) => continue,
                Variable::Group(_, group) => describe(group),
                Variable::Time => "the independent variable",
                Variable::Size(..) | Variable::Array(..) => "a fixed parameter",
            };
            let (function, name) = (CommonFunction::GetDirectionalDerivative, variable.name().to_owned());
            return Err(crate::fmi::Error::NotDifferentiable { function, name, found, expected }.into());
        }
        table.check_length(references, elements, argument, values)
    }
}

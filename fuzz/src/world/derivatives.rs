//! The three functions of derivatives.

use super::World;
use super::pointers::Fault;
use super::values::{refused, unknown_or_wrong};
use crate::subject::{Export, Variable};
use crate::verdict::Verdict;
use bess_consensus::fmi::{Function, Type};

/// The refusal of the first reference that is no such variable.
fn not_differentiable(export: &Export, references: &[u32], fits: fn(&Variable) -> bool) -> Option<Verdict> {
    let wrong = |v: &Variable| (!fits(v)).then(|| Verdict::refuse([&v.name, "expected a continuous Real"]));
    unknown_or_wrong(export, references, Type::Real, wrong)
}

/// The refusal of the first rate that is no number.
fn not_finite(export: &Export, references: &[u32], rates: &[f64]) -> Option<Verdict> {
    let (reference, rate) =
        references.iter().zip(rates).find(|(_, rate)| rate.is_nan() || rate.abs() > 1e30)?;
    let name = &export.variable(*reference)?.name;
    Some(Verdict::refuse([name, &refused(*rate), "expected"]))
}

fn wrong_order(export: &Export, references: &[u32], orders: &[i32]) -> Option<Verdict> {
    let (reference, order) = references.iter().zip(orders).find(|(_, order)| **order != 1)?;
    let name = &export.variable(*reference)?.name;
    Some(Verdict::refuse([name, &format!("order {order}"), "expected order 1"]))
}

impl World<'_> {
    fn rates(&mut self, n: usize) -> Vec<f64> {
        let draw = |_| match self.choices.below(64) {
            0 => self.choices.not_finite(),
            1 if !self.choices.tame => self.choices.of(&[1e300, -1e300, 5e-324, f64::MAX]),
            _ => f64::from(self.choices.any::<i8>()) * 1e-4,
        };
        (0..n).map(draw).collect()
    }

    fn orders(&mut self, n: usize) -> Vec<i32> {
        let draw = |_| if self.choices.once_in(48) { self.choices.of(&[0, 2, -1, i32::MAX]) } else { 1 };
        (0..n).map(draw).collect()
    }

    pub(super) fn directional_derivative(&mut self, k: usize) {
        let export = self.export(k);
        let unknowns = self.references(export, Variable::is_unknown);
        let knowns = self.references(export, Variable::is_known);
        let seeds = self.rates(knowns.len());
        let mut results = vec![0.0; unknowns.len()];
        let fault = match self.fault(4) {
            // Two counts: which of them is meant would not be clear.
            Fault::Endless(_) => Fault::None,
            fault => fault,
        };
        let names = ["vUnknown_ref", "vKnown_ref", "dvKnown", "dvUnknown"];
        let counts = [unknowns.len(), knowns.len(), knowns.len(), unknowns.len()];
        let faulty = match fault {
            Fault::Null(which) | Fault::Crooked(which) => fault.verdict(counts[which], &names),
            _ => None,
        };
        let verdict = faulty
            .or_else(|| not_differentiable(export, &unknowns, Variable::is_unknown))
            .or_else(|| not_differentiable(export, &knowns, Variable::is_known))
            .or_else(|| not_finite(export, &knowns, &seeds))
            .unwrap_or_else(|| self.up_to_the_model(k));
        self.check(k, Function::GetDirectionalDerivative, verdict, |functions, c| {
            let (v, w, d) = (fault.read(0, &unknowns), fault.read(1, &knowns), fault.read(2, &seeds));
            let out = fault.write(3, &mut results);
            // SAFETY: the arrays have as many elements as given, or are such that the callee must see it.
            unsafe { (functions.get_directional_derivative)(c, v, unknowns.len(), w, knowns.len(), d, out) }
        });
    }

    pub(super) fn input_derivatives(&mut self, k: usize) {
        let export = self.export(k);
        let references = self.references(export, Variable::is_ramped);
        let (orders, rates) = (self.orders(references.len()), self.rates(references.len()));
        let fault = self.fault(3);
        let verdict = fault
            .verdict(references.len(), &["vr", "order", "value"])
            .or_else(|| not_differentiable(export, &references, Variable::is_ramped))
            .or_else(|| wrong_order(export, &references, &orders))
            .or_else(|| not_finite(export, &references, &rates))
            .unwrap_or(Verdict::Accept);
        let accepted = self.check(k, Function::SetRealInputDerivatives, verdict, |functions, c| {
            let (vr, n) = (fault.read(0, &references), fault.count(references.len()));
            // SAFETY: the arrays have as many elements as given, or are such that the callee must see it.
            unsafe {
                let (order, value) = (fault.read(1, &orders), fault.read(2, &rates));
                (functions.set_real_input_derivatives)(c, vr, n, order, value)
            }
        });
        if let (true, Some(live)) = (accepted, &mut self.live[k]) {
            live.ramped |= !references.is_empty();
        }
    }

    pub(super) fn output_derivatives(&mut self, k: usize) {
        let export = self.export(k);
        let references = self.references(export, Variable::is_unknown);
        let orders = self.orders(references.len());
        let mut rates = vec![0.0; references.len()];
        let fault = self.fault(3);
        let verdict = fault
            .verdict(references.len(), &["vr", "order", "value"])
            .or_else(|| not_differentiable(export, &references, Variable::is_unknown))
            .or_else(|| wrong_order(export, &references, &orders))
            .unwrap_or_else(|| self.up_to_the_model(k));
        self.check(k, Function::GetRealOutputDerivatives, verdict, |functions, c| {
            let (vr, n) = (fault.read(0, &references), fault.count(references.len()));
            // SAFETY: the arrays have as many elements as given, or are such that the callee must see it.
            unsafe {
                let (order, value) = (fault.read(1, &orders), fault.write(2, &mut rates));
                (functions.get_real_output_derivatives)(c, vr, n, order, value)
            }
        });
    }
}

//! fmi2DoStep, fmi2CancelStep and the status functions.

use super::World;
use crate::verdict::Verdict;
use bess_consensus::fmi::Function;
use bess_consensus::fmi::bindings::*;
use std::ptr::null_mut;

/// Lengths of steps as masters ask for them, s.
const STEPS: [f64; 12] = [0.1, 0.01, 0.05, 1.0 / 3.0, 0.5, 1e-3, 1e-9, 1e-10, 5e-324, 0.0, -0.0, 1.0];
/// Lengths that only a mistake makes; the negative and the last ones are refused.
const ODD_STEPS: [f64; 9] = [1e2, 1e4, 1e6, 9e9, -1e-9, -1.0, f64::NAN, f64::INFINITY, 1e300];

impl World<'_> {
    /// End of the last step, s.
    fn time_s(&mut self, k: usize) -> Option<f64> {
        let live = self.live[k].as_ref()?;
        let mut time_s = f64::NAN;
        let kind = fmi2StatusKind_fmi2LastSuccessfulTime;
        // SAFETY: a living component and a place for the result.
        let status = unsafe { (self.subject.functions.get_real_status)(live.c, kind, &raw mut time_s) };
        self.tally.count(Function::GetRealStatus, status);
        (status == fmi2Status_fmi2OK).then_some(time_s)
    }

    pub(super) fn do_step(&mut self, k: usize) {
        let now_s = self.time_s(k).unwrap_or_default();
        let mut step_s = self.choices.of(&STEPS);
        if self.choices.once_in(64) {
            step_s = self.choices.of(&ODD_STEPS);
        }
        if step_s.is_finite() && step_s < 1e300 {
            step_s = step_s.min(self.subject.traits.longest_step_s);
        }
        // Numbers at which a step takes long are in play: no longer steps than it takes to see that.
        if !self.choices.tame && self.subject.traits.may_refuse {
            let is_long = step_s > 1.0 && step_s.is_finite();
            if step_s <= 1.0 || is_long && self.long_steps == 0 {
                step_s = step_s.min(1e-3);
            } else if is_long {
                self.long_steps -= 1;
            }
        }
        let point_s = match self.choices.below(48) {
            0 => now_s + 5.0 + 1e-3 * step_s.abs().min(1e12),
            1 => now_s - 5.0 - 1e-3 * step_s.abs().min(1e12),
            2 => self.choices.not_finite(),
            3 => now_s + 1e-12,
            4 => now_s.next_up(),
            5 => now_s - 1e-7 * step_s,
            _ => now_s,
        };
        let stands = format!("stands at {now_s:?} s");
        let ramped = self.live[k].as_ref().is_some_and(|live| live.ramped);
        let verdict = if !(step_s >= 0.0 && step_s.is_finite()) {
            Verdict::refuse(["communicationStepSize", &format!("{step_s:?}"), "expected"])
        } else if !point_s.is_finite() {
            Verdict::refuse(["currentCommunicationPoint", &format!("{point_s:?}"), "expected"])
        } else if step_s > 9.21e9 {
            Verdict::refuse(["communicationStepSize", "expected"])
        } else if (point_s - now_s).abs() > 1.0 + 2e-4 * step_s {
            Verdict::refuse(["currentCommunicationPoint", &format!("{point_s:?}"), &stands, "expected"])
        } else if point_s + step_s > 9.21e9 {
            Verdict::refuse(["communicationStepSize", "expected"])
        } else if ramped || point_s + step_s > 9.19e9 || step_s > 1.0 {
            Verdict::Either
        } else {
            self.up_to_the_model(k)
        };
        let accepted = self.check(k, Function::DoStep, verdict, |functions, c| {
            // SAFETY: a component or NULL, and numbers.
            unsafe { (functions.do_step)(c, point_s, step_s, 0) }
        });
        if !accepted {
            return;
        }
        let end_s = self.time_s(k).unwrap_or(f64::NAN);
        let off = (end_s - (point_s + step_s)).abs();
        let tolerance = 1e-9 + 2e-6 * step_s + 8.0 * f64::EPSILON * end_s.abs();
        assert!(off <= tolerance, "stepped from {point_s:?} by {step_s:?} to {end_s:?} s");
        if let (true, Some(live)) = (step_s >= 1e-9, &mut self.live[k]) {
            live.ramped = false;
        }
    }

    pub(super) fn cancel(&mut self, k: usize) {
        let verdict = Verdict::refuse(["no step is in progress"]);
        self.check(k, Function::CancelStep, verdict, |functions, c| {
            // SAFETY: a component or NULL.
            unsafe { (functions.cancel_step)(c) }
        });
    }

    pub(super) fn status(&mut self, k: usize, function: Function) {
        let kind = self.choices.of(&[0, 1, 2, 3, 4, u32::MAX]);
        let given = !self.choices.once_in(4);
        let answers = match function {
            Function::GetRealStatus => kind == fmi2StatusKind_fmi2LastSuccessfulTime,
            Function::GetBooleanStatus => kind == fmi2StatusKind_fmi2Terminated,
            _ => false,
        };
        let verdict = match (answers, given) {
            (false, _) => Verdict::Discard,
            (true, true) => Verdict::Accept,
            (true, false) => Verdict::refuse(["argument value is NULL", "expected"]),
        };
        let (mut real, mut integer, mut boolean, mut status) = (0.0, 0, 0, 0);
        let mut text: fmi2String = std::ptr::null();
        self.check(k, function, verdict, |f, c| {
            // SAFETY: a component or NULL, and NULL or a place for the result.
            unsafe {
                match function {
                    Function::GetRealStatus => (f.get_real_status)(c, kind, place(given, &mut real)),
                    Function::GetIntegerStatus => (f.get_integer_status)(c, kind, place(given, &mut integer)),
                    Function::GetBooleanStatus => (f.get_boolean_status)(c, kind, place(given, &mut boolean)),
                    Function::GetStringStatus => (f.get_string_status)(c, kind, place(given, &mut text)),
                    _ => (f.get_status)(c, kind, place(given, &mut status)),
                }
            }
        });
    }
}

fn place<T>(given: bool, place: &mut T) -> *mut T {
    if given { place } else { null_mut() }
}

//! fmi2GetXXX and fmi2SetXXX.

use super::World;
use crate::functions::Functions;
use crate::subject::{Export, Number, Variable};
use crate::verdict::Verdict;
use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Causality, Function, State, Type, Variability};

/// What results must still hold when a get was refused.
const UNTOUCHED: f64 = f64::from_bits(0x7ff8_dead_beef_0001);
const UNTOUCHED_INTEGER: i32 = 0x5ead_beef;

/// A get of values of type `T`.
struct Get<T> {
    function: Function,
    kind: Type,
    untouched: T,
    same: fn(T, T) -> bool,
    call: fn(&Functions) -> unsafe extern "C" fn(fmi2Component, *const u32, usize, *mut T) -> fmi2Status,
}

/// A set of values of type `T`.
struct Set<T> {
    function: Function,
    kind: Type,
    number: fn(T) -> f64,
    call: fn(&Functions) -> unsafe extern "C" fn(fmi2Component, *const u32, usize, *const T) -> fmi2Status,
}

impl World<'_> {
    /// Value references, mostly of variables that `fits` likes.
    pub(super) fn references(&mut self, export: &Export, fits: impl Fn(&Variable) -> bool) -> Vec<u32> {
        let all = &export.variables;
        let good: Vec<u32> =
            (1..).zip(all).filter(|(_, v)| fits(v)).map(|(reference, _)| reference).collect();
        match self.choices.below(32) {
            0 => return Vec::new(),
            1 => return good,
            _ => {}
        }
        let count = 1 + self.choices.below(5);
        (0..count)
            .map(|_| match self.choices.below(40) {
                0 => self.choices.of(&[0, all.len() as u32 + 1, u32::MAX, i32::MAX as u32, u32::MAX / 2 + 2]),
                1 => self.choices.any(),
                2 => 1 + self.choices.below(all.len()) as u32,
                _ if good.is_empty() => 1 + self.choices.below(all.len()) as u32,
                _ => good[self.choices.below(good.len())],
            })
            .collect()
    }

    fn get<T: Copy>(&mut self, k: usize, get: &Get<T>) -> Option<(Vec<u32>, Vec<T>)> {
        let export = self.export(k);
        let references = self.references(export, |v| v.kind == get.kind);
        let mut values = vec![get.untouched; references.len()];
        let fault = self.fault(2);
        let verdict = fault.verdict(references.len(), &["vr", "value"]).unwrap_or_else(|| {
            let checked = unknown_or_wrong(export, &references, get.kind, |_| None);
            let output = |r: &u32| export.variable(*r).is_some_and(|v| v.causality == Causality::Output);
            match checked {
                Some(verdict) => verdict,
                None if references.iter().any(output) => self.up_to_the_model(k),
                None => Verdict::Accept,
            }
        });
        let accepted = self.check(k, get.function, verdict, |functions, c| {
            let (vr, n) = (fault.read(0, &references), fault.count(references.len()));
            // SAFETY: the arrays have as many elements as given, or are such that the callee must see it.
            unsafe { (get.call)(functions)(c, vr, n, fault.write(1, &mut values)) }
        });
        if !accepted {
            let untouched = values.iter().all(|&value| (get.same)(value, get.untouched));
            assert!(untouched, "{} was refused and wrote results", get.function);
        }
        accepted.then_some((references, values))
    }

    pub(super) fn get_real(&mut self, k: usize) {
        let get = Get {
            function: Function::GetReal,
            kind: Type::Real,
            untouched: UNTOUCHED,
            same: |a: f64, b| a.to_bits() == b.to_bits(),
            call: |functions| functions.get_real,
        };
        let export = self.export(k);
        let certain = self.up_to_the_model(k) == Verdict::Accept;
        if let Some((references, values)) = self.get(k, &get)
            && certain
        {
            for (reference, value) in references.iter().zip(values) {
                let name = export.variable(*reference).map(|v| &v.name);
                assert!(!value.is_nan(), "{name:?} is not a number though all inputs are plausible");
            }
        }
    }

    pub(super) fn get_integer(&mut self, k: usize) {
        let same = |a, b| a == b;
        self.get(
            k,
            &Get {
                function: Function::GetInteger,
                kind: Type::Integer,
                untouched: UNTOUCHED_INTEGER,
                same,
                call: |functions| functions.get_integer,
            },
        );
    }

    pub(super) fn get_boolean(&mut self, k: usize) {
        let get = Get {
            function: Function::GetBoolean,
            kind: Type::Boolean,
            untouched: UNTOUCHED_INTEGER,
            same: |a: fmi2Boolean, b| a == b,
            call: |functions| functions.get_boolean,
        };
        if let Some((_, values)) = self.get(k, &get) {
            assert!(values.iter().all(|value| [0, 1].contains(value)), "{values:?} are no fmi2Booleans");
        }
    }

    fn set<T: Copy>(
        &mut self,
        k: usize,
        set: &Set<T>,
        mut draw: impl FnMut(&mut Self, Option<&Variable>) -> T,
    ) {
        let export = self.export(k);
        let late = !matches!(
            self.live[k].as_ref().and_then(|live| live.state),
            Some(State::Instantiated | State::Initialization)
        );
        let fixed_too = !late || self.choices.once_in(12);
        let references = self.references(export, |v| {
            let open = v.causality == Causality::Input || v.variability == Variability::Tunable;
            v.kind == set.kind && v.causality != Causality::Output && (open || fixed_too)
        });
        let variables = references.iter().map(|&reference| export.variable(reference));
        let values: Vec<T> = variables.map(|variable| draw(self, variable)).collect();
        let fault = self.fault(2);
        let not_settable = |v: &Variable| match (v.causality, v.variability) {
            (Causality::Output, _) => Some(Verdict::refuse([&v.name, "cannot be set", "output"])),
            (Causality::Parameter, Variability::Fixed) if late => {
                Some(Verdict::refuse([&v.name, "cannot be set", "fixed parameter", "expected"]))
            }
            _ => None,
        };
        let verdict = fault
            .verdict(references.len(), &["vr", "value"])
            .or_else(|| unknown_or_wrong(export, &references, set.kind, not_settable))
            .or_else(|| {
                let pairs = references.iter().filter_map(|&r| export.variable(r)).zip(&values);
                let mut pairs = pairs.map(|(variable, &value)| (variable, (set.number)(value)));
                let (variable, value) = pairs.find(|(variable, value)| !variable.takes(*value))?;
                let truth = variable.kind == Type::Boolean;
                let came = if truth { "= 1 is refused".to_owned() } else { refused(value) };
                Some(Verdict::refuse([&variable.name, &came, "expected"]))
            })
            .unwrap_or(Verdict::Accept);
        self.check(k, set.function, verdict, |functions, c| {
            let (vr, n) = (fault.read(0, &references), fault.count(references.len()));
            // SAFETY: the arrays have as many elements as given, or are such that the callee must see it.
            unsafe { (set.call)(functions)(c, vr, n, fault.read(1, &values)) }
        });
    }

    pub(super) fn set_real(&mut self, k: usize) {
        let set = Set {
            function: Function::SetReal,
            kind: Type::Real,
            number: |value| value,
            call: |functions| functions.set_real,
        };
        self.set(k, &set, |world, variable| match variable {
            Some(v) if v.number != Number::Real => {
                world.choices.of(&[0.0, 1.0, 0.49, 0.5, 2.0, -1.0, f64::NAN, 1e300])
            }
            Some(v) => world.choices.real(&v.range, v.start),
            None => 0.0,
        });
    }

    pub(super) fn set_integer(&mut self, k: usize) {
        let set = Set {
            function: Function::SetInteger,
            kind: Type::Integer,
            number: f64::from,
            call: |functions| functions.set_integer,
        };
        self.set(k, &set, |world, _| match world.choices.below(16) {
            0 => world.choices.any(),
            1 => world.choices.of(&[i32::MIN, i32::MAX, -1]),
            k => k as i32 % 4,
        });
    }

    pub(super) fn set_boolean(&mut self, k: usize) {
        let set = Set {
            function: Function::SetBoolean,
            kind: Type::Boolean,
            number: |value: fmi2Boolean| f64::from(value),
            call: |functions| functions.set_boolean,
        };
        self.set(k, &set, |world, variable| {
            // An agent that is not available takes much of the model out of play.
            let on = variable.is_some_and(|v| v.name.starts_with("available") || v.name == "enable");
            let weights = if on { [1, 6, 1, 1] } else { [4, 4, 1, 1] };
            [0, 1, -1, i32::MIN][world.choices.weighted(&weights)]
        });
    }

    /// There are no strings: only nothing can be asked for.
    pub(super) fn strings(&mut self, k: usize, function: Function) {
        let references = self.choices.of(&[&[][..], &[1], &[0, 7]]);
        let verdict = match references.len() {
            0 => Verdict::Accept,
            _ => Verdict::refuse(["no String variables", "expected"]),
        };
        let mut values: Vec<fmi2String> = vec![std::ptr::null(); references.len()];
        let (vr, n) = (references.as_ptr(), references.len());
        self.check(k, function, verdict, |functions, c| {
            // SAFETY: arrays of that length; there is nothing to read behind the strings.
            unsafe {
                match function {
                    Function::GetString => (functions.get_string)(c, vr, n, values.as_mut_ptr()),
                    _ => (functions.set_string)(c, vr, n, values.as_ptr()),
                }
            }
        });
    }
}

impl Export {
    /// The variable behind a value reference.
    pub fn variable(&self, reference: u32) -> Option<&Variable> {
        self.variables.get((reference as usize).checked_sub(1)?)
    }
}

/// How a refused value is told: in digits, but not in hundreds of them.
pub(super) fn refused(value: f64) -> String {
    let sane = value == 0.0 || (1e-6..1e16).contains(&value.abs()) || !value.is_finite();
    if sane { format!("= {value} is refused") } else { format!("= {value:e} is refused") }
}

/// The refusal of the first reference that is unknown, of another type or otherwise not wanted.
pub(super) fn unknown_or_wrong(
    export: &Export,
    references: &[u32],
    kind: Type,
    wrong: impl Fn(&Variable) -> Option<Verdict>,
) -> Option<Verdict> {
    references.iter().enumerate().find_map(|(position, &reference)| match export.variable(reference) {
        None => Some(Verdict::refuse([
            &format!("value reference {reference} (element {position} of the array) is unknown"),
            &format!("expected 1 to {}", export.variables.len()),
        ])),
        Some(v) if v.kind != kind => Some(Verdict::refuse([
            &v.name,
            &format!("is of type {}", v.kind),
            &format!("expected a variable of type {kind}"),
        ])),
        Some(v) => wrong(v),
    })
}

//! An FMU under test: its functions, and some exports of it that differ in agents, options and interface.

use crate::functions::Functions;
use bess_consensus::fmi::lookup::Value;
use bess_consensus::fmi::{Causality, Guid, Interface, Model, Range, Registry, Type, Variability};
use std::ffi::CString;
use std::path::Path;
use tempfile::TempDir;

/// One variable as the model description tells it.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub struct Variable {
    pub name: String,
    pub kind: Type,
    pub causality: Causality,
    pub variability: Variability,
    pub range: Range,
    /// Whether it is a Real in the model too; the portable interface shows all as Real.
    pub number: Number,
    /// Start value, 0 or 1 for a Boolean.
    pub start: f64,
}

/// What a model stores for a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Number {
    Real,
    Integer,
    Boolean,
}

impl Variable {
    /// Whether fmi2SetRealInputDerivatives takes it.
    pub fn is_ramped(&self) -> bool {
        self.number == Number::Real
            && self.causality == Causality::Input
            && self.variability == Variability::Continuous
    }

    /// Whether it is a known of fmi2GetDirectionalDerivative.
    pub fn is_known(&self) -> bool {
        let tunable = self.causality == Causality::Parameter && self.variability == Variability::Tunable;
        self.is_ramped() || (self.number == Number::Real && tunable)
    }

    /// Whether it is an unknown of it.
    pub fn is_unknown(&self) -> bool {
        self.number == Number::Real
            && self.causality == Causality::Output
            && self.variability == Variability::Continuous
    }

    /// Whether a value may be set, the standard's and the model description's conditions.
    pub fn takes(&self, value: f64) -> bool {
        let inside = |value: f64| {
            let above = if self.range.min_excluded {
                value >= self.range.min + 1e-30
            } else {
                value >= self.range.min
            };
            above && value <= self.range.max && value.abs() <= 1e30
        };
        value.is_finite()
            && match self.number {
                Number::Real => inside(value),
                Number::Integer => {
                    let whole = value.round();
                    inside(whole) && whole >= f64::from(i32::MIN) && whole <= f64::from(i32::MAX)
                }
                // The portable interface shows truth as a Real.
                Number::Boolean if self.kind == Type::Boolean => inside(if value == 0.0 { 0.0 } else { 1.0 }),
                Number::Boolean => inside(if value >= 0.5 { 1.0 } else { 0.0 }),
            }
    }
}

/// One export: what the master knows from unpacking it.
pub struct Export {
    /// GUID of its model description.
    pub guid: String,
    /// Its resources folder.
    pub location: CString,
    /// The variables, value reference 1 first.
    pub variables: Vec<Variable>,
}

/// What a sequence of calls may do to an FMU and expect of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Traits {
    /// The model can be told to panic: fmi2Fatal is no finding.
    pub may_panic: bool,
    /// Legal values can still be refused by a step, an initialisation or a get (the network has no solution).
    pub may_refuse: bool,
    /// States with a right checksum and wrong contents are looked through.
    pub checks_states: bool,
    /// How many of the last exports are too large to be played often.
    pub large: usize,
    /// Longest step that is asked for, s.
    pub longest_step_s: f64,
}

/// The FMU.
pub struct Subject {
    /// Its name.
    pub name: &'static str,
    /// Its functions.
    pub functions: Functions,
    /// Exports of it, the cheapest first.
    pub exports: Vec<Export>,
    /// What to expect.
    pub traits: Traits,
    _folders: Vec<TempDir>,
}

impl Subject {
    /// The FMU of model `M`; each export is the one file of its resources folder, in both interfaces for the first.
    pub fn new<M: Model>(file: &str, contents: &[Vec<u8>], traits: Traits) -> Result<Self, String> {
        let (mut exports, mut folders) = (Vec::new(), Vec::new());
        for (k, bytes) in contents.iter().enumerate() {
            let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
            std::fs::write(folder.path().join(file), bytes).map_err(|e| format!("{file}: {e}"))?;
            exports.push(Export::new::<M>(folder.path(), Interface::Structured)?);
            if k == 0 {
                exports.push(Export::new::<M>(folder.path(), Interface::Portable)?);
            }
            folders.push(folder);
        }
        Ok(Self { name: M::IDENTIFIER, functions: Functions::of::<M>(), exports, traits, _folders: folders })
    }

    /// The same FMU through its shared library.
    pub fn through(self, library: &Path) -> Result<Self, String> {
        Ok(Self { functions: Functions::load(library)?, ..self })
    }
}

impl Export {
    fn new<M: Model>(folder: &Path, interface: Interface) -> Result<Self, String> {
        let model = M::load(folder).map_err(|e| e.to_string())?;
        let registry = Registry::new(&model, interface).map_err(|e| e.to_string())?;
        let mut variables = Vec::new();
        for reference in 1..=registry.len() as u32 {
            let Some((group, index)) = registry.locate(reference) else { continue };
            let (number, start) = match group.value(&model, index, Interface::Structured) {
                Value::Real(value) => (Number::Real, value),
                Value::Integer(value) => (Number::Integer, f64::from(value)),
                Value::Boolean(value) => (Number::Boolean, if value { 1.0 } else { 0.0 }),
            };
            variables.push(Variable {
                name: registry.name(reference).unwrap_or_default(),
                kind: group.type_in(interface),
                causality: group.causality,
                variability: group.variability,
                range: group.range,
                number,
                start,
            });
        }
        let guid = Guid::of(&registry, &model).to_string();
        let location = format!("file://{}", folder.display());
        let location = CString::new(location).map_err(|e| e.to_string())?;
        Ok(Self { guid, location, variables })
    }
}

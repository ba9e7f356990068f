//! What the importer's tests share: a participant made of two functions, a C FMU compiled on the
//! spot, zip archives.

#![allow(dead_code)]

use bess_consensus::harness::{
    CallError, Causality, Kind, Participant, StateHandle, Value, Variability, Variable,
};
use std::cell::RefCell;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::rc::Rc;

pub const S: i64 = 1_000_000_000;
pub const MS: i64 = 1_000_000;

type Step = Box<dyn FnMut(&mut [f64], i64, i64) -> Result<(), String>>;
type Feed = Box<dyn FnMut(&mut [f64])>;

/// Variables are cells of one array, in the order declared; value reference = index.
pub struct Mock {
    name: String,
    variables: Vec<Variable>,
    cells: Vec<f64>,
    step: Step,
    feed: Feed,
    pub varies_step: bool,
    pub calls: Rc<RefCell<Vec<String>>>,
}

impl Mock {
    pub fn new(name: &str, step: impl FnMut(&mut [f64], i64, i64) + 'static) -> Self {
        let mut step = step;
        Self {
            name: name.into(),
            variables: Vec::new(),
            cells: Vec::new(),
            step: Box::new(move |cells, t, h| {
                step(cells, t, h);
                Ok(())
            }),
            feed: Box::new(|_| {}),
            varies_step: true,
            calls: Rc::default(),
        }
    }

    pub fn failing(
        name: &str,
        step: impl FnMut(&mut [f64], i64, i64) -> Result<(), String> + 'static,
    ) -> Self {
        let mut mock = Self::new(name, |_, _, _| {});
        mock.step = Box::new(step);
        mock
    }

    /// What outputs do as soon as an input is set.
    pub fn feed(mut self, feed: impl FnMut(&mut [f64]) + 'static) -> Self {
        self.feed = Box::new(feed);
        self
    }

    pub fn log_to(mut self, calls: &Rc<RefCell<Vec<String>>>) -> Self {
        self.calls = Rc::clone(calls);
        self
    }

    fn variable(mut self, name: &str, causality: Causality, kind: Kind, start: f64) -> Self {
        let variability = match causality {
            Causality::Parameter => Variability::Fixed,
            _ if kind == Kind::Real => Variability::Continuous,
            _ => Variability::Discrete,
        };
        self.variables.push(Variable {
            name: name.into(),
            reference: self.cells.len() as u32,
            kind,
            causality,
            variability,
            initial: None,
            start: Value::Real(start).convert(kind).filter(|_| causality != Causality::Output),
            unit: None,
            description: None,
        });
        self.cells.push(start);
        self
    }

    pub fn input(self, name: &str, kind: Kind, start: f64) -> Self {
        self.variable(name, Causality::Input, kind, start)
    }

    pub fn output(self, name: &str, kind: Kind, start: f64) -> Self {
        self.variable(name, Causality::Output, kind, start)
    }

    pub fn parameter(self, name: &str, kind: Kind, start: f64) -> Self {
        self.variable(name, Causality::Parameter, kind, start)
    }

    pub fn boxed(self) -> Box<dyn Participant> {
        Box::new(self)
    }

    fn called(&self, what: &str) {
        // Only logs that somebody shares: the long runs must not pile up strings.
        if Rc::strong_count(&self.calls) > 1 {
            self.calls.borrow_mut().push(format!("{} {what}", self.name));
        }
    }

    fn get<T>(&mut self, what: &str, references: &[u32], values: &mut [T], convert: fn(f64) -> T) {
        self.called(what);
        (self.feed)(&mut self.cells);
        for (value, reference) in values.iter_mut().zip(references) {
            *value = convert(self.cells[*reference as usize]);
        }
    }

    fn set<T: Copy>(&mut self, what: &str, references: &[u32], values: &[T], convert: fn(T) -> f64) {
        self.called(what);
        for (value, reference) in values.iter().zip(references) {
            self.cells[*reference as usize] = convert(*value);
        }
    }
}

impl Participant for Mock {
    fn name(&self) -> &str {
        &self.name
    }
    fn variables(&self) -> &[Variable] {
        &self.variables
    }
    fn can_vary_step(&self) -> bool {
        self.varies_step
    }
    fn setup(&mut self, _: i64, _: Option<i64>) -> Result<(), CallError> {
        self.called("setup");
        Ok(())
    }
    fn enter_initialization(&mut self) -> Result<(), CallError> {
        self.called("enter");
        Ok(())
    }
    fn exit_initialization(&mut self) -> Result<(), CallError> {
        self.called("exit");
        Ok(())
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.get("get", references, values, |cell| cell);
        Ok(())
    }
    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.get("get_integer", references, values, |cell| cell as i32);
        Ok(())
    }
    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        // C knows more than one truth.
        self.get("get_boolean", references, values, |cell| if cell != 0.0 { -1 } else { 0 });
        Ok(())
    }
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.set("set", references, values, |value| value);
        Ok(())
    }
    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.set("set_integer", references, values, f64::from);
        Ok(())
    }
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        assert!(values.iter().all(|value| [0, 1].contains(value)));
        self.set("set_boolean", references, values, f64::from);
        Ok(())
    }
    fn do_step(&mut self, t_ns: i64, h_ns: i64) -> Result<(), CallError> {
        self.called("step");
        (self.feed)(&mut self.cells);
        (self.step)(&mut self.cells, t_ns, h_ns).map_err(|reason| CallError::new("fmi2DoStep", reason))
    }
    fn terminate(&mut self) -> Result<(), CallError> {
        self.called("terminate");
        Ok(())
    }
    fn reset(&mut self) -> Result<(), CallError> {
        unimplemented!()
    }
    fn save_state(&mut self) -> Result<StateHandle, CallError> {
        unimplemented!()
    }
    fn restore_state(&mut self, _: StateHandle) -> Result<(), CallError> {
        unimplemented!()
    }
    fn forget_state(&mut self, _: StateHandle) {}
    fn serialise_state(&mut self, _: StateHandle) -> Result<Vec<u8>, CallError> {
        unimplemented!()
    }
    fn deserialise_state(&mut self, _: &[u8]) -> Result<StateHandle, CallError> {
        unimplemented!()
    }
}

pub fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

pub fn integrator_xml() -> String {
    std::fs::read_to_string(fixture("integrator.xml")).unwrap()
}

/// The shared library of `fixtures/integrator.c`.
pub fn compile(defines: &[&str]) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let library = folder.path().join("integrator.so");
    let status = Command::new("gcc")
        .args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-I"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/fmi/headers"))
        .args(defines)
        .arg("-o")
        .arg(&library)
        .arg(fixture("integrator.c"))
        .status()
        .expect("gcc runs");
    assert!(status.success());
    std::fs::read(library).unwrap()
}

/// A zip archive of these entries, in this order.
pub fn zip(path: &Path, entries: &[(&str, &[u8])]) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in entries {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
}

/// An FMU of this description and library.
pub fn fmu(folder: &Path, xml: &str, library: &[u8]) -> PathBuf {
    let path = folder.join("integrator.fmu");
    let entries: [(&str, &[u8]); 3] = [
        ("modelDescription.xml", xml.as_bytes()),
        ("binaries/linux64/integrator.so", library),
        ("resources/data.txt", b"1 2 3\n"),
    ];
    zip(&path, &entries);
    path
}

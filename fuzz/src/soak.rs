//! The long runs: millions of steps, thousands of lives, many instances on many threads. Memory must not grow, and the
//! last run must give the bits of the first.

use crate::subject::{Export, Number, Subject};
use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Causality, Type};
use std::ffi::CString;
use std::fmt;
use std::ptr::{null, null_mut};

/// Steps of one run that is repeated.
const RUN: u64 = 10_000;
/// Communication step, s.
const STEP_S: f64 = 0.01;
/// How much the memory may move once everything has been used, bytes: the allocator's own unrest. A leak of
/// 32 bytes in each of ten thousand lives is more.
const UNREST: i64 = 256 * 1024;

/// How much to do.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    /// fmi2DoStep calls for each FMU.
    pub steps: u64,
    /// Lives from fmi2Instantiate to fmi2FreeInstance for each FMU.
    pub lives: u64,
    /// Instances at once, and threads that they are spread over.
    pub crowd: (usize, usize),
}

/// What was seen.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The FMU.
    pub name: &'static str,
    /// Steps made.
    pub steps: u64,
    /// Runs, all with equal bits.
    pub runs: u64,
    /// Growth of the memory over the steps, from a tenth on, bytes.
    pub step_growth: Option<i64>,
    /// Lives.
    pub lives: u64,
    /// Growth over the lives, from a tenth on, bytes.
    pub life_growth: Option<i64>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kib = |growth: Option<i64>| match growth {
            Some(bytes) => format!("{:+} KiB", bytes / 1024),
            None => "not measured here".into(),
        };
        write!(
            f,
            "{}: {} steps in {} runs of equal bits, memory {}; {} lives, memory {}",
            self.name,
            self.steps,
            self.runs,
            kib(self.step_growth),
            self.lives,
            kib(self.life_growth),
        )
    }
}

/// Everything; the error says what was not as it must be.
pub fn soak(subject: &Subject, load: Load) -> Result<Outcome, String> {
    // Structured interface: the second export is the first in the portable one.
    let exports: Vec<&Export> = subject.exports.iter().collect();
    let firsts = |export: &&Export| [1, 2].map(|lives| run(subject, export, RUN / lives, 1));
    let first: Vec<[u64; 2]> = exports.iter().map(firsts).collect();
    let runs = load.steps.div_ceil(RUN).max(2);
    let mut base = None;
    for k in 0..runs {
        if k == runs.div_ceil(10) {
            base = anonymous();
        }
        // The small ones nine times in ten.
        let which =
            if k % 10 == 9 { (k / 10) as usize % exports.len() } else { k as usize % exports.len().min(2) };
        let lives = if k % 2 == 0 { 1 } else { 2 };
        let digest = run(subject, exports[which], RUN / lives, lives);
        if digest != first[which][lives as usize - 1] {
            return Err(format!(
                "{}: run {k} of export {which} gives other bits than the first",
                subject.name
            ));
        }
    }
    let step_growth = growth("steps", base)?;
    let mut base = None;
    for k in 0..load.lives {
        if k == load.lives.div_ceil(10) {
            base = anonymous();
        }
        let export = exports[if k % 50 == 49 { (k / 50) as usize % exports.len() } else { k as usize % 2 }];
        let mut fmu = Fmu::new(subject, export);
        fmu.start();
        fmu.step(2);
        fmu.save_and_go_back();
    }
    let life_growth = growth("lives", base)?;
    crowd(subject, exports[0], load.crowd)?;
    Ok(Outcome { name: subject.name, steps: runs * RUN, runs, step_growth, lives: load.lives, life_growth })
}

fn growth(what: &str, base: Option<i64>) -> Result<Option<i64>, String> {
    let grown = base.zip(anonymous()).map(|(before, after)| after - before);
    match grown {
        Some(bytes) if bytes > UNREST => Err(format!("memory has grown by {bytes} bytes over the {what}")),
        _ => Ok(grown),
    }
}

/// Memory of its own that the process has, bytes, where the system tells. Without the pages of programs and libraries:
/// those come when they are first touched and go when the system wants them, and are nobody's leak. Counted page by page,
/// as the quick figures of `/proc/self/status` and `statm` are not.
fn anonymous() -> Option<i64> {
    give_back();
    let text = std::fs::read_to_string("/proc/self/smaps_rollup").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("Anonymous:"))?;
    Some(1024 * line.split_whitespace().next()?.parse::<i64>().ok()?)
}

/// Lets the allocator give back what is free, which it does by itself only now and then.
fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        unsafe extern "C" {
            fn malloc_trim(pad: usize) -> i32;
        }
        // SAFETY: may be called at any time.
        unsafe { malloc_trim(0) };
    }
}

/// `lives` runs of so many steps, with a reset between them; the digest of the last.
fn run(subject: &Subject, export: &Export, steps: u64, lives: u64) -> u64 {
    let mut fmu = Fmu::new(subject, export);
    for _ in 1..lives {
        fmu.start();
        fmu.step(steps);
        fmu.reset();
    }
    fmu.start();
    fmu.step(steps);
    fmu.digest
}

/// Many instances at once, each on another thread for every part of its life, must all give the same bits.
fn crowd(subject: &Subject, export: &Export, (instances, threads): (usize, usize)) -> Result<(), String> {
    let alone = run(subject, export, 1000, 1);
    let mut crowd: Vec<Fmu<'_>> = (0..instances).map(|_| Fmu::new(subject, export)).collect();
    for fmu in &mut crowd {
        fmu.start();
    }
    for part in 0..4 {
        // Shifted, so that each goes from thread to thread.
        crowd.rotate_left(part * 3 % instances.max(1));
        std::thread::scope(|scope| {
            for share in crowd.chunks_mut(instances.div_ceil(threads.max(1))) {
                scope.spawn(|| {
                    for _ in 0..25 {
                        share.iter_mut().for_each(|fmu| fmu.step(10));
                    }
                });
            }
        });
    }
    match crowd.iter().position(|fmu| fmu.digest != alone) {
        None => Ok(()),
        Some(_) => {
            Err(format!("{}: an instance among {instances} gives other bits than alone", subject.name))
        }
    }
}

/// A running FMU that is driven by inputs which only the step number decides.
struct Fmu<'a> {
    subject: &'a Subject,
    c: fmi2Component,
    inputs: Vec<(u32, f64)>,
    outputs: Vec<u32>,
    references: Vec<u32>,
    values: Vec<f64>,
    results: Vec<f64>,
    enable: Option<(u32, Type)>,
    made: u64,
    digest: u64,
}

// SAFETY: an instance may be called from any thread, one at a time, and each is owned by one.
unsafe impl Send for Fmu<'_> {}

impl<'a> Fmu<'a> {
    fn new(subject: &'a Subject, export: &Export) -> Self {
        let guid = CString::new(export.guid.as_str()).expect("hexadecimal digits");
        // SAFETY: C strings and no callbacks.
        let c = unsafe {
            let location = export.location.as_ptr();
            (subject.functions.instantiate)(c"soak".as_ptr(), 1, guid.as_ptr(), location, null(), 0, 0)
        };
        assert!(!c.is_null());
        let numbered = || (1..).zip(&export.variables);
        let inputs: Vec<(u32, f64)> =
            numbered().filter(|(_, v)| v.is_ramped()).map(|(reference, v)| (reference, v.start)).collect();
        let real_output =
            |v: &crate::subject::Variable| v.causality == Causality::Output && v.number == Number::Real;
        let outputs: Vec<u32> = numbered().filter(|(_, v)| real_output(v)).map(|(r, _)| r).collect();
        let enable = numbered().find(|(_, v)| v.name == "enable").map(|(reference, v)| (reference, v.kind));
        Self {
            subject,
            c,
            references: inputs.iter().map(|(reference, _)| *reference).collect(),
            values: vec![0.0; inputs.len()],
            results: vec![0.0; outputs.len()],
            inputs,
            outputs,
            enable,
            made: 0,
            digest: 0,
        }
    }

    fn start(&mut self) {
        (self.made, self.digest) = (0, 0xcbf2_9ce4_8422_2325);
        let f = &self.subject.functions;
        // SAFETY: a living component; arrays of one element.
        unsafe {
            assert_eq!((f.setup_experiment)(self.c, 0, 0.0, 0.0, 0, 0.0), fmi2Status_fmi2OK);
            assert_eq!((f.enter_initialization_mode)(self.c), fmi2Status_fmi2OK);
            match self.enable {
                Some((vr, Type::Boolean)) => {
                    assert_eq!((f.set_boolean)(self.c, &raw const vr, 1, &1), fmi2Status_fmi2OK);
                }
                Some((vr, _)) => assert_eq!((f.set_real)(self.c, &raw const vr, 1, &1.0), fmi2Status_fmi2OK),
                None => {}
            }
            let status = (f.exit_initialization_mode)(self.c);
            assert_eq!(
                status,
                fmi2Status_fmi2OK,
                "{} finds no start with {} inputs",
                self.subject.name,
                self.inputs.len()
            );
        }
    }

    fn step(&mut self, steps: u64) {
        for _ in 0..steps {
            if self.made.is_multiple_of(10) {
                self.set_inputs();
            }
            let now_s = self.made as f64 * STEP_S;
            // SAFETY: a living component and numbers.
            let status = unsafe { (self.subject.functions.do_step)(self.c, now_s, STEP_S, 1) };
            assert_eq!(status, fmi2Status_fmi2OK, "{} at {now_s} s", self.subject.name);
            self.made += 1;
            if self.made.is_multiple_of(50) {
                self.read();
            }
        }
    }

    /// Triangular waves of 1 %, each input out of step with the others.
    fn set_inputs(&mut self) {
        for (i, ((_, start), value)) in self.inputs.iter().zip(&mut self.values).enumerate() {
            let phase = (self.made / 10 + 37 * i as u64) % 200;
            let wave = (phase as f64 - 100.0).abs() / 50.0 - 1.0;
            *value = if *start == 0.0 { 0.01 * wave } else { start * (1.0 + 1e-3 * wave) };
        }
        let (vr, n, value) = (self.references.as_ptr(), self.values.len(), self.values.as_ptr());
        // SAFETY: a living component, arrays of n elements.
        let status = unsafe { (self.subject.functions.set_real)(self.c, vr, n, value) };
        assert_eq!(status, fmi2Status_fmi2OK, "inputs of {}", self.subject.name);
    }

    fn read(&mut self) {
        let (vr, n, value) = (self.outputs.as_ptr(), self.outputs.len(), self.results.as_mut_ptr());
        // SAFETY: a living component, arrays of n elements.
        let status = unsafe { (self.subject.functions.get_real)(self.c, vr, n, value) };
        assert_eq!(status, fmi2Status_fmi2OK);
        for value in &self.results {
            self.digest = (self.digest ^ value.to_bits()).wrapping_mul(0x0100_0000_01b3).rotate_left(17);
        }
    }

    fn reset(&mut self) {
        // SAFETY: a living component.
        assert_eq!(unsafe { (self.subject.functions.reset)(self.c) }, fmi2Status_fmi2OK);
    }

    fn save_and_go_back(&mut self) {
        let (f, mut state) = (&self.subject.functions, null_mut());
        // SAFETY: a living component, and a state that is freed once.
        unsafe {
            assert_eq!((f.get_fmu_state)(self.c, &raw mut state), fmi2Status_fmi2OK);
            assert_eq!((f.set_fmu_state)(self.c, state), fmi2Status_fmi2OK);
            assert_eq!((f.free_fmu_state)(self.c, &raw mut state), fmi2Status_fmi2OK);
        }
    }
}

impl Drop for Fmu<'_> {
    fn drop(&mut self) {
        // SAFETY: alive, and not used again.
        unsafe { (self.subject.functions.free_instance)(self.c) };
    }
}

//! The short run, on the side of the process that may die of it: instantiate twice under one name, initialise, read
//! everything, step, go back, reset, run again. Says before each call what comes, so that a crash has a place.

use super::finding::{Finding, Place};
use super::rules::{self, Rule};
use crate::harness::{Causality, Fmu, HarnessError, Kind, Participant, Slave, Value, Variable};
use std::io::Write;
use std::path::Path;

/// Every line for the other side begins so; what the FMU prints does not.
pub const MARK: &str = "@bess-check ";
/// Steps of each part of the run.
const STEPS: i64 = 10;
/// Where the model suggests no step, ns.
const STEP_NS: i64 = 10_000_000;
/// A suggestion is followed up to this, ns: all steps together must fit 64 bits.
const LONGEST_STEP_NS: f64 = 1e17;

/// What stops the run.
type Stopped = Box<Finding>;

/// Runs the FMU at `path` and reports on standard output, line by line.
pub fn probe(path: &Path) {
    if let Err(finding) = all(path) {
        tell(&finding);
    }
    say("done");
}

fn say(text: &str) {
    let mut out = std::io::stdout().lock();
    // If nobody listens any more there is nothing left to do but go on.
    let _ = writeln!(out, "\n{MARK}{text}");
    let _ = out.flush();
}

fn tell(finding: &Finding) {
    if let Ok(json) = serde_json::to_string(finding) {
        say(&format!("finding {json}"));
    }
}

fn all(path: &Path) -> Result<(), Stopped> {
    say("stage loading the library");
    let fmu = Fmu::open(path).map_err(|error| match &error {
        HarnessError::Library(_) | HarnessError::Archive(_) => {
            stopped(&rules::RUN_LOAD, &error.to_string(), "a library that loads on this machine")
        }
        _ => stopped(&rules::RUN_LOAD, &error.to_string(), "an FMU that bess can read"),
    })?;
    let description = fmu.description();
    let step_ns = description
        .default_experiment
        .step_s
        .map(|s| (s * 1e9).round())
        .filter(|ns| *ns >= 1.0 && *ns <= LONGEST_STEP_NS)
        .map_or(STEP_NS, |ns| ns as i64);
    let can_go_back = description.capabilities.can_get_and_set_state;
    let only_once = description.capabilities.can_be_instantiated_only_once;

    say("stage fmi2Instantiate");
    let mut one = fmu.instantiate("instance").map_err(|error| called(&error.to_string()))?;
    if !only_once {
        say("stage fmi2Instantiate, a second instance of the same name");
        match fmu.instantiate("instance") {
            Ok(second) => {
                say("stage fmi2FreeInstance of the second instance");
                drop(second);
            }
            Err(error) => tell(&stopped(
                &rules::RUN_SAME_NAME,
                &error.to_string(),
                "a second instance of the same name",
            )),
        }
    }
    let first = run(&mut one, step_ns)?;
    if can_go_back {
        go_back(&mut one, step_ns)?;
    }
    say("stage fmi2Terminate");
    one.terminate().map_err(|error| called(&error.to_string()))?;
    say("stage fmi2Reset");
    one.reset().map_err(|error| called(&error.to_string()))?;
    let again = run(&mut one, step_ns)?;
    if first != again {
        tell(&stopped(
            &rules::RUN_RESET,
            &format!("after fmi2Reset {}", difference(&one, &first, &again)),
            "the same run, bit by bit",
        ));
    }
    say("stage fmi2FreeInstance");
    drop(one);
    Ok(())
}

/// From the state after instantiation through ten steps; all values at the end.
fn run(slave: &mut Slave, step_ns: i64) -> Result<Vec<u64>, Stopped> {
    let call = |result: Result<(), crate::harness::CallError>| result.map_err(|e| called(&e.to_string()));
    say("stage fmi2SetupExperiment");
    call(slave.setup(0, Some(STEPS * step_ns)))?;
    say("stage fmi2EnterInitializationMode");
    call(slave.enter_initialization())?;
    say("stage fmi2ExitInitializationMode");
    call(slave.exit_initialization())?;
    say("stage reading all variables");
    let values = read(slave)?;
    starts(slave, &values);
    for k in 0..STEPS {
        say(&format!("stage fmi2DoStep, step {}", k + 1));
        call(slave.do_step(k * step_ns, step_ns))?;
    }
    say("stage reading all variables after the steps");
    let values = read(slave)?;
    let not_finite = values.iter().position(|bits| !f64::from_bits(*bits).is_finite());
    if let Some(Variable { name, .. }) = not_finite.and_then(|at| readable(slave).nth(at)) {
        let mut finding = stopped(
            &rules::RUN_NOT_FINITE,
            "a value that is not finite after ten steps from its start values",
            "finite values",
        );
        finding.place.variable = Some(name.clone());
        tell(&finding);
    }
    Ok(values)
}

/// Saves the state, steps, goes back, steps again: both times the same.
fn go_back(slave: &mut Slave, step_ns: i64) -> Result<(), Stopped> {
    let failed = |error: crate::harness::CallError| {
        stopped(&rules::RUN_STATE, &error.to_string(), "a state, because canGetAndSetFMUstate is true")
    };
    say("stage fmi2GetFMUstate");
    let state = slave.save_state().map_err(failed)?;
    say("stage fmi2DoStep after fmi2GetFMUstate");
    slave.do_step(STEPS * step_ns, step_ns).map_err(failed)?;
    let once = read(slave)?;
    say("stage fmi2SetFMUstate");
    slave.restore_state(state).map_err(failed)?;
    say("stage fmi2DoStep after fmi2SetFMUstate");
    slave.do_step(STEPS * step_ns, step_ns).map_err(failed)?;
    let twice = read(slave)?;
    if once != twice {
        let found = format!("after fmi2SetFMUstate {}", difference(slave, &once, &twice));
        return Err(stopped(&rules::RUN_STATE, &found, "the same step, bit by bit"));
    }
    slave.forget_state(state);
    Ok(())
}

/// All variables that are read, in the order of [`read`].
fn readable(slave: &Slave) -> impl Iterator<Item = &Variable> {
    let all = slave.variables();
    let of = move |kind| all.iter().filter(move |variable| variable.kind == kind);
    [Kind::Real, Kind::Integer, Kind::Boolean].into_iter().flat_map(of)
}

/// The bits of all values: Reals, then Integers, then Booleans, the latter as numbers.
fn read(slave: &mut Slave) -> Result<Vec<u64>, Stopped> {
    let of = |kind| -> Vec<u32> {
        slave.variables().iter().filter(|v| v.kind == kind).map(|v| v.reference).collect()
    };
    let (reals, integers, booleans) = (of(Kind::Real), of(Kind::Integer), of(Kind::Boolean));
    let call = |result: Result<(), crate::harness::CallError>| result.map_err(|e| called(&e.to_string()));
    let mut bits = Vec::with_capacity(reals.len() + integers.len() + booleans.len());
    let mut values = vec![0.0; reals.len()];
    call(slave.get_real(&reals, &mut values))?;
    bits.extend(values.iter().map(|value| value.to_bits()));
    let mut values = vec![0; integers.len()];
    call(slave.get_integer(&integers, &mut values))?;
    bits.extend(values.iter().map(|value| f64::from(*value).to_bits()));
    let mut values = vec![0; booleans.len()];
    call(slave.get_boolean(&booleans, &mut values))?;
    bits.extend(values.iter().map(|value| f64::from(u8::from(*value != 0)).to_bits()));
    Ok(bits)
}

/// Inputs and parameters begin with the values that the description promises.
fn starts(slave: &Slave, values: &[u64]) {
    for (variable, bits) in readable(slave).zip(values) {
        let is_set = matches!(variable.causality, Causality::Input | Causality::Parameter);
        let found = f64::from_bits(*bits);
        let start = variable.start.filter(|_| is_set).map(Value::as_f64);
        if let Some(start) = start.filter(|start| *start != found) {
            let mut finding = stopped(
                &rules::RUN_START,
                &format!("{found:?} after initialisation"),
                &format!("the start value {start:?} of the description"),
            );
            finding.place.variable = Some(variable.name.clone());
            tell(&finding);
            return;
        }
    }
}

fn difference(slave: &Slave, a: &[u64], b: &[u64]) -> String {
    let at = a.iter().zip(b).position(|(a, b)| a != b).unwrap_or(0);
    let name = readable(slave).nth(at).map_or("", |variable| &variable.name);
    let value = |values: &[u64]| values.get(at).map_or(f64::NAN, |bits| f64::from_bits(*bits));
    format!("{name} is {:?} instead of {:?}", value(b), value(a))
}

fn called(error: &str) -> Stopped {
    stopped(&rules::RUN_CALL, error, "fmi2OK")
}

fn stopped(rule: &'static Rule, found: &str, expected: &str) -> Stopped {
    let mend = "see what the FMU logs, or run it in its own tool";
    Box::new(Finding::new(rule, Place::file("short run"), found, expected, mend))
}

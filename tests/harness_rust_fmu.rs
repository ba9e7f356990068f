#![cfg(all(feature = "host", target_os = "linux", target_arch = "x86_64"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
//! The same model once behind the C interface of a real shared library and once in process: what the
//! master sees must agree to the bit.

mod fmi_mock;
mod harness_support;

use bess_consensus::fmi::{Interface, model_description};
use bess_consensus::harness::*;
use fmi_mock::{STEP_FAILS, STEP_PANICS};
use harness_support::{MS, S, zip};
use std::path::Path;
use std::process::Command;

const LAGS: usize = 3;

fn mock_fmu(folder: &Path) -> Fmu {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/mock_fmu/Cargo.toml");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mock_fmu");
    let built = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--offline", "--lib", "--manifest-path", manifest, "--target-dir"])
        .arg(&target)
        .status()
        .expect("cargo runs");
    assert!(built.success());
    let library = std::fs::read(target.join("debug/libMock.so")).unwrap();
    let xml = model_description::write(&fmi_mock::Mock::with(LAGS), Interface::Structured).unwrap();
    let path = folder.join("Mock.fmu");
    let entries: [(&str, &[u8]); 3] = [
        ("modelDescription.xml", xml.as_bytes()),
        ("binaries/linux64/Mock.so", &library),
        ("resources/n.txt", b"3"),
    ];
    zip(&path, &entries);
    Fmu::open(&path).unwrap()
}

fn in_process(name: &str) -> InProcess<fmi_mock::Mock> {
    let resources = fmi_mock::resources::Resources::new(LAGS);
    InProcess::load(name, &resources.path()).unwrap()
}

/// Two of them in a ring: x[i] of each drives u[i] of the other.
fn trajectory(mut pair: [Box<dyn Participant>; 2], algorithm: Algorithm) -> Vec<Vec<u64>> {
    let mut connections = Vec::new();
    for i in 1..=LAGS {
        for (from, to) in [("a", "b"), ("b", "a")] {
            let (from, to) = (Endpoint::new(from, format!("x[{i}]")), Endpoint::new(to, format!("u[{i}]")));
            connections.push(Connection { factor: -0.4 + 0.1 * i as f64, offset: 0.01, from, to });
        }
    }
    let set = |variable: &str, value| Setting::new("b", variable, value);
    let events = vec![
        Event {
            at_ns: 350 * MS,
            sets: vec![set("enable", Value::Boolean(false)), set("gain", Value::Real(1.5))],
        },
        Event {
            at_ns: 425 * MS,
            sets: vec![set("enable", Value::Boolean(true)), set("mode", Value::Integer(2))],
        },
    ];
    let initial = vec![set("x_start[2]", Value::Real(-3.0)), set("tau", Value::Real(0.3))];
    let plan =
        Plan { stop_ns: 2 * S, step_ns: 10 * MS, algorithm, connections, initial, events, ..Plan::default() };
    let mut memory = Memory::new(1, |_| true);
    let outcome = run(&mut pair, &plan, &mut memory).unwrap();
    assert_eq!((outcome.steps, outcome.events), (201, 2));
    let values = |column: &Column| memory.values(&column.participant, &column.variable).unwrap();
    let columns = memory.columns().iter();
    columns.map(|column| values(column).iter().map(|value| value.to_bits()).collect()).collect()
}

#[test]
fn behind_c_and_in_process_agree_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = mock_fmu(folder.path());
    for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel] {
        let slaves: [Box<dyn Participant>; 2] =
            [Box::new(fmu.instantiate("a").unwrap()), Box::new(fmu.instantiate("b").unwrap())];
        let models: [Box<dyn Participant>; 2] = [Box::new(in_process("a")), Box::new(in_process("b"))];
        let behind_c = trajectory(slaves, algorithm);
        assert_eq!(behind_c.len(), 2 * (3 * LAGS - LAGS + 1 + 2) + 3);
        assert_eq!(behind_c, trajectory(models, algorithm), "{algorithm:?}");
    }
}

#[test]
fn the_description_and_the_registry_name_the_same_variables() {
    let folder = tempfile::tempdir().unwrap();
    let mut described = mock_fmu(folder.path()).description().variables.clone();
    described.iter_mut().for_each(|variable| variable.initial = None);
    assert_eq!(described, in_process("a").variables());
}

#[test]
fn states_cross_between_library_and_process() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = mock_fmu(folder.path());
    let (mut slave, mut model) = (fmu.instantiate("a").unwrap(), in_process("b"));
    let x = |participant: &mut dyn Participant| {
        let mut values = [0.0; LAGS];
        participant.get_real(&[4, 5, 6], &mut values).unwrap();
        values
    };
    for participant in [&mut slave as &mut dyn Participant, &mut model] {
        participant.setup(0, None).unwrap();
        participant.enter_initialization().unwrap();
        participant.exit_initialization().unwrap();
    }
    slave.do_step(0, S).unwrap();
    let state = slave.save_state().unwrap();
    let bytes = slave.serialise_state(state).unwrap();
    slave.do_step(S, S).unwrap();
    let foreign = model.deserialise_state(&bytes).unwrap();
    model.restore_state(foreign).unwrap();
    assert_ne!(x(&mut model), x(&mut slave));
    model.do_step(S, S).unwrap();
    assert_eq!(x(&mut model), x(&mut slave));
}

#[test]
fn the_reason_of_a_refusal_comes_through_c() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = mock_fmu(folder.path());
    let fault = fmu.description().variable("fault").unwrap().reference;
    let step = |kind: i32| {
        let mut slave = fmu.instantiate("a").unwrap();
        slave.set_integer(&[fault], &[kind]).unwrap();
        slave.setup(0, None).unwrap();
        slave.enter_initialization().unwrap();
        slave.exit_initialization().unwrap();
        slave.do_step(0, S).unwrap_err().to_string()
    };
    let error = step(STEP_FAILS);
    assert!(error.starts_with("fmi2DoStep: returned fmi2Error\n  [logStatusError]"), "{error}");
    assert!(error.contains("told to fail in step"), "{error}");
    let error = step(STEP_PANICS);
    assert!(error.starts_with("fmi2DoStep: returned fmi2Fatal"), "{error}");
    assert!(error.contains("told to panic in step"), "{error}");
    let mut slave = fmu.instantiate("a").unwrap();
    let error = slave.set_real(&[1], &[f64::INFINITY]).unwrap_err().to_string();
    assert!(error.contains("u[1] = inf is refused"), "{error}");
}

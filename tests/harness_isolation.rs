//! FMUs that crash, hang, flood or write where they should not, each in a process of its own: the error says what
//! happened, and this process is none the worse for it.
#![cfg(all(feature = "host", target_os = "linux"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod harness_support;

use bess_consensus::harness::isolation::Isolated;
use bess_consensus::harness::*;
use harness_support::{MS, S, compile, fmu, integrator_xml};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

fn isolation(call_limit: Duration) -> Isolation {
    let command = (PathBuf::from(env!("CARGO_BIN_EXE_bess")), vec!["serve-fmu".to_owned()]);
    Isolation { command, call_limit, output: None }
}

/// An integrator with this fault.
fn faulty(folder: &Path, fault: u32) -> PathBuf {
    fmu(folder, &integrator_xml(), &compile(&[&format!("-DFAULT={fault}")]))
}

fn start(path: &Path, limit: Duration) -> Result<Isolated, HarnessError> {
    Isolated::start(path, "one", &isolation(limit))
}

/// Four steps after initialisation, with a reading after each.
fn four_steps(one: &mut dyn Participant) -> Result<f64, CallError> {
    one.setup(0, Some(S))?;
    one.enter_initialization()?;
    one.exit_initialization()?;
    one.set_real(&[1], &[1.0])?;
    let mut y = [0.0];
    for k in 0..4 {
        one.do_step(k * 100 * MS, 100 * MS)?;
        one.get_real(&[2], &mut y)?;
    }
    Ok(y[0])
}

#[test]
fn every_fault_is_an_error_that_names_the_call_and_what_happened() {
    let folder = tempfile::tempdir().unwrap();
    // Fault, function, what the error says, whether the process is still there.
    let faults = [
        (1, "fmi2DoStep", "its process died (signal 6, an abort)", Trouble::Died),
        (20, "fmi2DoStep", "its process died (signal 11, a memory fault)", Trouble::Died),
        (21, "fmi2DoStep", "its process died (exit status: 0)", Trouble::Died),
        (11, "fmi2GetReal", "wrote outside the room for 1 values: 0 before it and 1 after", Trouble::Refused),
        (12, "fmi2GetReal", "wrote outside the room for 1 values: 1 before it and 0 after", Trouble::Refused),
        (13, "fmi2GetReal", "its process died (signal 11, a memory fault)", Trouble::Died),
    ];
    for (fault, function, said, trouble) in faults {
        let mut one = start(&faulty(folder.path(), fault), Duration::from_secs(60)).unwrap();
        let error = four_steps(&mut one).unwrap_err();
        assert_eq!((error.function, error.trouble), (function, trouble), "fault {fault}: {error}");
        assert!(error.reason.contains(said), "fault {fault}: {error}");
        // Nothing is asked of it any more, and leaving it does not wait.
        assert!(one.terminate().is_ok());
        assert!(one.do_step(0, S).unwrap_err().reason.contains("not called"), "fault {fault}");
        let begun = Instant::now();
        drop(one);
        assert!(begun.elapsed() < Duration::from_secs(20), "fault {fault}");
    }
}

#[test]
fn the_last_words_come_with_the_error() {
    let folder = tempfile::tempdir().unwrap();
    let heard = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&heard);
    let output = Some(Arc::new(move |name: &str, line: &str| {
        into.lock().unwrap().push(format!("{name}: {line}"));
    }) as Arc<isolation::Output>);
    let isolation = Isolation { output, ..isolation(Duration::from_secs(60)) };
    let mut one = Isolated::start(&faulty(folder.path(), 1), "one", &isolation).unwrap();
    let error = four_steps(&mut one).unwrap_err();
    assert_eq!(error.log, ["[logEvents] about to abort", "last words"], "{error}");
    assert_eq!(*heard.lock().unwrap(), ["one: last words"]);
}

#[test]
fn one_that_does_not_answer_is_left_after_the_time_given() {
    let folder = tempfile::tempdir().unwrap();
    for fault in [2, 9] {
        let mut one = start(&faulty(folder.path(), fault), Duration::from_secs(2)).unwrap();
        let process = one.process();
        let begun = Instant::now();
        let error = four_steps(&mut one).unwrap_err();
        assert_eq!((error.function, error.trouble), ("fmi2DoStep", Trouble::Hung), "{error}");
        assert!(error.reason.contains("no answer within 2s"), "{error}");
        let waited = begun.elapsed();
        assert!(waited >= Duration::from_secs(2) && waited < Duration::from_secs(30), "{waited:?}");
        assert!(!Path::new(&format!("/proc/{process}")).exists(), "fault {fault} still runs");
    }
    let error = start(&faulty(folder.path(), 16), Duration::from_secs(1)).err().unwrap().to_string();
    assert!(error.contains("one: fmi2Instantiate: no answer within 1s"), "{error}");
}

#[test]
fn one_that_dies_when_loaded_or_freed_takes_nobody_along() {
    let folder = tempfile::tempdir().unwrap();
    let error = start(&faulty(folder.path(), 19), Duration::from_secs(60)).err().unwrap().to_string();
    assert!(error.contains("its process died (signal 6"), "{error}");
    let mut one = start(&faulty(folder.path(), 17), Duration::from_secs(60)).unwrap();
    four_steps(&mut one).unwrap();
    one.terminate().unwrap();
    drop(one);
}

#[test]
fn an_fmu_that_reads_its_input_takes_no_calls_away() {
    let folder = tempfile::tempdir().unwrap();
    let mut one = start(&faulty(folder.path(), 10), Duration::from_secs(60)).unwrap();
    assert!((four_steps(&mut one).unwrap() - 0.4).abs() < 1e-15);
}

#[test]
fn a_process_that_it_leaves_behind_delays_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut one = start(&faulty(folder.path(), 18), Duration::from_secs(60)).unwrap();
    let begun = Instant::now();
    let error = four_steps(&mut one).unwrap_err();
    assert_eq!(error.trouble, Trouble::Died, "{error}");
    assert!(begun.elapsed() < Duration::from_secs(30));
}

#[test]
fn states_that_are_none_or_too_large_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (fault, said) in
        [(14, "fmi2SerializedFMUstateSize: asked for 4611686018427387904 bytes"), (15, "no state (NULL)")]
    {
        let path = faulty(folder.path(), fault);
        let in_process = Fmu::open(&path).unwrap().instantiate("one").unwrap();
        let isolated = start(&path, Duration::from_secs(60)).unwrap();
        let both: [Box<dyn Participant>; 2] = [Box::new(in_process), Box::new(isolated)];
        for mut one in both {
            let error = one.save_state().and_then(|state| one.serialise_state(state)).unwrap_err();
            assert!(error.to_string().contains(said), "{error}");
            // A refusal is no end: it still works.
            four_steps(one.as_mut()).unwrap();
        }
    }
}

/// In this process, writing a little past the room is noticed before its results are taken, and the instance is lost.
#[test]
fn the_guard_zones_work_without_isolation_too() {
    let folder = tempfile::tempdir().unwrap();
    for fault in [11, 12] {
        let mut one = Fmu::open(&faulty(folder.path(), fault)).unwrap().instantiate("one").unwrap();
        let error = four_steps(&mut one).unwrap_err().to_string();
        assert!(error.contains("fmi2GetReal: wrote outside the room for 1 values"), "{error}");
        assert!(error.contains("--isolate"), "{error}");
        let error = one.do_step(0, S).unwrap_err().to_string();
        assert!(error.contains("not called: the instance is lost"), "{error}");
    }
}

type Pair = [Box<dyn Participant>; 2];

fn two_in_a_row(pair: &mut Pair) -> (Vec<Vec<u64>>, Vec<u8>) {
    let connections = vec![
        Connection {
            factor: 0.7,
            offset: 0.1,
            ..Connection::new(Endpoint::new("a", "y"), Endpoint::new("b", "u"))
        },
        Connection::new(Endpoint::new("b", "active"), Endpoint::new("a", "enable")),
        Connection::new(Endpoint::new("a", "steps"), Endpoint::new("b", "mode")),
    ];
    let initial = vec![
        Setting::new("a", "u", Value::Real(0.3)),
        Setting::new("a", "x_start", Value::Real(0.1)),
        Setting::new("b", "x_start", Value::Real(0.1)),
    ];
    let plan = Plan { stop_ns: 600 * MS, step_ns: 100 * MS, connections, initial, ..Plan::default() };
    let mut memory = Memory::new(1, |_| true);
    run(pair, &plan, &mut memory).unwrap();
    let values = |column: &Column| memory.values(&column.participant, &column.variable).unwrap();
    let bits = memory.columns().iter().map(|c| values(c).iter().map(|v| v.to_bits()).collect()).collect();
    let state = pair[1].save_state().unwrap();
    let bytes = pair[1].serialise_state(state).unwrap();
    pair[1].forget_state(state);
    (bits, bytes)
}

#[test]
fn values_and_states_are_the_same_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = faulty(folder.path(), 0);
    let fmu = Fmu::open(&path).unwrap();
    let mut here: Pair = [Box::new(fmu.instantiate("a").unwrap()), Box::new(fmu.instantiate("b").unwrap())];
    let start = |name| Isolated::start(&path, name, &isolation(Duration::from_secs(60))).unwrap();
    let mut there: Pair = [Box::new(start("a")), Box::new(start("b"))];
    assert_eq!(here[0].variables(), there[0].variables());
    assert_eq!(here[0].identity(), there[0].identity());
    let (expected, bytes) = two_in_a_row(&mut here);
    let (found, found_bytes) = two_in_a_row(&mut there);
    assert_eq!((&expected, &bytes), (&found, &found_bytes));

    // A state of one is a state of the other.
    let state = there[0].deserialise_state(&bytes).unwrap();
    there[0].restore_state(state).unwrap();
    let mut y = ([0.0], [0.0]);
    there[0].get_real(&[2], &mut y.0).unwrap();
    here[1].get_real(&[2], &mut y.1).unwrap();
    assert_eq!(y.0[0].to_bits(), y.1[0].to_bits());
    there[0].forget_state(state);
    let error = there[0].restore_state(state).unwrap_err().to_string();
    assert!(error.contains("is not kept by this instance"), "{error}");
}

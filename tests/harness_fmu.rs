#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
//! A C FMU that nobody here wrote Rust for: loaded, run, provoked.

mod harness_support;

use bess_consensus::harness::logger::LogLine;
use bess_consensus::harness::*;
use harness_support::{MS, S, compile, fmu, integrator_xml, zip};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};

fn library() -> &'static [u8] {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    LIBRARY.get_or_init(|| compile(&[]))
}

fn integrator(folder: &Path) -> PathBuf {
    fmu(folder, &integrator_xml(), library())
}

fn started(slave: &mut Slave) {
    slave.setup(0, Some(S)).unwrap();
    slave.enter_initialization().unwrap();
    slave.exit_initialization().unwrap();
}

fn y(slave: &mut Slave) -> f64 {
    let mut value = [f64::NAN];
    slave.get_real(&[2], &mut value).unwrap();
    value[0]
}

fn refused(folder: &Path, xml: &str, library: &[u8]) -> String {
    Fmu::open(&fmu(folder, xml, library)).err().expect("refused").to_string()
}

#[test]
fn the_description_says_what_the_file_says() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = Fmu::open(&integrator(folder.path())).unwrap();
    let description = fmu.description();
    assert_eq!(description.model_name, "Integrator & co");
    assert_eq!((&*description.guid, &*description.model_identifier), ("{integrator-1}", "integrator"));
    assert_eq!(description.default_experiment.step_s, Some(0.1));
    assert_eq!(description.default_experiment.tolerance, None);
    assert_eq!(description.log_categories, ["logEvents", "logStatusError"]);
    let flags = &description.capabilities;
    assert!(flags.can_handle_variable_step && flags.can_serialise_state && !flags.needs_execution_tool);
    let kinds: Vec<(&str, Kind, Causality, Option<Value>)> =
        description.variables.iter().map(|v| (&*v.name, v.kind, v.causality, v.start)).collect();
    let expected = [
        ("u", Kind::Real, Causality::Input, Some(Value::Real(0.0))),
        ("y", Kind::Real, Causality::Output, None),
        ("x_start", Kind::Real, Causality::Parameter, Some(Value::Real(0.0))),
        ("steps", Kind::Integer, Causality::Output, None),
        ("mode", Kind::Integer, Causality::Input, Some(Value::Integer(3))),
        ("enable", Kind::Boolean, Causality::Input, Some(Value::Boolean(true))),
        ("active", Kind::Boolean, Causality::Output, None),
        ("note", Kind::String, Causality::Local, None),
    ];
    assert_eq!(kinds, expected);
    let y = description.variable("y").unwrap();
    assert_eq!((y.unit.as_deref(), y.description.as_deref()), (Some("m"), Some("the \"state\"")));
    assert_eq!(y.variability, Variability::Continuous);
    assert_eq!(description.variable("steps").unwrap().variability, Variability::Discrete);
}

#[test]
fn two_instances_integrate_each_for_itself() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = Fmu::open(&integrator(folder.path())).unwrap();
    let mut slaves = [fmu.instantiate("same").unwrap(), fmu.instantiate("same").unwrap()];
    drop(fmu);
    for (slave, u) in slaves.iter_mut().zip([1.0, -0.5]) {
        slave.set_real(&[3], &[10.0]).unwrap();
        started(slave);
        slave.set_real(&[1], &[u]).unwrap();
    }
    for k in 0..8 {
        for slave in &mut slaves {
            slave.do_step(k * S / 4, S / 4).unwrap();
        }
    }
    assert_eq!(slaves.each_mut().map(y), [12.0, 9.0]);
    let mut steps = [0];
    slaves[0].get_integer(&[11], &mut steps).unwrap();
    assert_eq!(steps, [8]);
}

#[test]
fn two_fmus_run_under_the_master_with_every_type() {
    // The first integrates 1 from 0; its y feeds the second, whose input is cut by `enable` at 0.55 s.
    let folder = tempfile::tempdir().unwrap();
    let fmu = Fmu::open(&integrator(folder.path())).unwrap();
    let mut participants: Vec<Box<dyn Participant>> =
        vec![Box::new(fmu.instantiate("first").unwrap()), Box::new(fmu.instantiate("second").unwrap())];
    let connections = vec![
        Connection::new(Endpoint::new("first", "y"), Endpoint::new("second", "u")),
        Connection::new(Endpoint::new("first", "steps"), Endpoint::new("second", "mode")),
    ];
    let events =
        vec![Event { at_ns: 550 * MS, sets: vec![Setting::new("second", "enable", Value::Boolean(false))] }];
    let initial = vec![
        Setting::new("first", "u", Value::Real(1.0)),
        Setting::new("second", "x_start", Value::Real(5.0)),
    ];
    let plan = Plan { stop_ns: S, step_ns: 100 * MS, connections, initial, events, ..Plan::default() };
    let mut memory = Memory::new(1, |_| true);
    // mode = 7 is refused by the FMU, so the seventh step must fail; before it all is well.
    let error = run(&mut participants, &plan, &mut memory).unwrap_err().to_string();
    assert_eq!(
        error,
        "second at t = 0.6 s: fmi2SetInteger: returned fmi2Error\n  [logStatusError] mode = 7 is refused"
    );
    let expected = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.55];
    for (found, expected) in memory.values("first", "y").unwrap().iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
    // Rectangles of the first one's y, each 0.1 wide: 5 + 0.1 (0 + 0.1 + 0.2 + 0.3 + 0.4), then 0.05 x 0.5.
    let second = memory.values("second", "y").unwrap();
    assert!((second[5] - 5.1).abs() < 1e-14 && (second[6] - 5.125).abs() < 1e-14, "{second:?}");
    assert_eq!(memory.values("first", "active").unwrap(), [0., 1., 1., 1., 1., 1., 1.]);
    assert_eq!(memory.values("second", "enable").unwrap(), [1., 1., 1., 1., 1., 1., 0.]);
}

#[test]
fn every_status_becomes_an_error_with_the_last_log_lines_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = Fmu::open(&integrator(folder.path())).unwrap();
    let step = |u: f64| {
        let mut slave = fmu.instantiate("one").unwrap();
        started(&mut slave);
        slave.set_real(&[1], &[u]).unwrap();
        (slave.do_step(2 * S, S), slave)
    };
    let text = |u| step(u).0.unwrap_err().to_string();
    assert_eq!(text(-1.0), "fmi2DoStep: returned fmi2Error\n  [logStatusError] u = -1 at t = 2 is refused");
    assert_eq!(text(-2.0), "fmi2DoStep: returned fmi2Discard");
    assert_eq!(text(-4.0), "fmi2DoStep: returned 17, which is no fmi2Status");
    assert!(step(-5.0).0.is_ok());
    let (error, mut slave) = step(-3.0);
    assert_eq!(error.unwrap_err().to_string(), "fmi2DoStep: returned fmi2Fatal; the instance is lost");
    let error = slave.get_real(&[2], &mut [0.0]).unwrap_err().to_string();
    assert_eq!(error, "fmi2GetReal: not called: the instance is lost after fmi2Fatal");

    let mut slave = fmu.instantiate("one").unwrap();
    let error = slave.get_real(&[2, 99], &mut [0.0; 2]).unwrap_err().to_string();
    assert_eq!(error, "fmi2GetReal: returned fmi2Error\n  [logStatusError] value reference 99 is unknown");
    let error = slave.get_real(&[2, 3], &mut [0.0]).unwrap_err().to_string();
    assert_eq!(error, "fmi2GetReal: not called: 1 values for 2 value references");
    let error = slave.do_step(0, S).unwrap_err().to_string();
    assert_eq!(error, "fmi2DoStep: not called: the instance is in Instantiated; expected Step");
}

#[test]
fn log_lines_arrive_as_they_come_and_an_instance_is_terminated_and_freed_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("with space");
    std::fs::create_dir(&path).unwrap();
    let fmu = Fmu::open(&integrator(&path)).unwrap();
    let lines = Arc::new(Mutex::new(Vec::new()));
    let target = Arc::clone(&lines);
    let receive = Arc::new(move |line: &LogLine| target.lock().unwrap().push(line.clone()));
    let mut slave = fmu.instantiate_with("loud", true, Some(receive)).unwrap();
    started(&mut slave);
    slave.terminate().unwrap();
    slave.terminate().unwrap();
    drop(slave);
    let lines: Vec<LogLine> = lines.lock().unwrap().clone();
    assert!(
        lines.iter().all(|line| (&*line.instance, &*line.category, line.status) == ("loud", "logEvents", 0))
    );
    let messages: Vec<&str> = lines.iter().map(|line| &*line.message).collect();
    let [first, "terminated", last] = messages[..] else { panic!("{messages:?}") };
    assert!(first.contains("resources at file:///") && first.ends_with("/resources"), "{first}");
    assert!(last.starts_with("freed, "), "{last}");
}

#[test]
fn states_roll_back_travel_and_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = Fmu::open(&integrator(folder.path())).unwrap();
    let mut slave = fmu.instantiate("one").unwrap();
    started(&mut slave);
    slave.set_real(&[1], &[1.0]).unwrap();
    slave.do_step(0, S).unwrap();
    let state = slave.save_state().unwrap();
    let other_state = slave.save_state().unwrap();
    slave.do_step(S, S).unwrap();
    assert_eq!(y(&mut slave), 2.0);
    for _ in 0..2 {
        slave.restore_state(state).unwrap();
        assert_eq!(y(&mut slave), 1.0);
        slave.do_step(S, S).unwrap();
    }
    let bytes = slave.serialise_state(state).unwrap();
    let mut other = fmu.instantiate("two").unwrap();
    started(&mut other);
    let foreign = other.deserialise_state(&bytes).unwrap();
    other.restore_state(foreign).unwrap();
    assert_eq!(y(&mut other), 1.0);
    let error = other.deserialise_state(&bytes[1..]).unwrap_err().to_string();
    assert!(error.contains("returned fmi2Error") && error.contains("bytes; expected"), "{error}");
    slave.forget_state(state);
    slave.forget_state(state);
    let error = slave.restore_state(state).unwrap_err().to_string();
    assert_eq!(error, "fmi2SetFMUstate: not called: state 0 is not kept by this instance");
    slave.restore_state(other_state).unwrap();
    slave.reset().unwrap();
    started(&mut slave);
    assert_eq!(y(&mut slave), 0.0);

    let without = integrator_xml().replace("canGetAndSetFMUstate=\"true\"", "");
    let fmu = Fmu::open(&harness_support::fmu(folder.path(), &without, library())).unwrap();
    let error = fmu.instantiate("one").unwrap().save_state().unwrap_err().to_string();
    assert_eq!(error, "fmi2GetFMUstate: not called: the FMU does not declare canGetAndSetFMUstate");
}

#[test]
fn a_wrong_guid_is_refused_in_the_fmus_own_words() {
    let folder = tempfile::tempdir().unwrap();
    let xml = integrator_xml().replace("{integrator-1}", "{other}");
    let fmu = Fmu::open(&fmu(folder.path(), &xml, library())).unwrap();
    let error = fmu.instantiate("one").err().unwrap().to_string();
    assert!(error.starts_with("one: fmi2Instantiate: returned NULL"), "{error}");
    assert!(error.ends_with("[logStatusError] guid is {other}; expected {integrator-1}"), "{error}");
}

#[test]
fn an_fmu_for_one_instance_gets_one_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let xml = integrator_xml()
        .replace("<CoSimulation ", "<CoSimulation canBeInstantiatedOnlyOncePerProcess=\"true\" ");
    let fmu = Fmu::open(&fmu(folder.path(), &xml, library())).unwrap();
    let first = fmu.instantiate("one").unwrap();
    assert!(
        fmu.instantiate("two").err().unwrap().to_string().contains("canBeInstantiatedOnlyOncePerProcess")
    );
    drop(first);
    assert!(fmu.instantiate("two").is_ok());
}

#[test]
fn libraries_that_are_missing_incomplete_or_foreign_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let error = refused(folder.path(), &integrator_xml(), b"no ELF");
    assert!(
        error.contains("integrator.so: is no library at all; expected an ELF library for x86-64"),
        "{error}"
    );
    let error = refused(folder.path(), &integrator_xml(), &compile(&["-DWITHOUT_STATE"]));
    assert!(error.contains("misses fmi2GetFMUstate, fmi2SetFMUstate; expected all 34"), "{error}");
    let error = refused(folder.path(), &integrator_xml(), &compile(&["-DVERSION=\"1.0\""]));
    assert!(error.contains("fmi2GetVersion says \"1.0\"; expected \"2.0\""), "{error}");
    let error = refused(folder.path(), &integrator_xml(), &compile(&["-DTYPES=\"other\""]));
    assert!(error.contains("fmi2GetTypesPlatform says \"other\""), "{error}");

    let path = folder.path().join("foreign.fmu");
    let xml = integrator_xml();
    zip(
        &path,
        &[
            ("modelDescription.xml", xml.as_bytes()),
            ("binaries/win64/integrator.dll", b""),
            ("binaries/darwin64/integrator.dylib", b""),
        ],
    );
    let error = Fmu::open(&path).err().unwrap().to_string();
    assert!(error.contains("binaries/linux64/integrator.so is not there"), "{error}");
    assert!(error.contains("the FMU holds darwin64, win64"), "{error}");
    zip(&path, &[("resources/x", b"")]);
    let error = Fmu::open(&path).err().unwrap().to_string();
    assert!(error.contains("modelDescription.xml"), "{error}");
}

/// The loader of the system crashes on some of these; none is given to it.
#[test]
fn libraries_of_other_machines_and_halves_of_libraries_are_never_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let whole = library();
    let changed = |at: usize, bytes: &[u8]| {
        let mut library = whole.to_vec();
        library[at..at + bytes.len()].copy_from_slice(bytes);
        library
    };
    // Offsets of the ELF header: class 4, type 16, machine 18, program headers 32.
    let table: [(Vec<u8>, &str); 10] = [
        (Vec::new(), "an empty file"),
        (b"MZ".iter().copied().chain([0; 400]).collect(), "no library at all"),
        (b"\xcf\xfa\xed\xfe".iter().copied().chain([0; 400]).collect(), "a macOS library"),
        (changed(4, &[1]), "a 32-bit ELF file"),
        (changed(16, &[2, 0]), "an ELF file that is no shared library"),
        (changed(18, &[183, 0]), "an ELF library for aarch64"),
        (changed(18, &[243, 0]), "an ELF library for another machine"),
        (changed(32, &u64::MAX.to_le_bytes()), "cut short"),
        (whole[..whole.len() / 2].to_vec(), "cut short"),
        (whole[..100].to_vec(), "cut short"),
    ];
    for (library, found) in table {
        let error = refused(folder.path(), &integrator_xml(), &library);
        assert!(
            error.contains(found) && error.contains("; expected an ELF library for x86-64"),
            "{found}: {error}"
        );
    }
}

#[test]
fn a_folder_vanishes_with_its_last_user() {
    let folder = tempfile::tempdir().unwrap();
    let path = integrator(folder.path());
    let unpacked = archive::unpack(&path, Limits::default()).unwrap();
    let place = unpacked.path().to_path_buf();
    assert_eq!(std::fs::read(place.join("resources/data.txt")).unwrap(), b"1 2 3\n");
    drop(unpacked);
    assert!(!place.exists());
}

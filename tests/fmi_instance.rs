//! The safe core: values, steps, time, reset and states, as an in-process master drives them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

mod fmi_mock;

use bess_consensus::fmi::{
    Category, Error, Function, Instance, Interface, Logger, ModelError, Snapshot, State, Type, lookup::Value,
};
use fmi_mock::resources::Resources;
use fmi_mock::{Mock, REFRESH_FAILS, STEP_FAILS, STEP_LOGS};
use proptest::prelude::*;
use std::fmt;
use std::sync::{Arc, Mutex};

fn mock(n: usize) -> Instance<Mock> {
    Instance::from_model("mock", Mock::with(n), Interface::Structured, Logger::silent()).unwrap()
}

fn started(n: usize) -> Instance<Mock> {
    let mut instance = mock(n);
    instance.setup_experiment(0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance
}

fn reference(instance: &Instance<Mock>, name: &str) -> u32 {
    instance.registry().reference(name).unwrap_or_else(|| panic!("{name}"))
}

fn real(instance: &mut Instance<Mock>, name: &str) -> f64 {
    let mut value = [f64::NAN];
    let reference = reference(instance, name);
    instance.get_real(&[reference], &mut value).unwrap();
    value[0]
}

fn integer(instance: &mut Instance<Mock>, name: &str) -> i32 {
    let mut value = [-1];
    let reference = reference(instance, name);
    instance.get_integer(&[reference], &mut value).unwrap();
    value[0]
}

fn set(instance: &mut Instance<Mock>, name: &str, value: f64) -> Result<(), Error> {
    let reference = reference(instance, name);
    instance.set_real(&[reference], &[value])
}

fn set_fault(instance: &mut Instance<Mock>, fault: i32) {
    let reference = reference(instance, "fault");
    instance.set_integer(&[reference], &[fault]).unwrap();
}

/// Everything that can be observed, down to the bits.
fn bytes(instance: &Instance<Mock>) -> Vec<u8> {
    instance.serialize(&instance.snapshot().unwrap()).unwrap()
}

#[test]
fn value_references_are_positions_and_names_lead_back() {
    let instance = mock(3);
    let registry = instance.registry();
    let names: Vec<String> = (1..=registry.len() as u32).map(|r| registry.name(r).unwrap()).collect();
    let expected = "u[1] u[2] u[3] x[1] x[2] x[3] y[1] y[2] y[3] total gain tau x_start[1] x_start[2] \
                    x_start[3] mode fault enable steps settled";
    assert_eq!(names.join(" "), expected);
    for (position, name) in names.iter().enumerate() {
        assert_eq!(registry.reference(name), Some(position as u32 + 1), "{name}");
    }
    for unknown in ["u", "u[0]", "u[4]", "u[01]", "u[+1]", "u[1", "total[1]", "nothing", "", "u_1"] {
        assert_eq!(registry.reference(unknown), None, "{unknown}");
    }
    assert!(
        registry.locate(0).is_none() && registry.locate(21).is_none() && registry.locate(u32::MAX).is_none()
    );
}

#[test]
fn the_response_is_the_closed_form_for_any_sequence_of_steps() {
    let mut instance = started(3);
    let mut t = 0.0;
    for h in [0.1, 0.01, 0.5, 1e-9, 0.37, 2.0] {
        instance.do_step(t, h).unwrap();
        t += h;
        for i in 1..=3 {
            let goal = 2.0 * f64::from(i);
            let exact = goal + (0.25 - goal) * f64::exp(-t / 0.5);
            let found = real(&mut instance, &format!("x[{i}]"));
            assert!((found - exact).abs() < 1e-12, "x[{i}] at {t}: {found} against {exact}");
        }
    }
}

#[test]
fn values_can_be_set_and_read_right_after_instantiation() {
    let mut instance = mock(2);
    set(&mut instance, "u[2]", 7.0).unwrap();
    set(&mut instance, "x_start[2]", 3.0).unwrap();
    assert_eq!(real(&mut instance, "u[2]"), 7.0);
    assert_eq!(real(&mut instance, "y[2]"), 10.0, "outputs follow even before initialization mode");
    instance.enter_initialization_mode().unwrap();
    set(&mut instance, "x_start[2]", 4.0).unwrap();
    assert_eq!(real(&mut instance, "y[2]"), 11.0);
    instance.exit_initialization_mode().unwrap();
    set(&mut instance, "u[2]", 8.0).unwrap();
    assert_eq!(real(&mut instance, "y[2]"), 12.0, "get after set without a step");
    assert_eq!(real(&mut instance, "total"), 9.0);
}

#[test]
fn refused_sets_name_variable_value_and_expectation_and_change_nothing() {
    let mut instance = started(2);
    let all =
        |i: &Instance<Mock>, names: &[&str]| names.iter().map(|n| reference(i, n)).collect::<Vec<u32>>();
    let before = bytes(&instance);
    for (names, values, words) in [
        (&["u[1]", "u[2]"][..], &[5.0, f64::NAN][..], &["fmi2SetReal", "u[2]", "NaN", "finite"][..]),
        (&["u[1]", "u[2]"], &[5.0, f64::INFINITY], &["u[2]", "inf"]),
        (&["u[1]", "gain"], &[5.0, 0.0], &["gain", "= 0", "> 0"]),
        (&["u[1]", "gain"], &[5.0, -1.0], &["gain", "= -1", "> 0"]),
        (&["u[1]", "x[1]"], &[5.0, 1.0], &["x[1]", "output"]),
        (&["u[1]", "tau"], &[5.0, 1.0], &["tau", "fixed parameter", "before initialization ends"]),
        (&["u[1]", "mode"], &[5.0, 1.0], &["mode", "Integer", "Real"]),
        (&["u[1]", "u[2]"], &[5.0], &["1 values", "2 value references"]),
    ] {
        let references = all(&instance, names);
        let message = instance.set_real(&references, values).expect_err(names[1]).to_string();
        for word in words {
            assert!(message.contains(word), "{message:?} lacks {word:?}");
        }
        assert!(!message.contains('\n'));
        assert_eq!(bytes(&instance), before, "{message}");
    }
    let u = reference(&instance, "u[1]");
    for unknown in [0, 17, u32::MAX] {
        let message = instance.set_real(&[u, unknown], &[5.0, 5.0]).unwrap_err().to_string();
        assert!(message.contains(&unknown.to_string()) && message.contains("1 to 16"), "{message}");
        let mut values = [1.5, 2.5];
        assert!(instance.get_real(&[u, unknown], &mut values).is_err());
        assert_eq!(values, [1.5, 2.5], "a refused get writes nothing");
    }
    let (mode, enable) = (reference(&instance, "mode"), reference(&instance, "enable"));
    for value in [0, 4, i32::MIN] {
        let message = instance.set_integer(&[mode], &[value]).unwrap_err().to_string();
        assert!(message.contains("mode") && message.contains(">= 1 and <= 3"), "{message}");
    }
    let error = instance.set_boolean(&[mode], &[true]).unwrap_err();
    let expected = Error::WrongType {
        function: Function::SetBoolean,
        name: "mode".into(),
        found: Type::Integer,
        expected: Type::Boolean,
    };
    assert_eq!(error, expected);
    assert!(instance.get_integer(&[enable], &mut [0]).is_err());
    assert_eq!(bytes(&instance), before);
}

#[test]
fn the_call_order_table_is_obeyed_whole() {
    type Call = fn(&mut Instance<Mock>) -> Result<(), Error>;
    let calls: &[(Function, Call)] = &[
        (Function::SetupExperiment, |i| i.setup_experiment(0.0, Some(1.0))),
        (Function::EnterInitializationMode, |i| i.enter_initialization_mode()),
        (Function::ExitInitializationMode, |i| i.exit_initialization_mode()),
        (Function::Terminate, |i| i.terminate()),
        (Function::Reset, |i| i.reset()),
        (Function::GetReal, |i| i.get_real(&[1], &mut [0.0])),
        (Function::GetInteger, |i| i.get_integer(&[], &mut [])),
        (Function::GetBoolean, |i| i.get_boolean::<bool>(&[], &mut [])),
        (Function::SetReal, |i| i.set_real(&[1], &[1.0])),
        (Function::SetInteger, |i| i.set_integer(&[], &[])),
        (Function::SetBoolean, |i| i.set_boolean(&[], &[])),
        (Function::DoStep, |i| i.do_step(i.time_s(), 0.1)),
        (Function::GetFmuState, |i| i.snapshot().map(|_| ())),
        (Function::SetFmuState, |i| {
            let snapshot = started(1).snapshot()?;
            i.restore(&snapshot)
        }),
        (Function::SerializeFmuState, |i| {
            let snapshot = started(1).snapshot()?;
            i.serialize(&snapshot).map(|_| ())
        }),
        (Function::DeSerializeFmuState, |i| {
            let other = started(1);
            i.deserialize(&other.serialize(&other.snapshot()?)?).map(|_| ())
        }),
    ];
    for state in State::ALL {
        for (function, call) in calls {
            let mut instance = mock(1);
            if matches!(state, State::Initialization | State::Step | State::Terminated) {
                instance.enter_initialization_mode().unwrap();
            }
            if matches!(state, State::Step | State::Terminated) {
                instance.exit_initialization_mode().unwrap();
            }
            if state == State::Terminated {
                instance.terminate().unwrap();
            }
            let before = (state != State::Fatal).then(|| bytes(&instance));
            if state == State::Fatal {
                instance.poison();
            }
            assert_eq!(instance.state(), state);
            match call(&mut instance) {
                Ok(()) => assert!(function.is_allowed(state), "{function} went through in {state}"),
                Err(Error::CallOrder { function: named, state: at }) => {
                    assert_eq!((named, at), (*function, state));
                    assert!(!function.is_allowed(state), "{function} was refused in {state}");
                    assert_eq!(Some(bytes(&instance)), before, "{function} in {state}");
                }
                Err(Error::Poisoned { .. }) => assert_eq!(state, State::Fatal),
                Err(other) => panic!("{function} in {state}: {other}"),
            }
        }
    }
    let message = mock(1).do_step(0.0, 0.1).unwrap_err().to_string();
    assert_eq!(message, "fmi2DoStep: not allowed in state \"instantiated\"; expected one of: step mode");
}

#[test]
fn communication_points_heal_or_are_refused_with_both_times() {
    let mut instance = mock(1);
    instance.setup_experiment(-3.5, Some(f64::NAN)).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    assert_eq!(instance.time_s(), -3.5);
    instance.do_step(-3.5, 0.1).unwrap();
    instance.do_step(-3.4000000000000004, 0.099_999_999_999_999_78).unwrap();
    instance.do_step(-3.3 + 0.9e-7, 0.1).unwrap();
    assert_eq!(instance.time_ns(), -3_200_000_000);
    instance.do_step(-3.2 - 0.9e-7, 0.1).unwrap();
    assert_eq!(instance.time_ns(), -3_100_000_000);
    assert!(instance.do_step(-3.1 + 1.1e-7, 0.1).is_err(), "more than a millionth of the step and a ns");
    let before = bytes(&instance);
    let message = instance.do_step(-3.0, 0.1).unwrap_err().to_string();
    assert!(message.contains("-3.0 s") && message.contains("-3.1 s"), "{message}");
    for (t, h) in [
        (-3.1, -0.1),
        (-3.1, f64::NAN),
        (-3.1, f64::INFINITY),
        (f64::NAN, 0.1),
        (f64::INFINITY, 0.1),
        (-3.1, 1e11),
        (-3.1, -f64::MIN_POSITIVE),
        (f64::MAX, f64::MAX),
        (-f64::MAX, 0.1),
    ] {
        let error = instance.do_step(t, h).expect_err(&format!("{t} {h}"));
        assert!(error.to_string().starts_with("fmi2DoStep"), "{error}");
    }
    instance.do_step(-3.1, 0.0).unwrap();
    assert_eq!(bytes(&instance), before, "refused steps and steps of no length change nothing");
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        assert!(mock(1).setup_experiment(bad, None).is_err());
    }
}

#[test]
fn ten_hours_of_summed_steps_count_exactly() {
    let mut instance = started(1);
    let (mut t, h) = (0.0, 0.1);
    for _ in 0..360_000 {
        instance.do_step(t, h).unwrap();
        t += h;
    }
    assert_ne!(t, 36_000.0, "the master's own clock is off");
    assert_eq!(instance.time_s(), 36_000.0);
    assert_eq!(instance.model().0.nanoseconds, 36_000_000_000_000);
}

#[test]
fn a_failed_step_leaves_the_state_and_the_instance_usable() {
    let mut instance = started(2);
    instance.do_step(0.0, 0.1).unwrap();
    set_fault(&mut instance, STEP_FAILS);
    let before = bytes(&instance);
    let error = instance.do_step(0.1, 0.1).unwrap_err();
    let source = ModelError::new("the mock was told to fail in step");
    assert_eq!(error, Error::Model { function: Function::DoStep, source });
    assert_eq!(bytes(&instance), before);
    set_fault(&mut instance, REFRESH_FAILS);
    let reference = reference(&instance, "y[1]");
    assert!(instance.get_real(&[reference], &mut [0.0]).is_err());
    assert_eq!(real(&mut instance, "u[1]"), 1.0, "inputs can be read back even so");
    set_fault(&mut instance, 0);
    instance.do_step(0.1, 0.1).unwrap();
    assert_eq!(integer(&mut instance, "steps"), 2);
}

/// A run with everything in it; returns the bits of all outputs along the way.
fn trajectory(instance: &mut Instance<Mock>) -> Vec<u64> {
    let references: Vec<u32> = (1..=10).collect();
    let mut bits = Vec::new();
    set(instance, "x_start[1]", 0.125).unwrap();
    instance.setup_experiment(5.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    for k in 0..50 {
        let mut values = [0.0; 10];
        set(instance, "u[2]", f64::from(k) * 0.3).unwrap();
        set(instance, "gain", 1.0 + f64::from(k)).unwrap();
        instance.do_step(5.0 + f64::from(k) / 7.0, 1.0 / 7.0).unwrap();
        instance.get_real(&references, &mut values).unwrap();
        bits.extend(values.map(f64::to_bits));
    }
    bits
}

#[test]
fn reset_gives_the_state_after_instantiation_and_an_identical_run() {
    let mut instance = mock(3);
    let born = bytes(&instance);
    let first = trajectory(&mut instance);
    instance.terminate().unwrap();
    instance.terminate().unwrap();
    instance.reset().unwrap();
    assert_eq!(bytes(&instance), born);
    assert_eq!(trajectory(&mut instance), first);
    assert_eq!(trajectory(&mut mock(3)), first);
}

#[test]
fn roll_back_and_step_again_is_bit_identical_across_instances() {
    let mut instance = started(3);
    instance.do_step(0.0, 0.1).unwrap();
    set(&mut instance, "u[1]", 9.0).unwrap();
    let early = instance.snapshot().unwrap();
    instance.do_step(0.1, 0.3).unwrap();
    let late = bytes(&instance);
    assert_ne!(instance.serialize(&early).unwrap(), late);
    instance.restore(&early).unwrap();
    assert_eq!(instance.time_ns(), 100_000_000);
    instance.do_step(0.1, 0.3).unwrap();
    assert_eq!(bytes(&instance), late);

    let mut other = mock(3);
    let copy: Snapshot<Mock> = other.deserialize(&instance.serialize(&early).unwrap()).unwrap();
    other.restore(&copy).unwrap();
    assert_eq!(other.state(), State::Step);
    other.do_step(0.1, 0.3).unwrap();
    assert_eq!(bytes(&other), late);
}

#[test]
fn bytes_of_another_fmu_or_damaged_ones_are_refused() {
    let instance = started(3);
    let good = bytes(&instance);
    let stranger = started(4);
    let message = instance.deserialize(&bytes(&stranger)).err().unwrap().to_string();
    assert!(message.contains(&stranger.guid().to_string()) && message.contains(&instance.guid().to_string()));
    let mut mutable = mock(3);
    assert!(mutable.restore(&stranger.snapshot().unwrap()).is_err());
    for length in 0..good.len() {
        assert!(instance.deserialize(&good[..length]).is_err(), "truncated to {length}");
    }
    for position in 0..good.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut bad = good.clone();
            bad[position] ^= flip;
            assert!(instance.deserialize(&bad).is_err(), "byte {position} with {flip:#x}");
        }
    }
    let padded: Vec<u8> = good.iter().copied().chain([0; 9]).collect();
    assert!(instance.deserialize(&padded).is_err(), "bytes left over");
    let snapshot = instance.snapshot().unwrap();
    let mut short = vec![0; good.len() - 1];
    assert!(snapshot.serialize_into(&mut short).is_err());
    assert_eq!(snapshot.serialized_size().unwrap(), good.len());
}

#[test]
fn the_portable_interface_is_all_real_under_flat_names() {
    let mut instance =
        Instance::from_model("mock", Mock::with(2), Interface::Portable, Logger::silent()).unwrap();
    assert_ne!(instance.guid(), mock(2).guid());
    let registry = instance.registry();
    let names: Vec<String> = (1..=4).map(|r| registry.name(r).unwrap()).collect();
    assert_eq!(names.join(" "), "u_1 u_2 x_1 x_2");
    assert_eq!(registry.reference("x_start_2"), Some(11));
    assert_eq!(registry.reference("u[1]"), None);
    let (mode, enable) = (reference(&instance, "mode"), reference(&instance, "enable"));
    assert!(instance.get_boolean(&[enable], &mut [false]).is_err());
    assert!(instance.set_integer(&[mode], &[2]).is_err());
    instance.set_real(&[mode, enable], &[2.4, 0.49]).unwrap();
    assert_eq!((instance.model().0.mode, instance.model().0.enable), (2, false));
    instance.set_real(&[mode, enable], &[2.5, 0.5]).unwrap();
    assert_eq!((instance.model().0.mode, instance.model().0.enable), (3, true));
    let mut values = [0.0; 2];
    instance.get_real(&[mode, enable], &mut values).unwrap();
    assert_eq!(values, [3.0, 1.0]);
    for bad in [3.5, 0.49, 1e300, f64::NAN] {
        assert!(instance.set_real(&[mode], &[bad]).is_err(), "{bad}");
    }
    assert!(instance.set_real(&[enable], &[f64::INFINITY]).is_err());
    let (group, index) = instance.registry().locate(enable).unwrap();
    assert_eq!(group.value(instance.model(), index, Interface::Portable), Value::Real(1.0));
}

#[test]
fn the_guid_follows_names_and_start_values_and_nothing_else() {
    let guid = |model: &Mock| {
        Instance::from_model("", model.clone(), Interface::Structured, Logger::silent()).unwrap().guid()
    };
    let base = Mock::with(2);
    let mut stepped = base.clone();
    stepped.0.x[0] = 5.0;
    assert_eq!(guid(&base), guid(&stepped), "outputs have no start value");
    let mut other_start = base.clone();
    other_start.0.u[1] = 2.0_f64.next_up();
    let mut other_switch = base.clone();
    other_switch.0.enable = false;
    let mut other_mode = base.clone();
    other_mode.0.mode = 2;
    let guids =
        [guid(&base), guid(&other_start), guid(&other_switch), guid(&other_mode), guid(&Mock::with(3))];
    for (i, a) in guids.iter().enumerate() {
        assert!(guids[..i].iter().all(|b| b != a));
    }
}

#[test]
fn model_lines_reach_the_sink_with_their_category() {
    let lines = Arc::new(Mutex::new(Vec::new()));
    let sink = Arc::clone(&lines);
    let mut instance = started(1);
    *instance.logger() = Logger::new(
        move |category, message: fmt::Arguments<'_>| {
            sink.lock().unwrap().push((category, message.to_string()))
        },
        true,
    );
    set_fault(&mut instance, STEP_LOGS);
    instance.do_step(0.0, 0.5).unwrap();
    let lines = lines.lock().unwrap();
    let expected = [
        (Category::Events, "an event at 0 s, 100%s\nsure".to_owned()),
        (Category::Warning, "a warning".to_owned()),
    ];
    assert_eq!(*lines, expected);
}

#[test]
fn loading_reads_the_folder_and_says_what_is_missing() {
    let resources = Resources::new(5);
    let mut instance = Instance::<Mock>::new("five", &resources.path()).unwrap();
    assert_eq!(instance.name(), "five");
    assert_eq!(real(&mut instance, "u[5]"), 5.0);
    let message = Instance::<Mock>::new("none", &resources.path().join("none")).err().unwrap().to_string();
    assert!(message.contains("fmi2Instantiate") && message.contains("n.txt"), "{message}");
}

fn assert_send<T: Send>(_: &T) {}

#[test]
fn an_instance_may_move_between_threads() {
    assert_send(&mock(1));
}

proptest! {
    #[test]
    fn noise_is_refused_and_never_panics(noise in prop::collection::vec(any::<u8>(), 0..200)) {
        let instance = started(1);
        prop_assert!(instance.deserialize(&noise).is_err());
    }

    #[test]
    fn real_values_survive_to_the_bit(values in prop::collection::vec(-1e300_f64..1e300, 3)) {
        let mut instance = mock(3);
        instance.set_real(&[1, 2, 3], &values).unwrap();
        let mut back = [0.0; 3];
        instance.get_real(&[1, 2, 3], &mut back).unwrap();
        prop_assert_eq!(back.map(f64::to_bits).to_vec(), values.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
    }
}

//! The safe core as an in-process master drives it: variables, values, call order, what an instance is. Time is
//! in `fmi_instance_time.rs`, reset and states are in `fmi_instance_states.rs`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

mod fmi_mock;
#[path = "fmi_mock/instances.rs"]
mod instances;

use bess_consensus::fmi::{
    Category, Error, Function, Instance, Interface, Logger, State, Type, lookup::Value,
};
use fmi_mock::resources::Resources;
use fmi_mock::{Mock, STEP_LOGS};
use instances::*;
use proptest::prelude::*;
use std::fmt;
use std::sync::{Arc, Mutex};

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

/// Arrays that come again are known; what a call may do is asked every time.
#[test]
fn an_array_that_comes_again_is_checked_again() {
    let mut instance = mock(2);
    let all =
        |names: &[&str], i: &Instance<Mock>| names.iter().map(|n| reference(i, n)).collect::<Vec<u32>>();
    let (inputs, fixed) = (all(&["u[1]", "u[2]", "gain"], &instance), all(&["u[1]", "tau"], &instance));
    let read = all(&["y[1]", "y[2]", "total"], &instance);
    let mut values = [0.0; 3];
    for k in 1..=3 {
        let u = f64::from(k);
        instance.set_real(&inputs, &[u, 2.0 * u, 1.0]).unwrap();
        instance.set_real(&fixed, &[u, 0.5]).unwrap();
        instance.get_real(&read, &mut values).unwrap();
        let total = real(&mut instance, "total");
        assert_eq!(values[2], total);
        assert_eq!(values[1] - values[0], u, "y moves with u");
    }
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    for _ in 0..2 {
        instance.set_real(&inputs, &[1.0, 2.0, 1.0]).unwrap();
        let before = bytes(&instance);
        for (references, values, words) in [
            (&inputs, &[5.0, f64::NAN, 1.0][..], ["u[2]", "NaN"]),
            (&inputs, &[5.0, 6.0, 0.0], ["gain", "> 0"]),
            (&inputs, &[5.0, 6.0], ["2 values", "3 value references"]),
            (&fixed, &[5.0, 1.0], ["tau", "fixed parameter"]),
        ] {
            let message = instance.set_real(references, values).expect_err(words[0]).to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
            assert_eq!(bytes(&instance), before, "{message}");
        }
        assert!(instance.get_real(&read, &mut [0.0; 2]).is_err());
        instance.do_step(instance.time_s(), 0.1).unwrap();
    }
    instance.terminate().unwrap();
    assert!(instance.set_real(&inputs, &[1.0, 2.0, 1.0]).is_err());
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
        (&["u[1]", "u[2]"], &[5.0, 1e31], &["u[2]", "1e31", "at most 1e30"]),
        (&["u[1]", "gain"], &[5.0, 5e-324], &["gain", "5e-324", "at least 1e-30"]),
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
    fn real_values_survive_to_the_bit(values in prop::collection::vec(-1e30_f64..1e30, 3)) {
        let mut instance = mock(3);
        instance.set_real(&[1, 2, 3], &values).unwrap();
        let mut back = [0.0; 3];
        instance.get_real(&[1, 2, 3], &mut back).unwrap();
        prop_assert_eq!(back.map(f64::to_bits).to_vec(), values.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
    }
}

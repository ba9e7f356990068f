//! Configuration mode and FMU states of FMI 3.0 from C's side, over a mock: sizes change, models are built anew, and
//! whatever is refused leaves the state as it was to the bit.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![allow(clippy::undocumented_unsafe_blocks, clippy::multiple_unsafe_ops_per_block)]

#[path = "fmi_mock/component3.rs"]
mod component3;
mod fmi_mock;
#[path = "fmi_mock/importer3.rs"]
mod importer3;

use bess_consensus::fmi::three::bindings::*;
use component3::*;
use fmi_mock::{BIAS_FAILS, BIAS_PANICS};
use importer3::*;
use std::ptr::{null, null_mut};

#[test]
fn another_n_makes_longer_arrays_and_keeps_what_has_kept_its_length() {
    let fmu = Fmu::new();
    assert_eq!(fmu.set(&["gain", "u"], &[3.0, 8.0, 9.0]), OK);
    fmu.configure("n", 4);
    // The mock starts with u = 1, 2, 3, ...
    assert_eq!(
        fmu.get(&["gain", "u", "x_start"], 9).unwrap(),
        [3.0, 1.0, 2.0, 3.0, 4.0, 0.25, 0.25, 0.25, 0.25]
    );
    fmu.refuses(&["fmi3GetFloat64", "nValues = 2; expected 4"], || fmu.get(&["u"], 2).unwrap_err());
    fmu.start();
    assert_eq!(fmu.step(0.0, 0.5), (OK, [false; 3], 0.5));
    let decay = (-1.0_f64).exp();
    let expected: Vec<f64> = (1..=4).map(|i| 3.0 * f64::from(i)).map(|u| u + (0.25 - u) * decay).collect();
    assert_eq!(fmu.get(&["x"], 4).unwrap(), expected);
    unsafe { assert_eq!(fmi3Reset(fmu.c), OK) };
    assert_eq!(fmu.get(&["u", "gain"], 3).unwrap(), [1.0, 2.0, 2.0]);
    assert_eq!(fmu.lines(), []);
}

#[test]
fn sizes_that_cannot_be_change_nothing_and_reserve_no_memory() {
    let fmu = Fmu::new();
    unsafe { assert_eq!(fmi3EnterConfigurationMode(fmu.c), OK) };
    for n in [0, 1001, 1 << 60, u64::MAX] {
        let found = format!("n = {n} is refused; expected 1 to 1000; choose another");
        fmu.refuses(&["fmi3SetUInt64", &found], || fmu.set_number("n", &[n]));
    }
    fmu.refuses(&["fmi3SetUInt64", "m = 11"], || fmu.set_number("m", &[11]));
    fmu.refuses(&["fmi3SetUInt64", "whose is not there in configuration mode"], || {
        fmu.set_number("whose", &[1])
    });
    fmu.refuses(&["fmi3GetFloat64", "u is not there in configuration mode"], || {
        fmu.get(&["u"], 2).unwrap_err()
    });
    fmu.refuses(&["fmi3EnterInitializationMode", "configuration mode"], || unsafe {
        fmi3EnterInitializationMode(fmu.c, false, 0.0, 0.0, false, 0.0)
    });
    // To none and back again, which is where it was.
    for (name, size) in [("m", 0), ("n", 9), ("m", 1), ("n", 2)] {
        assert_eq!(fmu.set_number(name, &[size]), OK);
    }
    unsafe { assert_eq!(fmi3ExitConfigurationMode(fmu.c), OK) };
    assert_eq!(fmu.get(&["u", "bias"], 3).unwrap(), [1.0, 2.0, 0.0]);
    fmu.refuses(&["fmi3SetUInt64", "whose[1] = 3 is refused; expected 0 to 2"], || {
        fmu.set_number("whose", &[3])
    });
    fmu.refuses(&["fmi3SetFloat64", "bias[1] = -1", ">= 0"], || fmu.set(&["u", "bias"], &[5.0, 5.0, -1.0]));
}

#[test]
fn an_array_that_is_empty_is_read_and_set_as_one() {
    let fmu = Fmu::new();
    fmu.configure("m", 0);
    assert!(fmu.get(&["bias"], 0).unwrap().is_empty());
    assert_eq!(fmu.get(&["bias", "u"], 2).unwrap(), [1.0, 2.0]);
    assert_eq!(fmu.set(&["bias"], &[]), OK);
    fmu.start();
    assert_eq!(fmu.get(&["total"], 1).unwrap(), [3.0]);
}

#[test]
fn what_a_model_is_built_from_counts_from_the_next_output_on() {
    let fmu = Fmu::new();
    assert_eq!(fmu.set(&["u", "gain"], &[3.0, 4.0, 5.0]), OK);
    fmu.configure("m", 2);
    unsafe { assert_eq!(fmi3EnterInitializationMode(fmu.c, false, 0.0, 1.0, false, 0.0), OK) };
    assert_eq!(fmu.get(&["total"], 1).unwrap(), [7.0]);
    assert_eq!(fmu.set(&["bias"], &[10.0, 20.0]), OK);
    assert_eq!(fmu.get(&["total", "gain", "bias", "time"], 5).unwrap(), [37.0, 5.0, 10.0, 20.0, 1.0]);
    assert_eq!(fmu.set(&["bias", "u"], &[1.0, 2.0, 0.0, 0.0]), OK);
    unsafe { assert_eq!(fmi3ExitInitializationMode(fmu.c), OK) };
    assert_eq!(fmu.get(&["total", "gain"], 2).unwrap(), [3.0, 5.0]);
    assert_eq!(fmu.lines(), []);
}

#[test]
fn a_model_that_cannot_be_built_leaves_everything_as_it_was() {
    let fmu = Fmu::new();
    unsafe { assert_eq!(fmi3EnterInitializationMode(fmu.c, false, 0.0, 0.0, false, 0.0), OK) };
    assert_eq!(fmu.set(&["bias", "u"], &[BIAS_FAILS, 3.0, 4.0]), OK);
    fmu.refuses(&["fmi3GetFloat64: bias: found 404"], || fmu.get(&["u", "total"], 3).unwrap_err());
    fmu.refuses(&["fmi3ExitInitializationMode: bias: found 404"], || unsafe {
        fmi3ExitInitializationMode(fmu.c)
    });
    // What does not follow can be read, and it can be put right.
    assert_eq!(fmu.get(&["u"], 2).unwrap(), [3.0, 4.0]);
    assert_eq!(fmu.set(&["bias"], &[1.0]), OK);
    unsafe { assert_eq!(fmi3ExitInitializationMode(fmu.c), OK) };
    assert_eq!(fmu.get(&["total"], 1).unwrap(), [8.0]);
    assert_eq!(fmu.lines(), []);
}

#[test]
fn the_logger_hears_of_a_panic_while_a_model_is_built() {
    let fmu = Fmu::new();
    unsafe { assert_eq!(fmi3EnterInitializationMode(fmu.c, false, 0.0, 0.0, false, 0.0), OK) };
    assert_eq!(fmu.set(&["bias"], &[BIAS_PANICS]), OK);
    assert_eq!(unsafe { fmi3ExitInitializationMode(fmu.c) }, FATAL);
    assert!(fmu.line().contains("told to panic while it is built"));
    // And of one in the new model, which has the logger meanwhile.
    let fmu = Fmu::new();
    fmu.set_fault(fmi_mock::REFRESH_PANICS);
    assert_eq!(fmu.set(&["bias"], &[1.0]), OK);
    assert_eq!(fmu.get(&["total"], 1).unwrap_err(), FATAL);
    assert!(fmu.line().contains("told to panic in refresh"));
}

#[test]
fn a_state_goes_back_whatever_the_sizes_are_meanwhile() {
    let fmu = Fmu::new();
    fmu.configure("n", 3);
    unsafe { assert_eq!(fmi3EnterInitializationMode(fmu.c, false, 0.0, 0.0, false, 0.0), OK) };
    assert_eq!(fmu.set(&["bias"], &[7.0]), OK);
    let mut pending = null_mut();
    unsafe {
        assert_eq!(fmi3GetFMUState(fmu.c, &raw mut pending), OK);
        assert_eq!(fmi3ExitInitializationMode(fmu.c), OK);
    }
    assert_eq!(fmu.step(0.0, 0.25).0, OK);
    let (mut state, bytes) = (null_mut(), fmu.state());
    unsafe { assert_eq!(fmi3GetFMUState(fmu.c, &raw mut state), OK) };
    assert_eq!(fmu.step(0.25, 0.25).0, OK);
    let after = fmu.state();
    for lose_sizes in [false, true] {
        if lose_sizes {
            unsafe { assert_eq!(fmi3Reset(fmu.c), OK) };
            assert_eq!(fmu.get(&["u"], 2).unwrap(), [1.0, 2.0]);
        }
        unsafe { assert_eq!(fmi3SetFMUState(fmu.c, state), OK) };
        assert!(fmu.state() == bytes);
        assert_eq!(fmu.step(0.25, 0.25).0, OK);
        assert!(fmu.state() == after, "lose_sizes: {lose_sizes}");
    }
    // What had been set and not yet built in goes back too.
    unsafe {
        assert_eq!(fmi3SetFMUState(fmu.c, pending), OK);
        assert_eq!(fmi3ExitInitializationMode(fmu.c), OK);
    }
    assert_eq!(fmu.get(&["total"], 1).unwrap(), [13.0]);
    // Into a state that is there already.
    let before = state;
    unsafe {
        assert_eq!(fmi3GetFMUState(fmu.c, &raw mut state), OK);
        assert_eq!(state, before);
        for one in [&raw mut state, &raw mut pending] {
            assert_eq!(fmi3FreeFMUState(fmu.c, one), OK);
            assert_eq!(fmi3FreeFMUState(fmu.c, one), OK);
        }
        assert_eq!(fmi3FreeFMUState(fmu.c, null_mut()), OK);
    }
    assert_eq!(fmu.lines(), []);
}

#[test]
fn bytes_go_to_another_instance_and_damaged_ones_nowhere() {
    let (fmu, other) = (Fmu::new(), Fmu::started());
    fmu.configure("n", 5);
    fmu.start();
    assert_eq!(fmu.step(0.0, 0.125).0, OK);
    let bytes = fmu.state();
    let read = |bytes: &[u8], state: &mut fmi3FMUState| unsafe {
        fmi3DeserializeFMUState(other.c, bytes.as_ptr(), bytes.len(), &raw mut *state)
    };
    let mut state = null_mut();
    for position in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[position] ^= 1 << (position % 8);
        other.refuses(&["fmi3DeserializeFMUState"], || read(&damaged, &mut state));
        assert!(state.is_null(), "byte {position}");
    }
    for length in [0, 7, 8, 35, 43, 44, bytes.len() - 1] {
        other.refuses(&["fmi3DeserializeFMUState"], || read(&bytes[..length], &mut state));
    }
    let longer = [&bytes[..], &[0]].concat();
    other.refuses(&["fmi3DeserializeFMUState", "bytes; expected"], || read(&longer, &mut state));
    assert_eq!(read(&bytes, &mut state), OK);
    unsafe {
        assert_eq!(fmi3SetFMUState(other.c, state), OK);
        assert!(other.state() == bytes);
        let mut short = vec![0; bytes.len() - 1];
        other.refuses(&["fmi3SerializeFMUState", "as fmi3SerializedFMUStateSize says"], || {
            fmi3SerializeFMUState(other.c, state, short.as_mut_ptr(), short.len())
        });
        other.refuses(&["fmi3SetFMUState", "FMUState is NULL"], || fmi3SetFMUState(other.c, null_mut()));
        other.refuses(&["fmi3GetFMUState", "FMUState is NULL"], || fmi3GetFMUState(other.c, null_mut()));
        let mut foreign = [1_u64, 2];
        other.refuses(&["fmi3SetFMUState", "a state of another FMU"], || {
            fmi3SetFMUState(other.c, foreign.as_mut_ptr().cast())
        });
        assert_eq!(fmi3FreeFMUState(other.c, &raw mut state), OK);
    }
    assert_eq!([fmu.step(0.125, 0.125).0, other.step(0.125, 0.125).0], [OK; 2]);
    assert!(fmu.state() == other.state());
}

#[test]
fn dependencies_are_told_element_by_element() {
    let fmu = Fmu::started();
    let [u, x, y, total] = ["u", "x", "y", "total"].map(reference);
    let found = |vr: u32| unsafe {
        let mut n = 99;
        assert_eq!(fmi3GetNumberOfVariableDependencies(fmu.c, vr, &raw mut n), OK);
        let (mut a, mut b, mut c, mut d) = (vec![99; n], vec![99; n], vec![99; n], vec![99; n]);
        let (pa, pb, pc, pd) = (a.as_mut_ptr(), b.as_mut_ptr(), c.as_mut_ptr(), d.as_mut_ptr());
        assert_eq!(fmi3GetVariableDependencies(fmu.c, vr, pa, pb, pc, pd, n), OK);
        assert!(d.iter().all(|kind| *kind == fmi3DependencyKind_fmi3Dependent));
        a.into_iter().zip(b).zip(c).map(|((a, b), c)| (a, b, c)).collect::<Vec<_>>()
    };
    assert_eq!(found(y), [(1, u, 1), (2, u, 2)]);
    // 0 stands for all elements.
    assert_eq!(found(total), [(0, u, 0)]);
    for independent in [u, x, 0, reference("n")] {
        assert_eq!(found(independent), []);
    }
    fmu.refuses(&["fmi3GetNumberOfVariableDependencies", "value reference 99"], || unsafe {
        fmi3GetNumberOfVariableDependencies(fmu.c, 99, null_mut())
    });
    fmu.refuses(&["fmi3GetVariableDependencies", "nDependencies = 1; expected 2"], || unsafe {
        fmi3GetVariableDependencies(fmu.c, y, null_mut(), null_mut(), null_mut(), null_mut(), 1)
    });
    fmu.refuses(&["fmi3GetVariableDependencies", "argument elementIndicesOfDependent is NULL"], || unsafe {
        fmi3GetVariableDependencies(fmu.c, y, null_mut(), null_mut(), null_mut(), null_mut(), 2)
    });
}

#[test]
fn logging_can_be_chosen_by_category() {
    let fmu = Fmu::new();
    let names = [c"logStatusWarning".as_ptr(), null(), c"logNonsense".as_ptr()];
    assert_eq!(unsafe { fmi3SetDebugLogging(fmu.c, true, 3, names.as_ptr()) }, OK);
    let lines = fmu.lines();
    assert_eq!(lines.len(), 2);
    assert!(lines.iter().all(|line| line.text.starts_with("fmi3SetDebugLogging: category")), "{lines:?}");
    unsafe { assert_eq!(fmi3EnterInitializationMode(fmu.c, false, 0.0, 2.0, true, 1.0), OK) };
    assert!(
        fmu.line().starts_with("fmi3EnterInitializationMode: stopTime = 1.0 is not after startTime = 2.0")
    );
}

#[test]
fn sizes_that_were_never_built_are_forgotten_with_the_end() {
    let fmu = Fmu::new();
    unsafe { assert_eq!(fmi3EnterConfigurationMode(fmu.c), OK) };
    assert_eq!(fmu.set_number("n", &[5]), OK);
    unsafe { assert_eq!(fmi3Terminate(fmu.c), OK) };
    // The model of two is still there, and nothing else may be read in its place.
    assert_eq!(fmu.get(&["total", "u"], 3).unwrap(), [3.0, 1.0, 2.0]);
    let bytes = fmu.state();
    let mut state = null_mut();
    unsafe {
        assert_eq!(fmi3DeserializeFMUState(fmu.c, bytes.as_ptr(), bytes.len(), &raw mut state), OK);
        assert_eq!(fmi3SetFMUState(fmu.c, state), OK);
        assert_eq!(fmi3FreeFMUState(fmu.c, &raw mut state), OK);
    }
    assert!(fmu.state() == bytes);
    assert_eq!(fmu.lines(), []);
}

#[test]
fn a_state_between_two_sizes_goes_back_though_a_number_named_the_last_of_more() {
    let fmu = Fmu::new();
    assert_eq!(fmu.set_number("whose", &[2]), OK);
    assert_eq!(fmu.set(&["bias"], &[7.0]), OK);
    unsafe { assert_eq!(fmi3EnterConfigurationMode(fmu.c), OK) };
    assert_eq!(fmu.set_number("n", &[1]), OK);
    let (mut state, bytes) = (null_mut(), fmu.state());
    unsafe {
        assert_eq!(fmi3GetFMUState(fmu.c, &raw mut state), OK);
        assert_eq!(fmi3SetFMUState(fmu.c, state), OK);
        assert_eq!(fmi3FreeFMUState(fmu.c, &raw mut state), OK);
        assert_eq!(fmi3DeserializeFMUState(fmu.c, bytes.as_ptr(), bytes.len(), &raw mut state), OK);
        assert_eq!(fmi3FreeFMUState(fmu.c, &raw mut state), OK);
        assert_eq!(fmi3ExitConfigurationMode(fmu.c), OK);
    }
    // The row is zeros: the number, and what stood beside it.
    assert_eq!(fmu.get(&["bias", "total"], 2).unwrap(), [0.0, 1.0]);
    assert_eq!(fmu.lines(), []);
}

#[test]
fn time_stands_among_values_of_the_model_without_disturbing_them() {
    let fmu = Fmu::new();
    unsafe { assert_eq!(fmi3EnterInitializationMode(fmu.c, false, 0.0, 4.0, false, 0.0), OK) };
    let expected = [4.0, 1.0, 2.0, 4.0, 0.0, 2.0, 4.0];
    assert_eq!(fmu.get(&["time", "u", "time", "bias", "gain", "time"], 7).unwrap(), expected);
    assert_eq!(fmu.lines(), []);
}

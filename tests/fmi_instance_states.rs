//! Reset, snapshots and their bytes in the safe core: back to the bit, and nothing damaged or foreign is let in.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

mod fmi_mock;
#[path = "fmi_mock/instances.rs"]
mod instances;

use bess_consensus::fmi::{Instance, Snapshot, State};
use fmi_mock::Mock;
use instances::*;
use proptest::prelude::*;

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

proptest! {
    #[test]
    fn noise_is_refused_and_never_panics(noise in prop::collection::vec(any::<u8>(), 0..200)) {
        let instance = started(1);
        prop_assert!(instance.deserialize(&noise).is_err());
    }
}

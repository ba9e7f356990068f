//! The same sequences on the mock model, which can be told to fail and to panic: quick enough for miri.
#![cfg_attr(miri, feature(c_variadic))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

#[path = "../../tests/fmi_mock/mod.rs"]
mod fmi_mock;

use bess_consensus::fmi::Function;
use bess_consensus::fmi::bindings::{fmi2Status_fmi2Error, fmi2Status_fmi2Fatal, fmi2Status_fmi2OK};
use bess_fuzz::seeded::bytes;
use bess_fuzz::subject::{Subject, Traits};
use bess_fuzz::tally::Tally;
use bess_fuzz::world::World;
use fmi_mock::Mock;

fn mock() -> Subject {
    let traits = Traits { may_panic: true, may_refuse: true, longest_step_s: 9e9, ..Traits::default() };
    Subject::new::<Mock>("n.txt", &[b"2".to_vec(), b"3".to_vec()], traits).unwrap()
}

#[test]
fn random_calls_meet_what_must_come_of_them() {
    let sequences = if cfg!(miri) { 12 } else { 2000 };
    let mock = mock();
    let mut total = Tally::default();
    for sequence in 0..sequences {
        total.add(&World::play(&mock, std::ptr::null_mut(), &bytes(1, sequence), false));
    }
    println!("{total}");
    if cfg!(miri) {
        return;
    }
    for &function in Function::ALL {
        assert!(
            total.of(function, fmi2Status_fmi2OK) + total.of(function, fmi2Status_fmi2Error) > 0,
            "{function}"
        );
    }
    assert!(total.of(Function::DoStep, fmi2Status_fmi2OK) > 10_000);
    assert!(total.of(Function::DoStep, fmi2Status_fmi2Fatal) > 0, "the mock was never told to panic");
}

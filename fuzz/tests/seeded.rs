//! A short seeded run on both FMUs, so that a finding shows without a sanitizer already; a long one is `cargo xtask fuzz`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

use bess_consensus::fmi::Function;
use bess_consensus::fmi::bindings::*;
use bess_fuzz::fmus;
use bess_fuzz::seeded::{Run, run};

const CALLS: u64 = 200_000;

#[test]
fn random_calls_on_both_fmus_meet_what_must_come_of_them() {
    let [controller, grid] = [fmus::controller().unwrap(), fmus::grid().unwrap()];
    for (subject, other) in [(&controller, &grid), (&grid, &controller)] {
        let tally = run(subject, Some(other), Run { seed: 2, calls: CALLS, first: 0, threads: 2 })
            .unwrap_or_else(|finding| panic!("sequence {}: {}", finding.sequence, finding.text));
        // Every function that can be accepted and refused was both, often.
        for &function in Function::ALL {
            let [ok, discard, error] = [fmi2Status_fmi2OK, fmi2Status_fmi2Discard, fmi2Status_fmi2Error]
                .map(|s| tally.of(function, s));
            assert!(
                ok + discard + error > CALLS / 2000,
                "{function} was called {ok}+{discard}+{error} times\n{tally}"
            );
        }
        assert!(tally.of(Function::DoStep, fmi2Status_fmi2OK) > CALLS / 50, "\n{tally}");
        assert!(tally.of(Function::SetFmuState, fmi2Status_fmi2OK) > CALLS / 500, "\n{tally}");
    }
}

//! The coverage-guided target: the first byte chooses the FMU, the rest are the calls.
#![no_main]
#![allow(clippy::panic, reason = "a finding is a panic")]

use bess_fuzz::fmus;
use bess_fuzz::stranger::Stranger;
use bess_fuzz::subject::Subject;
use bess_fuzz::world::World;
use std::sync::LazyLock;

static FMUS: LazyLock<[Subject; 2]> =
    LazyLock::new(|| [fmus::controller(), fmus::grid()].map(|fmu| fmu.unwrap_or_else(|e| panic!("{e}"))));

/// A state of each, never freed, and who has it, so that nobody takes it for lost: addresses, because pointers are tied to
/// a thread.
static STATES: LazyLock<[[usize; 2]; 2]> = LazyLock::new(|| {
    [&FMUS[0], &FMUS[1]].map(|fmu| {
        let stranger = Box::leak(Box::new(Stranger::of(fmu)));
        [stranger.state().expose_provenance(), std::ptr::from_ref(stranger).expose_provenance()]
    })
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((which, calls)) = bytes.split_first() else { return };
    let (fmu, other) = (usize::from(which % 2), usize::from(1 - which % 2));
    let [state, _] = STATES[other];
    let foreign = std::ptr::with_exposed_provenance_mut(state);
    World::play(&FMUS[fmu], foreign, calls, false);
});

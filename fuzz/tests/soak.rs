//! Short long runs. A process of their own, because they look at its memory; the long ones are `cargo xtask soak`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

use bess_fuzz::fmus;
use bess_fuzz::soak::{Load, soak};

#[test]
fn short_long_runs_give_equal_bits_and_take_no_memory() {
    for subject in [fmus::controller().unwrap(), fmus::grid().unwrap()] {
        println!("{}", soak(&subject, Load { steps: 100_000, lives: 200, crowd: (64, 8) }).unwrap());
    }
}

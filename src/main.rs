//! The `bess` command; everything is in [`bess_consensus::cli`].
#![forbid(unsafe_code)]

/// The FMUs' shared libraries for all platforms, a zip archive that `cargo xtask` puts in. Here and not in the
/// library, so that other libraries mean a new `bess` and nothing else.
#[cfg(bess_carry)]
const CARRIED: &[u8] = include_bytes!(env!("BESS_CARRY"));
/// A plain `cargo build` carries none: those beside it are newer.
#[cfg(not(bess_carry))]
const CARRIED: &[u8] = &[];

fn main() -> std::process::ExitCode {
    bess_consensus::cli::main(CARRIED)
}

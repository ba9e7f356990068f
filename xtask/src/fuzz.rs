//! `cargo xtask fuzz`, `miri` and `soak`: what `fuzz/` offers, built with the flags that each of them needs. Everything
//! but the coverage-guided run and miri works with the stable compiler.

use crate::{
    error::Failure,
    fmu,
    platforms::Platform,
    process::{cargo, command, on_path, run, succeeds},
    workspace::Workspace,
};
use std::{path::PathBuf, process::Command};

/// The one target that the sanitizers' runtime comes for.
const TARGET: &str = "x86_64-unknown-linux-gnu";
/// The version that the corpus was made with.
const CARGO_FUZZ: &str = "0.13.2";
/// Calls of the stage: as many as take about a minute.
pub const STAGE_CALLS: u64 = 300_000;
/// Steps and lives of the stage, for each FMU.
pub const STAGE_SOAK: (u64, u64) = (500_000, 1000);

/// Whether this compiler brings the runtime of AddressSanitizer; rustup's does, Debian's does not.
pub fn has_asan() -> bool {
    let libraries = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    libraries.is_ok_and(|found| {
        let folder = PathBuf::from(String::from_utf8_lossy(&found.stdout).trim());
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.file_name()).any(|name| name.to_string_lossy().contains("rt.asan"))
    })
}

/// Plays random calls under AddressSanitizer, with every check of arithmetic on.
pub fn seeded(workspace: &Workspace, calls: u64, seed: u64) -> Result<(), Failure> {
    let folder = workspace.target.join("asan");
    let mut build = cargo(workspace);
    build.args(["build", "--profile", "fuzz", "--package", "bess-fuzz", "--target", TARGET, "--target-dir"]);
    // The flag is unstable in name only: the stable toolchain ships the runtime.
    run(build.arg(&folder).env("RUSTC_BOOTSTRAP", "1").env("RUSTFLAGS", "-Zsanitizer=address"))?;
    let mut fuzz = command(workspace, folder.join(TARGET).join("fuzz/bess-fuzz"));
    fuzz.args(["run", "--calls", &calls.to_string(), "--seed", &seed.to_string()]);
    // A leak of what an instance or a state held is a finding, too.
    run(fuzz.env("ASAN_OPTIONS", "detect_leaks=1:abort_on_error=1:detect_stack_use_after_return=1"))
}

/// Lets libFuzzer look for new paths for so many seconds, from the corpus on.
pub fn guided(workspace: &Workspace, seconds: u64) -> Result<(), Failure> {
    if on_path("cargo-fuzz").is_none() {
        let text = format!("cargo-fuzz is missing: cargo install cargo-fuzz --locked --version {CARGO_FUZZ}");
        return Err(Failure::Other(text));
    }
    // What is new goes into the target folder, so that the corpus in the repository stays small.
    let found = workspace.target.join("fuzz-corpus");
    std::fs::create_dir_all(&found).map_err(Failure::file("make", &found))?;
    let mut fuzz = cargo(workspace);
    // A target folder of its own: other flags, and hours that nobody else should wait for.
    fuzz.args(["fuzz", "run", "calls", "--features", "guided", "--target", TARGET, "--target-dir"]);
    fuzz.arg(workspace.target.join("guided")).arg(&found);
    fuzz.args(["fuzz/corpus", "--"]).arg(format!("-max_total_time={seconds}"));
    // The longest sequence there is: two steps of the grid that it gives up after two million internal ones.
    fuzz.args(["-timeout=600", "-max_len=8192", "-rss_limit_mb=4096"]);
    run(fuzz.env("RUSTC_BOOTSTRAP", "1"))
}

/// The C interface with a mock model under miri, where there is a nightly toolchain that has it.
pub fn miri(workspace: &Workspace) -> Result<(), Failure> {
    if !succeeds(Command::new("cargo").args(["+nightly", "miri", "--version"])) {
        let text = "miri is missing: rustup toolchain install nightly --component miri,rust-src";
        return Err(Failure::Other(text.into()));
    }
    // Not through the cargo that started this program: that one is of another toolchain.
    let miri = |arguments: &[&str]| {
        let mut miri = command(workspace, "cargo");
        for inherited in ["CARGO", "RUSTC", "RUSTUP_TOOLCHAIN", "RUSTFLAGS", "CARGO_INCREMENTAL"] {
            miri.env_remove(inherited);
        }
        // Resources are files, and a run that fails shall fail alike the next time.
        miri.env("MIRIFLAGS", "-Zmiri-disable-isolation -Zmiri-seed=1");
        miri.args(["+nightly", "miri", "test", "--target-dir"]).arg(workspace.target.join("miri"));
        run(miri.args(arguments))
    };
    miri(&["--package", "bess-fuzz", "--test", "mock"])?;
    miri(&["--no-default-features", "--features", "controller", "--test", "fmi_c_layer"])
}

/// The long runs through the shared libraries that go into the FMUs.
pub fn soak(workspace: &Workspace, (steps, lives): (u64, u64)) -> Result<(), Failure> {
    fmu::build_here(workspace, Platform::must_be_here()?)?;
    // Of the whole workspace, as for the tests: what was compiled for those is not compiled again.
    run(cargo(workspace).args(["build", "--locked", "--release", "--workspace", "--bin", "bess-fuzz"]))?;
    let mut soak = command(workspace, workspace.release().join("bess-fuzz"));
    soak.args(["soak", "--steps", &steps.to_string(), "--lives", &lives.to_string(), "--libraries"]);
    run(soak.arg(workspace.plain_libraries()))
}

//! A shared library made with `export_fmi2!` shows the 34 functions of FMI 2.0 co-simulation and
//! nothing else.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![cfg(target_os = "linux")]

use bess_consensus::fmi::Function;
use std::path::Path;
use std::process::Command;

#[test]
fn the_shared_library_exports_the_34_functions_and_nothing_else() {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/mock_fmu/Cargo.toml");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mock_fmu");
    let built = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--offline", "--lib", "--manifest-path", manifest, "--target-dir"])
        .arg(&target)
        .status()
        .expect("cargo runs");
    assert!(built.success());
    let library = target.join("debug/libMock.so");
    let listed =
        Command::new("nm").args(["-D", "--defined-only"]).arg(&library).output().expect("nm (binutils)");
    let text = String::from_utf8(listed.stdout).expect("names are ASCII");
    let mut found: Vec<&str> = text.lines().filter_map(|line| line.split_whitespace().nth(2)).collect();
    let mut expected: Vec<&str> = Function::ALL.iter().map(|function| function.name()).collect();
    found.sort_unstable();
    expected.sort_unstable();
    assert_eq!(found, expected);
}

//! Compiler and linker for a platform: what is on this machine, and what to install where there is none.
//!
//! The compiler is this cargo's, if it has the platform's standard library; else Debian's second toolchain
//! (rustc-web), which compiles the standard library from Debian's sources. The linker is zig, which brings every
//! glibc's interface with it; for Windows it is mingw's gcc.

use super::{OLDEST_GLIBC, Platform};
use crate::{
    process::{cargo, command, on_path, output},
    python,
    workspace::Workspace,
};
use std::{
    ffi::OsString,
    path::{Path, PathBuf},
    process::Command,
};

/// Where Debian has cargo and rustc, whatever comes first in PATH.
const DEBIANS_CARGO: &str = "/usr/bin/cargo";
const DEBIANS_RUSTC: &str = "/usr/bin/rustc";
/// Where Debian's rust-web-src has the standard library.
const DEBIANS_STD: &str = "/usr/lib/rustlib/src/rust/library/std/src/lib.rs";
/// What the workspace asks for, as rustc would print it.
const OLDEST_RUSTC: &str = concat!("rustc ", env!("CARGO_PKG_RUST_VERSION"), ".0");

/// A way to build for a platform.
pub struct Toolchain {
    compiler: Compiler,
    /// The folder with cargo-zigbuild, if zig links.
    zig: Option<PathBuf>,
}

enum Compiler {
    /// The cargo that started this program.
    Ours,
    /// Debian's, which compiles the standard library along.
    Debians,
}

/// The folder with the programs of the environment that has zig, cargo-zigbuild and maturin; or why there is none.
pub fn zig(workspace: &Workspace) -> Result<PathBuf, String> {
    let python = python::environment(workspace, "platforms").map_err(|failure| {
        format!("zig and cargo-zigbuild cannot be installed ({failure}); they come from PyPI by pip")
    })?;
    python.parent().map(Path::to_path_buf).ok_or_else(|| "the virtual environment has no folder".to_owned())
}

/// How to build for a platform here, or what to install.
pub fn find(platform: Platform, zig: &Result<PathBuf, String>) -> Result<Toolchain, String> {
    let compiler = compiler(platform)?;
    let zig = match platform {
        Platform::Win64 if on_path("x86_64-w64-mingw32-gcc").is_none() => {
            return Err("no linker: sudo apt-get install gcc-mingw-w64-x86-64-posix".to_owned());
        }
        Platform::Win64 => None,
        Platform::Linux64 | Platform::Aarch64Linux => Some(zig.clone()?),
    };
    Ok(Toolchain { compiler, zig })
}

fn compiler(platform: Platform) -> Result<Compiler, String> {
    if has_standard_library(platform) {
        return Ok(Compiler::Ours);
    }
    let version = output(Command::new(DEBIANS_RUSTC).arg("--version")).ok();
    // Other Debian releases have an older rustc there.
    let recent = version.is_some_and(|printed| minor_version(&printed) >= minor_version(OLDEST_RUSTC));
    if recent && Path::new(DEBIANS_CARGO).is_file() && Path::new(DEBIANS_STD).is_file() {
        return Ok(Compiler::Debians);
    }
    let triple = platform.triple();
    Err(format!(
        "no standard library for it: rustup target add {triple}; \
         or on Debian 12: sudo apt-get install rustc-web cargo-web rust-web-src"
    ))
}

/// Whether something here compiles for all platforms.
pub fn compiles_for_all() -> bool {
    Platform::ALL.into_iter().all(|platform| compiler(platform).is_ok())
}

/// Whether the rustc of this cargo can compile for the platform as it is.
fn has_standard_library(platform: Platform) -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| OsString::from("rustc"));
    let folder =
        output(Command::new(rustc).args(["--print", "target-libdir", "--target", platform.triple()]));
    let entries = folder.ok().and_then(|folder| std::fs::read_dir(folder.trim()).ok());
    entries.is_some_and(|mut entries| {
        entries
            .any(|entry| entry.is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with("libstd-")))
    })
}

/// `rustc 1.96.0 (...)` -> 96.
fn minor_version(printed: &str) -> Option<u32> {
    printed.strip_prefix("rustc 1.")?.split('.').next()?.parse().ok()
}

impl Toolchain {
    /// The start of a `cargo build --release` for a platform.
    pub fn build(&self, workspace: &Workspace, platform: Platform) -> Command {
        let mut build = match (&self.zig, &self.compiler) {
            (Some(folder), _) => command(workspace, folder.join("cargo-zigbuild")),
            (None, Compiler::Ours) => cargo(workspace),
            (None, Compiler::Debians) => command(workspace, DEBIANS_CARGO),
        };
        build.arg(if self.zig.is_some() { "zigbuild" } else { "build" });
        build.args(["--quiet", "--release", "--target"]);
        match &self.zig {
            Some(folder) => {
                build.arg(format!("{}.{OLDEST_GLIBC}", platform.triple())).env("PATH", first_in_path(folder))
            }
            None => build.arg(platform.triple()),
        };
        // Not with Debian's, which resolves the standard library along and has no lock file for that.
        if let Compiler::Ours = self.compiler {
            build.arg("--locked");
        }
        if let Compiler::Debians = self.compiler {
            build.env("CARGO", DEBIANS_CARGO).env("RUSTC", DEBIANS_RUSTC);
            // What rustup set for its own rustc.
            build.env_remove("LD_LIBRARY_PATH").env_remove("RUSTUP_TOOLCHAIN");
            build.env("RUSTC_BOOTSTRAP", "1").arg("-Zbuild-std=std,panic_unwind");
        }
        build
    }
}

/// PATH with a folder before all others.
pub fn first_in_path(folder: &Path) -> OsString {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::iter::once(folder.to_path_buf()).chain(std::env::split_paths(&path));
    std::env::join_paths(folders).unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rustcs_version_is_read_and_compared_as_a_number() {
        assert_eq!(minor_version("rustc 1.96.0 (abc 2026-05-25) (built from a source tarball)"), Some(96));
        assert!(minor_version("rustc 1.100.0") > minor_version("rustc 1.96.0"));
        assert!(minor_version(OLDEST_RUSTC).is_some());
        assert_eq!(minor_version("gcc 12"), None);
    }

    #[test]
    fn debians_compiler_builds_the_standard_library_and_zig_names_the_glibc() {
        let workspace = Workspace { root: "/w".into(), target: "/w/target".into() };
        let arguments = |toolchain: &Toolchain, platform| -> Vec<OsString> {
            toolchain.build(&workspace, platform).get_args().map(OsString::from).collect()
        };
        let debians = Toolchain { compiler: Compiler::Debians, zig: None };
        let given = arguments(&debians, Platform::Win64);
        assert!(given.contains(&"x86_64-pc-windows-gnu".into()) && given.contains(&"build".into()));
        assert!(given.iter().any(|argument| argument == "-Zbuild-std=std,panic_unwind"));
        let ours = Toolchain { compiler: Compiler::Ours, zig: Some("/venv/bin".into()) };
        let given = arguments(&ours, Platform::Linux64);
        assert!(
            given.contains(&"x86_64-unknown-linux-gnu.2.17".into()) && given.contains(&"zigbuild".into())
        );
    }
}

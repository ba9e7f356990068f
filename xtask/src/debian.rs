//! Tools that a stage needs beyond Rust and gcc: whether they are here, and the Debian packages that
//! bring them. Installs only as root.

use crate::{
    error::Failure,
    fuzz, platforms,
    process::{command, on_path, output, run, succeeds},
    workspace::Workspace,
};
use std::{
    path::{Path, PathBuf},
    process::Command,
};

/// A tool that may be missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// cargo's component rustfmt.
    Rustfmt,
    /// cargo's component clippy.
    Clippy,
    /// libclang with its headers, for bindgen.
    Libclang,
    /// Python 3.11 or later that can make virtual environments.
    Python,
    /// A browser without a window, and what steers it.
    Chromium,
    /// Threading Building Blocks, which the master Ecos is linked with.
    Tbb,
    /// Compilers for every platform that an FMU can be for.
    CrossRust,
    /// A linker for Windows, and what lists the contents of its libraries.
    Mingw,
    /// What runs programs for Windows.
    Wine,
    /// What runs programs for 64-bit Arm Linux, and their C library.
    QemuAarch64,
    /// GNU Octave, which runs MATPOWER.
    Octave,
    /// Counts instructions.
    Valgrind,
    /// Networks apart from each other on one machine.
    Iproute,
    /// The runtime of AddressSanitizer that rustup's compilers bring.
    Asan,
}

impl Need {
    /// Whether the tool is on this machine.
    pub fn met(self) -> bool {
        match self {
            Need::Rustfmt => succeeds(Command::new("cargo").args(["fmt", "--version"])),
            Need::Clippy => succeeds(Command::new("cargo").args(["clippy", "--version"])),
            Need::Libclang => std::env::var_os("LIBCLANG_PATH").is_some() || find_libclang(Path::new("/usr")),
            Need::Python => succeeds(Command::new("python3").args(["-c", PYTHON_IS_FIT])),
            Need::Chromium => ["chromium", "chromedriver"].iter().all(|tool| on_path(tool).is_some()),
            Need::Tbb => find_library(Path::new("/usr"), "libtbb.so.12"),
            Need::CrossRust => platforms::compiles_for_all(),
            Need::Mingw => {
                ["gcc", "objdump"].iter().all(|tool| on_path(&format!("x86_64-w64-mingw32-{tool}")).is_some())
            }
            Need::Wine => Path::new(DEBIANS_WINE).is_file() || on_path("wine64").is_some(),
            Need::QemuAarch64 => on_path("qemu-aarch64").is_some() && Path::new(ARM_LOADER).is_file(),
            Need::Octave => on_path("octave-cli").is_some(),
            Need::Valgrind => on_path("valgrind").is_some(),
            Need::Iproute => ["ip", "tc"].iter().all(|tool| on_path(tool).is_some()),
            Need::Asan => fuzz::has_asan(),
        }
    }

    /// The Debian packages that bring it; none where Debian is not the way.
    pub fn packages(self) -> &'static [&'static str] {
        match self {
            Need::Rustfmt | Need::Clippy | Need::Asan => &[],
            Need::Libclang => &["libclang-dev"],
            Need::Python => &["python3", "python3-venv"],
            Need::Chromium => &["chromium", "chromium-driver"],
            Need::Tbb => &["libtbb12"],
            Need::CrossRust => &["rustc-web", "cargo-web", "rust-web-src"],
            Need::Mingw => &["gcc-mingw-w64-x86-64-posix"],
            Need::Wine => &["wine64"],
            Need::QemuAarch64 => &["qemu-user", "libc6-arm64-cross"],
            Need::Octave => &["octave"],
            Need::Valgrind => &["valgrind"],
            Need::Iproute => &["iproute2"],
        }
    }

    /// What is missing and the one line that brings it.
    pub fn advice(self) -> String {
        match self {
            Need::Rustfmt => "rustfmt is missing: rustup component add rustfmt".into(),
            Need::Clippy => "clippy is missing: rustup component add clippy".into(),
            Need::Libclang => format!("libclang is missing: {}", install_line(self.packages())),
            Need::Python => {
                format!("no python3 of 3.11 or later with venv: {}", install_line(self.packages()))
            }
            Need::Chromium => format!("chromium or its driver is missing: {}", install_line(self.packages())),
            Need::Tbb => format!("libtbb.so.12 is missing: {}", install_line(self.packages())),
            Need::CrossRust => {
                let targets = platforms::Platform::ALL.map(platforms::Platform::triple).join(" ");
                let debian = install_line(self.packages());
                format!("no Rust for other platforms: rustup target add {targets}; or on Debian 12: {debian}")
            }
            Need::Mingw => format!("mingw is missing: {}", install_line(self.packages())),
            Need::Wine => format!("wine is missing: {}", install_line(self.packages())),
            Need::QemuAarch64 => {
                format!("qemu-aarch64 or its C library is missing: {}", install_line(self.packages()))
            }
            Need::Octave => format!("octave is missing: {}", install_line(self.packages())),
            Need::Asan => "no AddressSanitizer beside this rustc: use rustup's, on x86-64 Linux".into(),
            Need::Iproute => format!("ip or tc is missing: {}", install_line(self.packages())),
            Need::Valgrind => format!("valgrind is missing: {}", install_line(self.packages())),
        }
    }
}

/// Debian puts no link to it into PATH.
const DEBIANS_WINE: &str = "/usr/lib/wine/wine64";
/// The dynamic loader of libc6-arm64-cross.
const ARM_LOADER: &str = "/usr/aarch64-linux-gnu/lib/ld-linux-aarch64.so.1";

/// numpy's pinned version asks for Python 3.11; Debian leaves ensurepip out of its plain python3.
const PYTHON_IS_FIT: &str = "import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))";

/// Installs what is missing if this is root on Debian; otherwise prints the one line to type.
///
/// A failed installation is no error here: whoever needs the tool asks [`Need::met`] again.
pub fn provide(workspace: &Workspace, needs: &[Need]) {
    let mut packages: Vec<&str> =
        needs.iter().filter(|need| !need.met()).flat_map(|need| need.packages()).copied().collect();
    packages.sort_unstable();
    packages.dedup();
    if packages.is_empty() {
        return;
    }
    if on_path("apt-get").is_none() || !is_root(workspace) {
        eprintln!("Missing; to have every stage run: {}", install_line(&packages));
        return;
    }
    if let Err(failure) = install(workspace, &packages) {
        eprintln!("xtask: {failure}");
    }
}

fn install(workspace: &Workspace, packages: &[&str]) -> Result<(), Failure> {
    let apt = || {
        let mut apt = command(workspace, "apt-get");
        apt.env("DEBIAN_FRONTEND", "noninteractive").arg("--quiet=2");
        apt
    };
    run(apt().arg("update"))?;
    run(apt().args(["install", "--yes", "--no-install-recommends"]).args(packages))
}

fn install_line(packages: &[&str]) -> String {
    format!("sudo apt-get install {}", packages.join(" "))
}

fn is_root(workspace: &Workspace) -> bool {
    output(command(workspace, "id").arg("-u")).is_ok_and(|id| id.trim() == "0")
}

/// Where distributions put shared libraries.
const LIBRARY_FOLDERS: [&str; 5] =
    ["lib", "lib64", "local/lib", "lib/x86_64-linux-gnu", "lib/aarch64-linux-gnu"];

/// Whether a shared library lies where distributions put it.
fn find_library(prefix: &Path, name: &str) -> bool {
    LIBRARY_FOLDERS.iter().any(|folder| prefix.join(folder).join(name).exists())
}

/// Whether `libclang.so`, which only the development package has, lies where distributions put it.
fn find_libclang(prefix: &Path) -> bool {
    let mut folders: Vec<PathBuf> = Vec::new();
    if let Ok(entries) = std::fs::read_dir(prefix.join("lib")) {
        let llvm = entries.flatten().map(|entry| entry.path());
        folders.extend(
            llvm.filter(|path| path.to_string_lossy().contains("llvm-")).map(|path| path.join("lib")),
        );
    }
    find_library(prefix, "libclang.so") || folders.iter().any(|folder| folder.join("libclang.so").exists())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libclang_is_found_in_debians_folder_and_only_with_its_development_link() {
        let prefix = tempfile::tempdir().expect("a temporary folder");
        let folder = prefix.path().join("lib/llvm-14/lib");
        std::fs::create_dir_all(&folder).expect("writable");
        std::fs::write(folder.join("libclang.so.1"), "").expect("writable");
        assert!(!find_libclang(prefix.path()));
        std::fs::write(folder.join("libclang.so"), "").expect("writable");
        assert!(find_libclang(prefix.path()));
    }

    #[test]
    fn advice_names_the_tool_and_one_line_to_type() {
        let advice = "chromium or its driver is missing: sudo apt-get install chromium chromium-driver";
        assert_eq!(Need::Chromium.advice(), advice);
        assert!(Need::Clippy.advice().ends_with("rustup component add clippy"));
    }
}

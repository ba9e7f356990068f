//! The platforms that an FMU can be for, and the shared libraries of both models for each of them. Builds what
//! can be built here and says what is missing for the rest.

mod carry;
mod needs;
mod test;
mod toolchain;
mod wheel;

pub use carry::{CARRY_CFG, carry};
pub use needs::needs;
pub use test::{test, test_wheel};
pub use toolchain::compiles_for_all;
pub use wheel::wheel;

use crate::{
    error::Failure,
    fmu,
    process::{cargo, run},
    supply,
    workspace::Workspace,
};
use std::{
    path::{Path, PathBuf},
    process::Command,
};
use toolchain::Toolchain;

/// A platform, as FMI names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Platform {
    /// x86-64 Linux, for every glibc from [`OLDEST_GLIBC`] on.
    Linux64,
    /// x86-64 Windows.
    Win64,
    /// 64-bit Arm Linux.
    Aarch64Linux,
}

/// The glibc that zig links against: that of the manylinux2014 wheels, of 2012.
pub const OLDEST_GLIBC: &str = "2.17";

impl Platform {
    /// All of them.
    pub const ALL: [Platform; 3] = [Platform::Linux64, Platform::Win64, Platform::Aarch64Linux];

    /// The one that this program runs on, if it is one of them.
    pub fn here() -> Option<Platform> {
        match (std::env::consts::OS, std::env::consts::ARCH) {
            ("linux", "x86_64") => Some(Platform::Linux64),
            ("windows", "x86_64") => Some(Platform::Win64),
            ("linux", "aarch64") => Some(Platform::Aarch64Linux),
            _ => None,
        }
    }

    /// The same, for what cannot go on without.
    pub fn must_be_here() -> Result<Platform, Failure> {
        Platform::here()
            .ok_or_else(|| Failure::Other(format!("no FMI 2.0 platform name for {}", std::env::consts::OS)))
    }

    /// The folder under `binaries/` of an FMU.
    pub fn name(self) -> &'static str {
        match self {
            Platform::Linux64 => "linux64",
            Platform::Win64 => "win64",
            Platform::Aarch64Linux => "aarch64-linux",
        }
    }

    /// What rustc calls it.
    pub fn triple(self) -> &'static str {
        match self {
            Platform::Linux64 => "x86_64-unknown-linux-gnu",
            Platform::Win64 => "x86_64-pc-windows-gnu",
            Platform::Aarch64Linux => "aarch64-unknown-linux-gnu",
        }
    }

    /// What cargo calls the shared library of a model.
    fn built_name(self, model: &str) -> String {
        match self {
            Platform::Win64 => format!("{model}.dll"),
            Platform::Linux64 | Platform::Aarch64Linux => format!("lib{model}.so"),
        }
    }

    /// What an FMU calls it.
    pub fn packed_name(self, model: &str) -> String {
        self.built_name(model).trim_start_matches("lib").to_owned()
    }
}

/// The two models: cargo package and modelIdentifier.
pub const MODELS: [(&str, &str); 2] =
    [("bess-controller-fmu", "BessConsensus"), ("bess-grid-fmu", "BessGrid")];

/// The shared libraries of both models for one platform.
pub struct Built {
    /// Which.
    pub platform: Platform,
    /// The files, in the order of [`MODELS`].
    pub files: Vec<PathBuf>,
}

impl Built {
    /// The two libraries that cargo left in a folder.
    pub fn in_folder(platform: Platform, folder: &Path) -> Built {
        let files = MODELS.iter().map(|(_, model)| folder.join(platform.built_name(model)));
        Built { platform, files: files.collect() }
    }
}

/// Builds both models for every platform that can be built here; says what is missing for the others.
///
/// Linux64 falls back to the plain build, which needs a newer glibc.
pub fn build_all(workspace: &Workspace) -> Result<Vec<Built>, Failure> {
    let zig = toolchain::zig(workspace);
    let mut all = Vec::new();
    for platform in Platform::ALL {
        match toolchain::find(platform, &zig) {
            Ok(toolchain) => all.push(build(workspace, platform, &toolchain)?),
            Err(missing) if Platform::here() == Some(platform) => {
                eprintln!("{}: only for this machine's glibc or newer: {missing}", platform.name());
                all.push(fmu::build_here(workspace, platform)?);
            }
            Err(missing) => eprintln!("{}: left out: {missing}", platform.name()),
        }
    }
    Ok(all)
}

/// Builds both models for one platform, in a target folder that only such builds use.
fn build(workspace: &Workspace, platform: Platform, toolchain: &Toolchain) -> Result<Built, Failure> {
    let target = workspace.platforms().join("build");
    // One call each, so that their features do not unify.
    for (package, _) in MODELS {
        let mut build = toolchain.build(workspace, platform);
        supply::remapped(&mut build, workspace, Some(platform), None)?;
        run(build.args(["--package", package, "--target-dir"]).arg(&target))?;
    }
    Ok(Built::in_folder(platform, &target.join(platform.triple()).join("release")))
}

/// The mock model of the FMI tests for the platforms that were built, and by the plain cargo, each as
/// target/platforms/mock/NAME: it can be told to panic, and so shows that the panic fence holds there.
pub fn mocks(workspace: &Workspace, built: &[Built]) -> Result<(), Failure> {
    let zig = toolchain::zig(workspace);
    let target = workspace.platforms().join("build");
    for one in built {
        let toolchain = toolchain::find(one.platform, &zig).map_err(Failure::Other)?;
        let build = toolchain.build(workspace, one.platform);
        mock(workspace, build, one.platform, &target.join(one.platform.triple()), one.platform.name())?;
    }
    let Some(here) = Platform::here() else { return Ok(()) };
    let mut plain = cargo(workspace);
    plain.args(["build", "--quiet", "--release"]);
    mock(workspace, plain, here, &target, "plain")
}

fn mock(
    workspace: &Workspace,
    mut build: Command,
    platform: Platform,
    built_in: &Path,
    name: &str,
) -> Result<(), Failure> {
    supply::remapped(&mut build, workspace, Some(platform), None)?;
    build.args(["--lib", "--manifest-path", "tests/fixtures/mock_fmu/Cargo.toml", "--target-dir"]);
    run(build.arg(workspace.platforms().join("build")))?;
    let folder = workspace.platforms().join("mock").join(name);
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let from = built_in.join("release").join(platform.built_name("Mock"));
    std::fs::copy(&from, folder.join(platform.packed_name("Mock"))).map_err(Failure::file("copy", &from))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_are_named_as_cargo_and_as_fmi_do() {
        let built = Built::in_folder(Platform::Linux64, Path::new("x"));
        assert_eq!(built.files, [Path::new("x/libBessConsensus.so"), Path::new("x/libBessGrid.so")]);
        assert_eq!(Platform::Aarch64Linux.packed_name("BessGrid"), "BessGrid.so");
        assert_eq!(Platform::Win64.packed_name("BessGrid"), "BessGrid.dll");
    }
}

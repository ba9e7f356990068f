//! What comes into the project from outside, and what goes out of it: pins, lock files, licences, advisories, the
//! bills of materials inside the FMUs, and whether a build can be repeated to the byte. Installs and updates nothing
//! of what it looks at.

mod deny;
mod pins;
mod reproduce;
mod sbom;

pub use deny::advisories;
pub use reproduce::{remapped, reproduce};
pub use sbom::write as write_sbom;

use crate::{
    error::Failure,
    process::{cargo, output, run},
    python,
    workspace::Workspace,
};

/// Every lock file that is checked in, by its Cargo.toml.
const LOCKED: [&str; 2] = ["Cargo.toml", "tests/fixtures/mock_fmu/Cargo.toml"];

/// The stage `supply`: all that can be judged without the database of advisories.
pub fn check(workspace: &Workspace) -> Result<(), Failure> {
    for manifest in LOCKED {
        let mut metadata = cargo(workspace);
        metadata.args(["metadata", "--locked", "--format-version", "1", "--manifest-path", manifest]);
        output(&mut metadata)?;
    }
    pins::check(workspace)?;
    deny::check(workspace)?;
    run(&mut python::tests(workspace, "supply", "supply")?)
}

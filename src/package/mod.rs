//! The `.fmu` archives: model description, shared library, resources, documentation, put together for one scenario.
#![forbid(unsafe_code)]

mod archive;
mod documentation;

use crate::fmi::lookup::RegistryError;
use crate::fmi::{Interface, Model, ModelError, model_description};
use crate::models::{Controller, Grid};
use crate::scenario::Resolved;
use archive::Entries;
use std::path::{Path, PathBuf};

/// Why an archive was not written.
#[derive(Debug, thiserror::Error)]
pub enum PackageError {
    /// The shared library of the FMU is not there.
    #[error("no shared library {} to put into the FMU", .file.display())]
    NoLibrary {
        /// Where it was looked for.
        file: PathBuf,
    },
    /// The shared library cannot be read.
    #[error("{}: cannot be read: {cause}", .file.display())]
    Read {
        /// The library.
        file: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// The archive cannot be written.
    #[error("{}: cannot be written: {cause}", .file.display())]
    Write {
        /// The archive.
        file: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// The archive cannot be put together.
    #[error("{}: cannot be packed: {cause}", .file.display())]
    Archive {
        /// The archive.
        file: PathBuf,
        /// What the zip library says.
        cause: String,
    },
    /// The model refuses the configuration.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The model's variables do not make an interface.
    #[error(transparent)]
    Interface(#[from] RegistryError),
}

/// FMI 2.0 name of the platform that this program runs on.
pub const PLATFORM: &str = if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
    "linux64"
} else if cfg!(all(target_os = "windows", target_arch = "x86_64")) {
    "win64"
} else if cfg!(all(target_os = "macos", target_arch = "x86_64")) {
    "darwin64"
} else if cfg!(all(target_os = "linux", target_arch = "aarch64")) {
    "aarch64-linux"
} else {
    "unknown"
};

/// What `cargo build` calls the shared library of a model on this platform.
pub fn library_file_name(identifier: &str) -> String {
    format!("{}{identifier}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX)
}

/// Writes `BessConsensus.fmu` for a scenario.
pub fn write_controller(path: &Path, resolved: &Resolved, libraries: &Path) -> Result<(), PackageError> {
    let resource = Controller::resource(resolved);
    let json = resource.to_json()?;
    write(
        path,
        &Controller::new(resource)?,
        (Controller::RESOURCE, json),
        &documentation::CONTROLLER,
        libraries,
    )
}

/// Writes `BessGrid.fmu` for a scenario.
pub fn write_grid(path: &Path, resolved: &Resolved, libraries: &Path) -> Result<(), PackageError> {
    let resource = Grid::resource(resolved);
    let json = resource.to_json()?;
    write(path, &Grid::new(resource)?, (Grid::RESOURCE, json), &documentation::GRID, libraries)
}

fn write<M: Model>(
    path: &Path,
    model: &M,
    (resource, json): (&str, Vec<u8>),
    papers: &documentation::Papers,
    libraries: &Path,
) -> Result<(), PackageError> {
    let library = libraries.join(library_file_name(M::IDENTIFIER));
    if !library.is_file() {
        return Err(PackageError::NoLibrary { file: library });
    }
    let bytes =
        std::fs::read(&library).map_err(|cause| PackageError::Read { file: library.clone(), cause })?;
    let name = format!("{}{}", M::IDENTIFIER, std::env::consts::DLL_SUFFIX);
    let mut entries: Entries = [
        (
            "modelDescription.xml".to_owned(),
            model_description::write(model, Interface::Structured)?.into_bytes(),
        ),
        (format!("binaries/{PLATFORM}/{name}"), bytes),
        (format!("resources/{resource}"), json),
    ]
    .into();
    entries.extend(documentation::entries(model, Interface::Structured, papers)?);
    archive::write(path, &entries)
}

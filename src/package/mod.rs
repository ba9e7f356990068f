//! The `.fmu` archives: model description, shared library, resources, documentation, put together for one
//! scenario; and the `.ssp` archive of both, connected.
#![forbid(unsafe_code)]

mod archive;
mod documentation;
mod libraries;
mod system;
mod three;

use crate::fmi::lookup::RegistryError;
use crate::fmi::{Interface, Model, ModelError, model_description};
use crate::models::{Controller, ControllerResource, Grid};
use crate::scenario::Resolved;
use archive::Entries;
pub use libraries::{Libraries, PLATFORM, library_file_name};
use std::path::{Path, PathBuf};

pub use system::{SystemError, write_parts, write_system};
pub use three::{platform_3, write_controller_3, write_controller_3_of, write_grid_3};

/// Why an archive was not written.
#[derive(Debug, thiserror::Error)]
pub enum PackageError {
    /// The shared library of the FMU is not there.
    #[error("no shared library {} to put into the FMU", .file.display())]
    NoLibrary {
        /// Where it was looked for.
        file: PathBuf,
    },
    /// The program carries no shared library of the model.
    #[error("this program carries no shared library of {model} to put into the FMU")]
    NotCarried {
        /// Its modelIdentifier.
        model: String,
    },
    /// The archive of shared libraries inside the program cannot be read.
    #[error("the shared libraries that this program carries cannot be read: {cause}")]
    Damaged {
        /// What the zip library says.
        cause: String,
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
    /// The scenario's values or connections do not fit the FMUs.
    #[error(transparent)]
    System(#[from] SystemError),
}

/// Writes `BessConsensus.fmu` for a scenario.
pub fn write_controller(
    path: &Path,
    resolved: &Resolved,
    interface: Interface,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    archive::write(path, &controller(resolved, interface, libraries)?.1)
}

/// Writes `BessConsensus.fmu` for a configuration that no scenario has to lead to: of batteries without a grid.
pub fn write_controller_of(
    path: &Path,
    resource: ControllerResource,
    interface: Interface,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    archive::write(path, &controller_of(resource, interface, libraries)?.1)
}

/// Writes `BessGrid.fmu` for a scenario.
pub fn write_grid(
    path: &Path,
    resolved: &Resolved,
    interface: Interface,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    archive::write(path, &grid(resolved, interface, libraries)?.1)
}

fn controller(
    resolved: &Resolved,
    interface: Interface,
    libraries: &Libraries,
) -> Result<(Controller, Entries), PackageError> {
    controller_of(Controller::resource(resolved), interface, libraries)
}

fn controller_of(
    resource: ControllerResource,
    interface: Interface,
    libraries: &Libraries,
) -> Result<(Controller, Entries), PackageError> {
    let json = resource.to_json()?;
    let model = Controller::new(resource)?;
    let entries =
        entries(&model, interface, (Controller::RESOURCE, json), &documentation::CONTROLLER, libraries)?;
    Ok((model, entries))
}

fn grid(
    resolved: &Resolved,
    interface: Interface,
    libraries: &Libraries,
) -> Result<(Grid, Entries), PackageError> {
    let resource = Grid::resource(resolved)?;
    let json = resource.to_json()?;
    let model = Grid::new(resource)?;
    let entries = entries(&model, interface, (Grid::RESOURCE, json), &documentation::GRID, libraries)?;
    Ok((model, entries))
}

/// What an `.fmu` holds.
fn entries<M: Model>(
    model: &M,
    interface: Interface,
    (resource, json): (&str, Vec<u8>),
    papers: &documentation::Papers,
    libraries: &Libraries,
) -> Result<Entries, PackageError> {
    let mut entries: Entries = [
        ("modelDescription.xml".to_owned(), model_description::write(model, interface)?.into_bytes()),
        (format!("resources/{resource}"), json),
    ]
    .into();
    entries.extend(libraries.of(M::IDENTIFIER)?);
    entries.extend(documentation::entries(model, interface, papers)?);
    Ok(entries)
}

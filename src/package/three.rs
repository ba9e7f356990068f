//! The `.fmu` archives of FMI 3.0: the same shared libraries, resources and papers under the names of that standard.

use super::archive::{self, Entries};
use super::{Libraries, PackageError, documentation};
use crate::fmi::{Model, three};
use crate::models::{Controller, ControllerResource, Grid};
use crate::scenario::Resolved;
use std::path::Path;

/// FMI 2.0 platform folders with those of FMI 3.0.
const PLATFORMS: [(&str, &str); 4] = [
    ("linux64", "x86_64-linux"),
    ("win64", "x86_64-windows"),
    ("darwin64", "x86_64-darwin"),
    ("aarch64-linux", "aarch64-linux"),
];

/// FMI 3.0's name of a platform that FMI 2.0 calls `two`.
pub fn platform_3(two: &'static str) -> &'static str {
    PLATFORMS.iter().find(|(name, _)| *name == two).map_or(two, |(_, three)| three)
}

/// Writes the controller of a scenario as FMI 3.0.
pub fn write_controller_3(
    path: &Path,
    resolved: &Resolved,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    write_controller_3_of(path, Controller::resource(resolved), libraries)
}

/// The same of a configuration that no scenario has to lead to.
pub fn write_controller_3_of(
    path: &Path,
    resource: ControllerResource,
    libraries: &Libraries,
) -> Result<(), PackageError> {
    let json = resource.to_json()?;
    let model = Controller::new(resource)?;
    let papers = &documentation::CONTROLLER;
    archive::write(path, &entries(&model, (Controller::RESOURCE, json), papers, libraries)?)
}

/// Writes the grid of a scenario as FMI 3.0.
pub fn write_grid_3(path: &Path, resolved: &Resolved, libraries: &Libraries) -> Result<(), PackageError> {
    let resource = Grid::resource(resolved)?;
    let json = resource.to_json()?;
    let model = Grid::new(resource)?;
    archive::write(path, &entries(&model, (Grid::RESOURCE, json), &documentation::GRID, libraries)?)
}

fn entries<M: Model>(
    model: &M,
    (resource, json): (&str, Vec<u8>),
    papers: &documentation::Papers,
    libraries: &Libraries,
) -> Result<Entries, PackageError> {
    let mut entries: Entries = [
        ("modelDescription.xml".to_owned(), three::model_description::write(model)?.into_bytes()),
        (format!("resources/{resource}"), json),
    ]
    .into();
    for (name, library) in libraries.of(M::IDENTIFIER)? {
        entries.insert(renamed(&name), library);
    }
    entries.extend(documentation::three::entries(model, papers)?);
    Ok(entries)
}

/// `binaries/linux64/X.so` as `binaries/x86_64-linux/X.so`.
fn renamed(name: &str) -> String {
    let inside = |folder: &str| format!("binaries/{folder}/");
    let found = PLATFORMS.iter().find_map(|(two, three)| {
        name.strip_prefix(&inside(two)).map(|file| format!("{}{file}", inside(three)))
    });
    found.unwrap_or_else(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_stand_where_fmi_3_looks_for_them() {
        for (two, three) in [
            ("binaries/linux64/X.so", "binaries/x86_64-linux/X.so"),
            ("binaries/win64/X.dll", "binaries/x86_64-windows/X.dll"),
            ("binaries/aarch64-linux/X.so", "binaries/aarch64-linux/X.so"),
        ] {
            assert_eq!(renamed(two), three);
        }
    }
}

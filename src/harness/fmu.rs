//! An FMU file, opened: unpacked, described, its library loaded. Makes instances.

use super::archive::{Limits, Unpacked, unpack};
use super::description::{DescriptionError, ModelDescription};
use super::error::HarnessError;
use super::hash::Fnv64;
use super::library::LoadedLibrary;
use super::logger::LogTarget;
use super::participant::CallError;
use super::slave::Slave;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

/// An opened FMU; instances keep what they need of it alive.
pub struct Fmu {
    parts: Rc<Parts>,
}

/// Dropped in this order: the library before the folder that holds its file.
pub(super) struct Parts {
    pub library: LoadedLibrary,
    pub description: ModelDescription,
    pub folder: Unpacked,
    pub path: PathBuf,
}

/// GUID and hash of the whole archive: equal where a state of one FMU means the same to the other.
pub(super) fn identity(guid: &str, path: &Path) -> String {
    match Fnv64::of_file(path, u64::MAX) {
        Ok((hash, _)) => format!("{guid}, archive {:016x}", hash.value()),
        Err(error) => format!("{guid}, archive not readable ({error})"),
    }
}

impl Fmu {
    /// Unpacks and loads an FMU with the default limits.
    pub fn open(path: &Path) -> Result<Self, HarnessError> {
        Self::open_with(path, Limits::default())
    }

    /// Unpacks and loads an FMU.
    pub fn open_with(path: &Path, limits: Limits) -> Result<Self, HarnessError> {
        let folder = unpack(path, limits)?;
        let inside = folder.path().join("modelDescription.xml");
        // The archive is what the user knows; where it was unpacked is gone by the time this is read.
        let description = ModelDescription::read(&inside)
            .map_err(|error| DescriptionError { path: path.join("modelDescription.xml"), ..error })?;
        let library = LoadedLibrary::load(folder.path(), &description)?;
        Ok(Self { parts: Rc::new(Parts { library, description, folder, path: path.to_path_buf() }) })
    }

    /// Loads an FMU that another process has unpacked from `path` into `folder` and will delete.
    pub(super) fn adopt(folder: &Path, path: &Path) -> Result<Self, HarnessError> {
        let description = ModelDescription::read(&folder.join("modelDescription.xml"))?;
        let library = LoadedLibrary::load(folder, &description)?;
        let folder = Unpacked::borrowed(folder);
        Ok(Self { parts: Rc::new(Parts { library, description, folder, path: path.to_path_buf() }) })
    }

    /// What the FMU says of itself.
    pub fn description(&self) -> &ModelDescription {
        &self.parts.description
    }

    /// A new instance, silent but for errors.
    pub fn instantiate(&self, name: &str) -> Result<Slave, HarnessError> {
        self.instantiate_with(name, false, None)
    }

    /// A new instance whose log lines go to `target` as they come; `logging_on` asks the FMU for its
    /// events too.
    pub fn instantiate_with(
        &self,
        name: &str,
        logging_on: bool,
        target: Option<Arc<LogTarget>>,
    ) -> Result<Slave, HarnessError> {
        // Each living instance holds one reference.
        if self.parts.description.capabilities.can_be_instantiated_only_once
            && Rc::strong_count(&self.parts) > 1
        {
            let reason = format!(
                "{} says canBeInstantiatedOnlyOncePerProcess and one instance lives; drop that one first",
                self.parts.path.display()
            );
            return Err(HarnessError::Call {
                participant: name.to_owned(),
                source: CallError::new("fmi2Instantiate", reason),
            });
        }
        Slave::new(Rc::clone(&self.parts), name, logging_on, target)
            .map_err(|source| HarnessError::Call { participant: name.to_owned(), source })
    }

    /// The only instance of its process.
    pub(super) fn instance(&self, name: &str, target: Arc<LogTarget>) -> Result<Slave, CallError> {
        Slave::new(Rc::clone(&self.parts), name, false, Some(target))
    }
}

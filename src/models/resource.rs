//! The one file in an FMU's `resources/` folder that makes the model: a configuration and the experiment it
//! was made for.

use crate::fmi::ModelError;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::path::Path;

/// Contents of `resources/controller.json` or `resources/grid.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resource<C> {
    /// Stop time that the scenario proposes, s.
    pub stop_s: f64,
    /// Communication step that the scenario proposes, s.
    pub step_s: f64,
    /// The configuration of the model.
    pub config: C,
}

impl<C: Serialize + DeserializeOwned> Resource<C> {
    /// Reads it from the folder; the error names the file and what is wrong with it.
    pub fn load(resources: &Path, file: &str) -> Result<Self, ModelError> {
        let path = resources.join(file);
        let text = std::fs::read_to_string(&path).map_err(|e| {
            ModelError::new(format!("{}: {e}; the FMU must be unpacked with its resources", path.display()))
        })?;
        serde_json::from_str(&text).map_err(|e| ModelError::new(format!("{}: {e}", path.display())))
    }

    /// The bytes to put into the archive.
    pub fn to_json(&self) -> Result<Vec<u8>, ModelError> {
        serde_json::to_vec_pretty(self).map_err(|e| ModelError::new(e.to_string()))
    }
}

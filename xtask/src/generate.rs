//! Writes the generated files that are checked in.

use crate::{
    bindings,
    error::Failure,
    fmu::{self, CONTROLLER, CONTROLLER_3, GRID, GRID_3},
    licenses,
    process::{cargo, command, output, run as start},
    supply,
    workspace::Workspace,
};
use clap::ValueEnum;

/// A kind of generated file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Generated {
    /// src/fmi/bindings.rs and src/fmi/three/bindings.rs, from src/fmi/headers; needs libclang.
    Bindings,
    /// src/package/icons/*.png, from the drawings beside them.
    Icons,
    /// src/package/licenses/Bess*.txt, from cargo's dependency tree.
    Licenses,
    /// docs/mistakes.md, by making every mistake.
    Mistakes,
    /// src/package/sbom/*.cdx.json, from cargo's dependency tree and Cargo.lock.
    Sbom,
    /// modelDescription/*.xml, out of the packed FMUs.
    ModelDescription,
    /// schema/scenario.schema.json, from `bess schema`.
    Schema,
}

/// Writes what is asked for; all, if nothing is named.
pub fn run(workspace: &Workspace, what: &[Generated]) -> Result<(), Failure> {
    let wanted = |one| what.is_empty() || what.contains(&one);
    if wanted(Generated::Bindings) {
        bindings::write(workspace)?;
    }
    if wanted(Generated::Icons) {
        let mut test = cargo(workspace);
        test.args(["test", "--quiet", "--release", "--test", "package_icons"]);
        start(test.env("BESS_WRITE_ICONS", "1"))?;
    }
    if wanted(Generated::Licenses) {
        licenses::write(workspace)?;
    }
    if wanted(Generated::Mistakes) {
        let mut test = cargo(workspace);
        test.args(["test", "--quiet", "--release", "--test", "mistakes"]);
        start(test.env("BESS_WRITE_MISTAKES", "1"))?;
    }
    if wanted(Generated::Sbom) {
        supply::write_sbom(workspace)?;
    }
    if wanted(Generated::ModelDescription) || wanted(Generated::Schema) {
        fmu::build_and_pack(workspace)?;
    }
    if wanted(Generated::ModelDescription) {
        model_descriptions(workspace)?;
    }
    if wanted(Generated::Schema) {
        schema(workspace)?;
    }
    Ok(())
}

/// Takes each modelDescription.xml out of its archive, so that the files are those that a user gets.
fn model_descriptions(workspace: &Workspace) -> Result<(), Failure> {
    let folder = workspace.root.join("modelDescription");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    for (archive, name) in [
        (CONTROLLER, "BessConsensus"),
        (GRID, "BessGrid"),
        (CONTROLLER_3, "BessConsensus.fmi3"),
        (GRID_3, "BessGrid.fmi3"),
    ] {
        let unpacked = workspace.target.join("unpacked").join(name);
        start(command(workspace, "python3").args(["-m", "zipfile", "-e", archive]).arg(&unpacked))?;
        let (from, to) = (unpacked.join("modelDescription.xml"), folder.join(format!("{name}.xml")));
        std::fs::copy(&from, &to).map_err(Failure::file("copy", &from))?;
        println!("modelDescription/{name}.xml");
    }
    Ok(())
}

/// Writes down what `bess schema` prints.
fn schema(workspace: &Workspace) -> Result<(), Failure> {
    let text = output(command(workspace, workspace.bess()).arg("schema"))?;
    let folder = workspace.root.join("schema");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let file = folder.join("scenario.schema.json");
    std::fs::write(&file, text).map_err(Failure::file("write", &file))?;
    println!("schema/scenario.schema.json");
    Ok(())
}

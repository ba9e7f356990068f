//! No call takes for ever: a step that nobody can mean is refused after a bounded effort, and changes nothing.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

use bess_consensus::fmi::{Instance, Interface, Logger, Model};
use bess_consensus::models::Grid;

#[test]
fn a_step_of_a_century_is_refused_by_the_grid_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let json = include_str!("../resources/grid_plain.json");
    std::fs::write(folder.path().join(Grid::RESOURCE), json).unwrap();
    let grid = Grid::load(folder.path()).unwrap();
    let mut instance = Instance::from_model("grid", grid, Interface::Structured, Logger::silent()).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    let bytes = |instance: &Instance<Grid>| instance.serialize(&instance.snapshot().unwrap()).unwrap();
    let before = bytes(&instance);
    let text = instance.do_step(0.0, 3.2e9).unwrap_err().to_string();
    assert!(text.contains("fmi2DoStep") && text.contains("2000000") && text.contains("expected"), "{text}");
    assert!(bytes(&instance) == before);
    // An hour is one that somebody may mean.
    instance.do_step(0.0, 3600.0).unwrap();
}

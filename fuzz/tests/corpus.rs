//! The corpus of the coverage-guided target, played again: what once was a finding stays one test.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]

use bess_fuzz::fmus;
use bess_fuzz::stranger::Stranger;
use bess_fuzz::tally::Tally;
use bess_fuzz::world::World;
use std::path::Path;

#[test]
fn the_corpus_holds_no_finding_and_stays_small() {
    let fmus = [fmus::controller().unwrap(), fmus::grid().unwrap()];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let (mut size, mut total) = (0, Tally::default());
    for entry in std::fs::read_dir(&folder).unwrap() {
        let bytes = std::fs::read(entry.unwrap().path()).unwrap();
        size += bytes.len();
        let Some((which, calls)) = bytes.split_first() else { continue };
        let stranger = Stranger::of(&fmus[usize::from(1 - which % 2)]);
        total.add(&World::play(&fmus[usize::from(which % 2)], stranger.state(), calls, false));
    }
    println!("{total}");
    assert!(total.calls() > 1000, "{} has no corpus", folder.display());
    assert!(size < 200_000, "{size} bytes; expected a minimised corpus");
}

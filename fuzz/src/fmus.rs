//! The two FMUs as subjects: small exports, so that millions of calls take minutes, with between them every option
//! of the configuration; and the 57-bus system.

use crate::subject::{Subject, Traits};
use bess_consensus::models::{Controller, Grid};

/// The folder's one file, for each export.
macro_rules! resources {
    ($($name:literal),*) => { [$(include_bytes!(concat!("../resources/", $name, ".json")).to_vec()),*] };
}

/// `BessConsensus.fmu`: graphs written out without options; every limit, filter and loss at once; the average voltage
/// with delays and the bare law.
pub fn controller() -> Result<Subject, String> {
    let traits = Traits { checks_states: true, longest_step_s: 9e9, ..Traits::default() };
    let exports = resources!["controller_plain", "controller_limits", "controller_average"];
    Subject::new::<Controller>(Controller::RESOURCE, &exports, traits)
}

/// `BessGrid.fmu`: three buses with a tie; the same with ZIP loads, solved sparse; the 57-bus system.
pub fn grid() -> Result<Subject, String> {
    let traits =
        Traits { may_refuse: true, checks_states: true, large: 1, longest_step_s: 20.0, ..Traits::default() };
    let exports = resources!["grid_plain", "grid_zip", "grid_57"];
    Subject::new::<Grid>(Grid::RESOURCE, &exports, traits)
}

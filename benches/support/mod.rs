//! What the bench programs do; separate from their command lines.

mod dynamics;
mod options;
mod parts;
mod power_flow;

pub use dynamics::dynamics;
pub use parts::parts;
pub use power_flow::power_flow;

use bess_consensus::grid::Case;
pub use options::{Options, option, options, program};

/// A built-in case or a file.
pub fn case(name: &str) -> Result<Case, String> {
    if Case::BUILT_IN.contains(&name) {
        return Case::built_in(name).map_err(|e| e.to_string());
    }
    let text = std::fs::read_to_string(name).map_err(|e| format!("{name}: {e}"))?;
    Case::from_matpower(&text).map_err(|e| format!("{name}: {e}"))
}

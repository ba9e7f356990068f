//! What the bench programs do; separate from their command lines.

mod dynamics;
mod power_flow;

pub use dynamics::dynamics;
pub use power_flow::power_flow;

use bess_consensus::grid::Case;
use std::collections::BTreeMap;

/// `--name value` pairs.
pub type Options = BTreeMap<String, String>;

/// Reads `--name value` pairs.
pub fn options(words: &[&str]) -> Result<Options, String> {
    words
        .chunks(2)
        .map(|pair| match pair {
            [name, value] if name.starts_with("--") => Ok((name[2..].to_owned(), (*value).to_owned())),
            _ => Err(format!("found `{}`; expected --option value", pair.join(" "))),
        })
        .collect()
}

/// The value of an option.
pub fn option<T: std::str::FromStr>(options: &Options, name: &str, default: T) -> Result<T, String> {
    match options.get(name) {
        None => Ok(default),
        Some(text) => text.parse().map_err(|_| format!("--{name}: found `{text}`")),
    }
}

/// A built-in case or a file.
pub fn case(name: &str) -> Result<Case, String> {
    if Case::BUILT_IN.contains(&name) {
        return Case::built_in(name).map_err(|e| e.to_string());
    }
    let text = std::fs::read_to_string(name).map_err(|e| format!("{name}: {e}"))?;
    Case::from_matpower(&text).map_err(|e| format!("{name}: {e}"))
}

//! `--name value` pairs of the bench programs.

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

//! The command line of the bench programs: a task, `--name value` pairs, one line of JSON as the result.

use std::collections::BTreeMap;
use std::process::ExitCode;

/// Runs a program: `task` is given the words of the command line and gives back the line to print.
pub fn program(task: impl FnOnce(&[&str]) -> Result<String, String>) -> ExitCode {
    // Cargo passes --bench on.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match task(&words) {
        Ok(line) => {
            println!("{line}");
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

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

//! The bench programs of this repository (benches/*.rs): built in release, no native target, and run.

use crate::{
    error::Failure,
    process::{cargo, command, output},
    workspace::Workspace,
};
use serde_json::Value;
use std::path::PathBuf;

/// Builds a program and gives back where it is.
pub fn build(workspace: &Workspace, name: &str) -> Result<PathBuf, Failure> {
    let mut build = cargo(workspace);
    build.args(["build", "--release", "--bench", name, "--message-format", "json-render-diagnostics"]);
    let messages = output(&mut build)?;
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .filter(|message| message["target"]["name"] == name && message["target"]["kind"][0] == "bench")
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .ok_or_else(|| Failure::Other(format!("cargo built no bench program `{name}`")))
}

/// Runs the program; it prints one line of JSON.
pub fn measure(workspace: &Workspace, program: &PathBuf, arguments: &[&str]) -> Result<Value, Failure> {
    last_line(&output(command(workspace, program).args(arguments))?)
}

/// The last line of a program's output as JSON.
pub fn last_line(text: &str) -> Result<Value, Failure> {
    let line = text.lines().rev().find(|line| line.starts_with('{')).unwrap_or_default();
    serde_json::from_str(line).map_err(|_| Failure::Other(format!("expected a line of JSON, found `{text}`")))
}

/// A number in it.
pub fn number(value: &Value, key: &str) -> Result<f64, Failure> {
    value[key].as_f64().ok_or_else(|| Failure::Other(format!("no number `{key}` in {value}")))
}

/// The median of numbers in it.
pub fn median_of(value: &Value, key: &str) -> f64 {
    let numbers = value[key].as_array().map(|all| all.iter().filter_map(Value::as_f64).collect());
    super::row::median(numbers.unwrap_or_default())
}

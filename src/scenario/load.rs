//! From a file or a built-in name to a [`Scenario`]; shapes are checked here, with the place of what is wrong.

use super::document::Scenario;
use super::error::ScenarioError;
use super::extends;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// The scenarios that the program carries: name and document.
pub const BUILT_IN: [(&str, &str); 8] = [
    ("case1", include_str!("built_in/case1.json")),
    ("case2", include_str!("built_in/case2.json")),
    ("case3", include_str!("built_in/case3.json")),
    ("case4", include_str!("built_in/case4.json")),
    ("plug_and_play", include_str!("built_in/plug_and_play.json")),
    ("voltage", include_str!("built_in/voltage.json")),
    ("energy", include_str!("built_in/energy.json")),
    ("faults", include_str!("built_in/faults.json")),
];

/// A document with its place, so that paths in it can be resolved and errors can name it.
#[derive(Clone, Debug)]
pub struct Source {
    /// File path or built-in name, for messages.
    pub origin: String,
    /// Folder that relative paths in the document start from.
    pub folder: PathBuf,
    /// The document itself.
    pub text: String,
}

/// Finds a scenario: a built-in name, else a file.
pub fn find(name: &str) -> Result<Source, ScenarioError> {
    if let Some((_, text)) = BUILT_IN.iter().find(|(built_in, _)| *built_in == name) {
        return Ok(Source { origin: name.into(), folder: PathBuf::from("."), text: (*text).into() });
    }
    let file = Path::new(name);
    if !file.exists() {
        let built_in = BUILT_IN.iter().map(|(name, _)| *name).collect();
        return Err(ScenarioError::Unknown { name: name.into(), built_in });
    }
    let text = std::fs::read_to_string(file)
        .map_err(|cause| ScenarioError::Unreadable { file: file.into(), cause })?;
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok(Source { origin: name.into(), folder: folder.into(), text })
}

/// Reads the document, merged into the scenario that it extends, with the keys in `set` (`"control.eta"`,
/// `"bess[2].K_P"`) in place of its own.
pub fn read(source: &Source, set: &Map<String, Value>) -> Result<Scenario, ScenarioError> {
    let trailing = |e: serde_json::Error| trailing_error(&source.origin, &e);
    let parsed: Result<Value, serde_json::Error> = serde_json::from_str(&source.text);
    if let Ok(document) = &parsed
        && document.get(extends::KEY).is_some_and(|base| !base.is_null())
    {
        if let Some(error) = extends::check_patch(source) {
            return Err(document_error(&source.origin, &error));
        }
        return typed(source, extends::merged(source, document.clone())?, set);
    }
    let mut text = serde_json::Deserializer::from_str(&source.text);
    let scenario: Scenario = serde_path_to_error::deserialize(&mut text)
        .map_err(|e| document_error(&source.origin, &e))
        .and_then(|scenario| text.end().map(|()| scenario).map_err(trailing))?;
    if set.is_empty() { Ok(scenario) } else { typed(source, parsed.map_err(trailing)?, set) }
}

/// A whole document with changed keys as a scenario.
fn typed(source: &Source, mut document: Value, set: &Map<String, Value>) -> Result<Scenario, ScenarioError> {
    if let Some(base) = set.get(extends::KEY) {
        return Err(ScenarioError::Value {
            origin: source.origin.clone(),
            path: extends::KEY.into(),
            found: format!("{base} among the changed keys"),
            expected: "it in a document: a base is merged in before keys are changed".into(),
        });
    }
    for (path, value) in set {
        replace(&mut document, path, value.clone()).map_err(|(found, expected)| ScenarioError::Value {
            origin: source.origin.clone(),
            path: path.clone(),
            found,
            expected,
        })?;
    }
    let origin =
        if set.is_empty() { source.origin.clone() } else { format!("{} with changed keys", source.origin) };
    serde_path_to_error::deserialize(document).map_err(|e| document_error(&origin, &e))
}

/// `control.eta=0.3` as a path and a JSON value; what is no JSON is taken as a string.
pub fn parse_assignment(text: &str) -> Result<(String, Value), String> {
    let (path, value) = text
        .split_once('=')
        .ok_or_else(|| format!("found `{text}`, expected PATH=VALUE, as control.eta=0.3"))?;
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.into()));
    Ok((path.trim().into(), value))
}

fn document_error<E: std::fmt::Display>(
    origin: &str,
    error: &serde_path_to_error::Error<E>,
) -> ScenarioError {
    let path = error.path().to_string();
    let path = if path == "." { "the document".into() } else { path };
    ScenarioError::Document { origin: origin.into(), path, problem: in_words(&error.inner().to_string()) }
}

/// JSON knows numbers, and a user of JSON knows no names of Rust's types.
fn in_words(problem: &str) -> String {
    let mut words = problem.to_owned();
    for (name, meaning) in [("f64", "a number"), ("u64", "a whole number"), ("u32", "a whole number")] {
        words = words.replace(&format!("expected {name}"), &format!("expected {meaning}"));
    }
    words
}

fn trailing_error(origin: &str, error: &serde_json::Error) -> ScenarioError {
    ScenarioError::Document { origin: origin.into(), path: "the document".into(), problem: error.to_string() }
}

/// Puts `value` at `path`; objects on the way are made, array elements must exist.
/// Fails with (found, expected).
fn replace(document: &mut Value, path: &str, value: Value) -> Result<(), (String, String)> {
    let mut place = document;
    for segment in path.split('.') {
        let (key, indices) = segment.split_once('[').map_or((segment, None), |(k, rest)| (k, Some(rest)));
        let Value::Object(object) = place else {
            return Err((kind(place).into(), format!("an object that holds `{key}`")));
        };
        place = object.entry(key).or_insert_with(|| Value::Object(Map::new()));
        for index in indices.into_iter().flat_map(|rest| rest.trim_end_matches(']').split("][")) {
            let length = place.as_array().map_or(0, Vec::len);
            place =
                index.parse::<usize>().ok().and_then(|i| place.as_array_mut()?.get_mut(i)).ok_or_else(
                    || (format!("index `{index}`"), format!("0 to {}", length.saturating_sub(1))),
                )?;
        }
    }
    *place = value;
    Ok(())
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

impl Scenario {
    /// Reads a scenario with no key changed.
    pub fn load(name: &str) -> Result<(Source, Scenario), ScenarioError> {
        let source = find(name)?;
        let scenario = read(&source, &Map::new())?;
        Ok((source, scenario))
    }
}

//! `"extends"`: a scenario as a JSON merge patch (RFC 7396) on another one, which is a built-in name or a file.
//! Merges documents only; what they mean is checked elsewhere.

use super::document::Scenario;
use super::error::ScenarioError;
use super::load::{BUILT_IN, Source, find};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// The key that names the base.
pub(super) const KEY: &str = "extends";

/// The document with its bases merged in and without the key `extends`.
pub(super) fn merged(source: &Source, document: Value) -> Result<Value, ScenarioError> {
    resolve(source, document, &mut vec![identity(source)])
}

fn resolve(source: &Source, document: Value, chain: &mut Vec<String>) -> Result<Value, ScenarioError> {
    let Value::Object(mut patch) = document else { return Ok(document) };
    let name = match patch.remove(KEY) {
        None | Some(Value::Null) => return Ok(Value::Object(patch)),
        Some(Value::String(name)) => name,
        Some(other) => {
            return Err(wrong(
                source,
                other.to_string(),
                "the name of a built-in scenario or of a JSON file",
            ));
        }
    };
    let base = base_of(source, &name)?;
    let known = identity(&base);
    let repeats = chain.contains(&known);
    chain.push(known);
    if repeats {
        let found = format!("a circle: {}", chain.join(" extends "));
        return Err(wrong(source, found, "a scenario that does not come back to itself"));
    }
    let text = serde_json::from_str(&base.text).map_err(|error| ScenarioError::Document {
        origin: base.origin.clone(),
        path: "the document".into(),
        problem: error.to_string(),
    })?;
    let mut below = resolve(&base, text, chain)?;
    if base.folder != source.folder {
        anchor_files(&mut below, &base.folder);
    }
    merge(&mut below, Value::Object(patch));
    Ok(below)
}

/// The base: a built-in name first, as everywhere, then beside the document that names it, else as [`find`] knows it.
fn base_of(source: &Source, name: &str) -> Result<Source, ScenarioError> {
    let is_built_in = BUILT_IN.iter().any(|(built_in, _)| *built_in == name);
    let beside = source.folder.join(name);
    if !is_built_in && beside.is_file() { find(&beside.to_string_lossy()) } else { find(name) }
}

/// What a document is known by, so that a circle is seen however its files are spelt.
fn identity(source: &Source) -> String {
    let path = Path::new(&source.origin);
    path.canonicalize().map_or_else(|_| source.origin.clone(), |path| path.display().to_string())
}

/// The keys that name files.
const FILES: [(&str, &str); 3] = [("grid", "case"), ("grid", "fmu"), ("control", "fmu")];

/// A relative case file or FMU goes on meaning the file beside the base, in its variants too.
fn anchor_files(document: &mut Value, folder: &Path) {
    for (part, key) in FILES {
        if let Some(file) = document.get_mut(part).and_then(|part| part.get_mut(key)) {
            anchor(file, key, folder);
        }
    }
    let variants = document.get_mut("compare").and_then(Value::as_array_mut);
    for set in variants.into_iter().flatten().filter_map(|variant| variant.get_mut("set")) {
        anchor_files(set, folder);
        for (part, key) in FILES {
            if let Some(file) = set.get_mut(format!("{part}.{key}")) {
                anchor(file, key, folder);
            }
        }
    }
}

fn anchor(file: &mut Value, key: &str, folder: &Path) {
    let Value::String(name) = file else { return };
    // A case may also be one that the program knows.
    if key == "fmu" || name.ends_with(".json") || name.ends_with(".m") {
        let file: PathBuf = folder.join(&*name);
        *name = std::path::absolute(&file).unwrap_or(file).to_string_lossy().into_owned();
    }
}

/// RFC 7396: objects are merged key by key, null removes a key, anything else replaces.
fn merge(target: &mut Value, patch: Value) {
    let Value::Object(patch) = patch else {
        *target = patch;
        return;
    };
    if !target.is_object() {
        *target = Value::Object(Map::new());
    }
    let Value::Object(target) = target else { return };
    for (key, value) in patch {
        if value.is_null() {
            target.remove(&key);
        } else {
            merge(target.entry(key).or_insert(Value::Null), value);
        }
    }
}

/// Reads a patch for its own sake, so that a wrong key or type in it is reported with line and column. What
/// only a patch may hold is let through: a key that the base gives, a null that removes one.
pub(super) fn check_patch(source: &Source) -> Option<serde_path_to_error::Error<serde_json::Error>> {
    let mut text = serde_json::Deserializer::from_str(&source.text);
    let error = serde_path_to_error::deserialize::<_, Scenario>(&mut text).err()?;
    let problem = error.inner().to_string();
    let of_patch = problem.starts_with("missing field") || problem.starts_with("invalid type: null");
    (!of_patch).then_some(error)
}

fn wrong(source: &Source, found: String, expected: &str) -> ScenarioError {
    ScenarioError::Value { origin: source.origin.clone(), path: KEY.into(), found, expected: expected.into() }
}

#[cfg(test)]
mod tests {
    use super::merge;
    use serde_json::{Value, json};

    fn merged(mut base: Value, patch: Value) -> Value {
        merge(&mut base, patch);
        base
    }

    #[test]
    fn the_examples_of_the_rfc_come_out() {
        // RFC 7396, appendix A.
        for (base, patch, result) in [
            (json!({"a": "b"}), json!({"a": "c"}), json!({"a": "c"})),
            (json!({"a": "b"}), json!({"b": "c"}), json!({"a": "b", "b": "c"})),
            (json!({"a": "b", "b": "c"}), json!({"a": null}), json!({"b": "c"})),
            (json!({"a": ["b"]}), json!({"a": "c"}), json!({"a": "c"})),
            (json!({"a": "c"}), json!({"a": ["b"]}), json!({"a": ["b"]})),
            (json!({"a": {"b": "c"}}), json!({"a": {"b": "d", "c": null}}), json!({"a": {"b": "d"}})),
            (json!({"a": [{"b": "c"}]}), json!({"a": [1]}), json!({"a": [1]})),
            (json!(["a", "b"]), json!(["c", "d"]), json!(["c", "d"])),
            (json!({"e": null}), json!({"a": 1}), json!({"e": null, "a": 1})),
            (json!({}), json!({"a": {"bb": {"ccc": null}}}), json!({"a": {"bb": {}}})),
        ] {
            assert_eq!(merged(base, patch), result);
        }
    }
}

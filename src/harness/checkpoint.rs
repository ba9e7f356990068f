//! A checkpoint on disk: whose run it is, where that run stood, and how far its files had come. There is always a whole
//! one; refused where it is damaged or belongs to another run.

use super::csv::Mark;
use super::hash::Fnv64;
use super::master::Position;
use super::participant::Participant;
use super::whole::write_whole;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Name of the file, in the folder of the results.
pub const CHECKPOINT: &str = "checkpoint.bin";

/// What the file begins with; the digit is the version of the format.
const MAGIC: &[u8; 16] = b"bess checkpoint1";

/// What a run is: equal for two that do the same to the last bit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// The version of this program.
    version: String,
    /// The scenario, as JSON.
    scenario: String,
    /// Hash of what was computed from it: case files count, not their names.
    configuration: u64,
    /// Names and [`Participant::identity`].
    participants: Vec<(String, String)>,
}

impl Identity {
    /// Of a scenario as JSON, of whatever was made from it, as text, and of its participants.
    pub fn new(scenario: String, configuration: &str, participants: &[Box<dyn Participant>]) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scenario,
            configuration: Fnv64::of(configuration.as_bytes()),
            participants: participants.iter().map(|p| (p.name().to_owned(), p.identity())).collect(),
        }
    }

    /// The first thing in which `found`, of a checkpoint, differs from this run.
    fn difference(&self, found: &Self) -> Option<(String, String, String)> {
        if self.version != found.version {
            return Some(("bess".to_owned(), found.version.clone(), self.version.clone()));
        }
        if self.scenario != found.scenario {
            let parse = |text: &str| serde_json::from_str(text).unwrap_or(Value::Null);
            let different = first_difference("", &parse(&found.scenario), &parse(&self.scenario));
            let (path, there, here) = different.unwrap_or_default();
            return Some((format!("the scenario's {path}"), there, here));
        }
        let names = |identity: &Self| {
            identity.participants.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
        };
        if names(self) != names(found) {
            return Some(("the participants".to_owned(), names(found), names(self)));
        }
        let mut both = found.participants.iter().zip(&self.participants);
        if let Some(((name, there), (_, here))) = both.find(|(there, here)| there != here) {
            return Some((format!("the model of {name}"), there.clone(), here.clone()));
        }
        if self.configuration != found.configuration {
            let hash = |identity: &Self| format!("hash {:016x}", identity.configuration);
            return Some(("a file that the scenario names".to_owned(), hash(found), hash(self)));
        }
        None
    }
}

/// Path and both values where two documents differ first.
fn first_difference(path: &str, found: &Value, expected: &Value) -> Option<(String, String, String)> {
    match (found, expected) {
        (Value::Object(a), Value::Object(b)) => {
            let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
            let at = |map: &serde_json::Map<String, Value>, key| map.get(key).cloned().unwrap_or(Value::Null);
            let dot = if path.is_empty() { "" } else { "." };
            keys.into_iter()
                .find_map(|key| first_difference(&format!("{path}{dot}{key}"), &at(a, key), &at(b, key)))
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(k, (a, b))| first_difference(&format!("{path}[{k}]"), a, b))
        }
        (a, b) if a == b => None,
        (a, b) => {
            let short = |value: &Value| value.to_string().chars().take(80).collect();
            Some((path.to_owned(), short(a), short(b)))
        }
    }
}

/// A run at a communication point, with its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whose.
    pub identity: Identity,
    /// How often one is kept, ns of simulated time.
    pub every_ns: i64,
    /// Where the run stood.
    pub position: Position,
    /// How far the trajectory had come.
    pub(super) trajectory: Mark,
    /// How far the samples for the report had come.
    pub(super) samples: Mark,
}

/// Why there is nothing to go on from.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum CheckpointError {
    #[error("{}: there is no checkpoint to resume from; start the run with --checkpoint EVERY", path.display())]
    Absent { path: PathBuf },

    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },

    #[error("{}: is no checkpoint of this version of bess, or a damaged one ({reason})", path.display())]
    Damaged { path: PathBuf, reason: String },

    #[error(
        "{}: belongs to another run: {what} was {found}; it is now {expected}. Resume with what the run was started \
         with, or start it again", path.display()
    )]
    OtherRun { path: PathBuf, what: String, found: String, expected: String },
}

impl Checkpoint {
    /// Writes it into this folder in place of the one before.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        let payload = postcard::to_stdvec(self).map_err(io::Error::other)?;
        write_whole(&folder.join(CHECKPOINT), &[MAGIC, &Fnv64::of(&payload).to_le_bytes(), &payload])
    }

    /// Reads the one in this folder, if it belongs to this run.
    pub fn read(folder: &Path, identity: &Identity) -> Result<Self, CheckpointError> {
        let checkpoint = Self::open(folder)?;
        checkpoint.check(folder, identity)?;
        Ok(checkpoint)
    }

    /// Reads the one in this folder, whatever run it belongs to.
    pub fn open(folder: &Path) -> Result<Self, CheckpointError> {
        let path = folder.join(CHECKPOINT);
        let bytes = fs::read(&path).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => CheckpointError::Absent { path: path.clone() },
            _ => CheckpointError::Io { path: path.clone(), source },
        })?;
        let damaged =
            |reason: &str| CheckpointError::Damaged { path: path.clone(), reason: reason.to_owned() };
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("it does not begin like one"))?;
        let (hash, payload) = rest.split_first_chunk().ok_or_else(|| damaged("it ends too early"))?;
        if Fnv64::of(payload) != u64::from_le_bytes(*hash) {
            return Err(damaged("its checksum does not fit"));
        }
        postcard::from_bytes(payload).map_err(|error| damaged(&format!("it cannot be read: {error}")))
    }

    /// Whether it belongs to this run; `folder` is where it was read.
    pub fn check(&self, folder: &Path, identity: &Identity) -> Result<(), CheckpointError> {
        match identity.difference(&self.identity) {
            None => Ok(()),
            Some((what, found, expected)) => {
                Err(CheckpointError::OtherRun { path: folder.join(CHECKPOINT), what, found, expected })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_first_difference_has_its_path() {
        let a = json!({"name": "x", "bess": [{"K_P": 1.0}, {"K_P": 2.0}], "stop_s": 120.0});
        let mut b = a.clone();
        assert_eq!(first_difference("", &a, &b), None);
        b["bess"][1]["K_P"] = json!(3.0);
        b["stop_s"] = json!(60.0);
        let (path, found, expected) = first_difference("", &a, &b).unwrap();
        assert_eq!((&*path, &*found, &*expected), ("bess[1].K_P", "2.0", "3.0"));
        let (path, found, expected) = first_difference("", &a, &json!({"extra": 1})).unwrap();
        assert_eq!((&*path, &*found, &*expected), ("name", "\"x\"", "null"));
    }
}

//! Where things are: the workspace root, the target folder, and what the build leaves in it.

use crate::{error::Failure, process};
use std::path::{Path, PathBuf};

/// The folders of this workspace, absolute.
pub struct Workspace {
    /// The folder of the workspace's Cargo.toml.
    pub root: PathBuf,
    /// Cargo's target folder: `target` unless CARGO_TARGET_DIR or a cargo configuration says otherwise.
    pub target: PathBuf,
}

impl Workspace {
    /// Finds this program's workspace and asks cargo for its target folder.
    pub fn find() -> Result<Self, Failure> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"))
            .parent()
            .ok_or_else(|| Failure::Other("xtask lies in no workspace".into()))?
            .to_path_buf();
        let mut found = Workspace { target: root.join("target"), root };
        // A relative CARGO_TARGET_DIR counts from where the user stands, so ask from there.
        let mut cargo = process::cargo(&found);
        cargo.args(["metadata", "--format-version", "1", "--no-deps", "--manifest-path"]);
        cargo.arg(found.root.join("Cargo.toml"));
        if let Ok(here) = std::env::current_dir() {
            cargo.current_dir(here);
        }
        found.target = target_directory(&process::output(&mut cargo)?)?;
        Ok(found)
    }

    /// The `bess` command, built in release.
    pub fn bess(&self) -> PathBuf {
        self.release().join("bess")
    }

    /// What is built for other platforms, and the archive of libraries that `bess` carries.
    pub fn platforms(&self) -> PathBuf {
        self.target.join("platforms")
    }

    /// Where the plain cargo leaves the FMUs' libraries.
    pub fn plain_libraries(&self) -> PathBuf {
        self.platforms().join("build/release")
    }

    /// Where release builds land.
    pub fn release(&self) -> PathBuf {
        self.target.join("release")
    }
}

/// Reads the target folder out of `cargo metadata`.
fn target_directory(metadata: &str) -> Result<PathBuf, Failure> {
    let json: serde_json::Value = serde_json::from_str(metadata)
        .map_err(|error| Failure::Other(format!("`cargo metadata` printed no JSON: {error}")))?;
    json.get("target_directory")
        .and_then(|folder| folder.as_str())
        .map(PathBuf::from)
        .ok_or_else(|| Failure::Other("`cargo metadata` names no target_directory".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_folder_is_read_from_cargos_metadata() {
        let json = r#"{"packages": [], "target_directory": "/a b/target"}"#;
        assert_eq!(target_directory(json).expect("is there"), PathBuf::from("/a b/target"));
        assert!(target_directory("{}").is_err());
        assert!(target_directory("error: no Cargo.toml").is_err());
    }

    #[test]
    fn the_workspace_is_this_one() {
        let workspace = Workspace::find().expect("cargo is at hand");
        assert!(workspace.root.join("fmu/controller/Cargo.toml").is_file());
        assert!(workspace.target.is_absolute());
    }
}

//! The archive of shared libraries that `bess` carries inside itself. Its bytes depend on the libraries alone,
//! and it is written only when they changed, so that `bess` is not built anew for nothing.

use super::{Built, MODELS};
use crate::{error::Failure, workspace::Workspace};
use std::{
    io::{Cursor, Write},
    path::{Path, PathBuf},
};
use zip::{CompressionMethod, DateTime, ZipWriter, write::SimpleFileOptions};

/// Makes src/main.rs include the archive that the environment variable BESS_CARRY names.
pub const CARRY_CFG: [&str; 2] = ["--cfg", "bess_carry"];

/// Writes the archive, entries `PLATFORM/IDENTIFIER.SUFFIX`, and gives back its path.
pub fn carry(workspace: &Workspace, built: &[Built]) -> Result<PathBuf, Failure> {
    let folder = workspace.platforms();
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let mut entries = Vec::new();
    for one in built {
        for ((_, model), file) in MODELS.iter().zip(&one.files) {
            let contents = std::fs::read(file).map_err(Failure::file("read", file))?;
            entries.push((format!("{}/{}", one.platform.name(), one.platform.packed_name(model)), contents));
        }
    }
    let path = folder.join("libraries.zip");
    write_if_new(&path, &archive(&entries)?)?;
    Ok(path)
}

fn archive(entries: &[(String, Vec<u8>)]) -> Result<Vec<u8>, Failure> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let failed =
        |error: &dyn std::fmt::Display| Failure::Other(format!("cannot pack the libraries: {error}"));
    for (name, contents) in entries {
        archive.start_file(name.as_str(), options).map_err(|error| failed(&error))?;
        archive.write_all(contents).map_err(|error| failed(&error))?;
    }
    Ok(archive.finish().map_err(|error| failed(&error))?.into_inner())
}

fn write_if_new(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if std::fs::read(path).is_ok_and(|before| before == bytes) {
        return Ok(());
    }
    std::fs::write(path, bytes).map_err(Failure::file("write", path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::platforms::Platform;

    #[test]
    fn the_archive_holds_each_library_under_its_platform_and_is_left_alone_when_nothing_changed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let workspace = Workspace { root: folder.path().into(), target: folder.path().join("target") };
        let built = Built::in_folder(Platform::Linux64, folder.path());
        for file in &built.files {
            std::fs::write(file, file.file_name().expect("a name").to_string_lossy().as_bytes())
                .expect("writable");
        }
        let path = carry(&workspace, &[built]).expect("packs");
        let bytes = std::fs::read(&path).expect("is there");
        let mut archive = zip::ZipArchive::new(Cursor::new(&bytes)).expect("a zip archive");
        let name = "linux64/BessGrid.so";
        let contents = std::io::read_to_string(archive.by_name(name).expect("is there")).expect("unpacks");
        assert_eq!(contents, "libBessGrid.so");
        let modified = || std::fs::metadata(&path).and_then(|data| data.modified()).expect("is there");
        let before = modified();
        std::thread::sleep(std::time::Duration::from_millis(20));
        write_if_new(&path, &bytes).expect("nothing to do");
        assert_eq!(modified(), before);
    }
}

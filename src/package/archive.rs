//! Zip archives whose bytes depend on their contents alone: sorted entries, one fixed time stamp.

use super::PackageError;
use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Archive path (`binaries/linux64/X.so`) to contents.
pub type Entries = BTreeMap<String, Vec<u8>>;

/// Writes the archive; it appears under `path` only when it is whole.
pub fn write(path: &Path, entries: &Entries) -> Result<(), PackageError> {
    let bytes = packed(path, entries)?;
    let io = |cause| PackageError::Write { file: path.into(), cause };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(io)?;
    let mut file = tempfile::Builder::new().prefix(".bess-").tempfile_in(folder).map_err(io)?;
    file.write_all(&bytes).map_err(io)?;
    #[cfg(unix)]
    {
        // A temporary file is private; an FMU is there to be handed on.
        use std::os::unix::fs::PermissionsExt;
        file.as_file().set_permissions(std::fs::Permissions::from_mode(0o644)).map_err(io)?;
    }
    file.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}

/// The bytes of the archive; `path` is for messages.
pub fn packed(path: &Path, entries: &Entries) -> Result<Vec<u8>, PackageError> {
    to_bytes(entries).map_err(|cause| PackageError::Archive { file: path.into(), cause: cause.to_string() })
}

fn to_bytes(entries: &Entries) -> zip::result::ZipResult<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, contents) in entries {
        archive.start_file(name.as_str(), options)?;
        archive.write_all(contents)?;
    }
    Ok(archive.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_entries_give_the_same_bytes_and_come_back() {
        let entries: Entries = [("b/x".to_owned(), vec![1, 2, 3]), ("a".to_owned(), b"text".to_vec())].into();
        let bytes = to_bytes(&entries).unwrap();
        assert_eq!(bytes, to_bytes(&entries).unwrap());
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        let mut back = Entries::new();
        for i in 0..archive.len() {
            let mut file = archive.by_name(entries.keys().nth(i).unwrap()).unwrap();
            let mut contents = Vec::new();
            std::io::Read::read_to_end(&mut file, &mut contents).unwrap();
            back.insert(entries.keys().nth(i).unwrap().clone(), contents);
        }
        assert_eq!(back, entries);
    }
}

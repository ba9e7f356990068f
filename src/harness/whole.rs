//! Files that appear under their name only when they are whole.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Where a file lies until it is whole: one name, so that what a killed process leaves is overwritten by the next.
pub fn part_of(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".part");
    name.into()
}

/// Writes these pieces, one behind the other, in place of what is there; on an error what is there stays as it is. No
/// two may write the same file at a time.
pub fn write_whole(path: &Path, pieces: &[&[u8]]) -> io::Result<()> {
    let part = part_of(path);
    let write = || {
        let mut file = File::create(&part)?;
        pieces.iter().try_for_each(|piece| file.write_all(piece))?;
        file.sync_all()?;
        fs::rename(&part, path)
    };
    write().inspect_err(|_| {
        // What failed matters to the caller, not whether the remains could be removed.
        let _ = fs::remove_file(&part);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_there_is_replaced_as_a_whole_or_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.html");
        // What a killed process left.
        fs::write(part_of(&path), "a longer piece of the page").unwrap();
        write_whole(&path, &[b"whole ", b"page"]).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "whole page");
        assert!(!part_of(&path).exists());

        // A folder cannot be replaced by a file, and keeps what is in it.
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).unwrap();
        fs::write(taken.join("inside"), "kept").unwrap();
        assert!(write_whole(&taken, &[b"page"]).is_err());
        assert_eq!(fs::read_to_string(taken.join("inside")).unwrap(), "kept");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}

//! Unpacks an `.fmu` into a temporary folder that goes away with the last user. An archive is
//! somebody else's: nothing in it may write outside that folder, fill the disk or stand in for
//! another file. No link is ever made.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Component, Path, PathBuf};
use tempfile::TempDir;
use zip::ZipArchive;
use zip::read::Config;
use zip::unstable::read::ZipIterable;

/// What an archive may hold at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Files and folders.
    pub entries: usize,
    /// Bytes of all files, unpacked.
    pub bytes: u64,
}

impl Default for Limits {
    /// 10 000 entries and 1 GiB: FMUs with a Python environment or lookup tables inside fit.
    fn default() -> Self {
        Self { entries: 10_000, bytes: 1 << 30 }
    }
}

/// Bytes of an entry's name at most: what comes out must still have a path that every system takes.
const LONGEST_NAME: usize = 1024;

/// An unpacked archive; its folder is deleted on drop.
#[derive(Debug)]
pub struct Unpacked {
    folder: PathBuf,
    _owned: Option<TempDir>,
}

impl Unpacked {
    /// The folder.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// A folder that somebody else has unpacked and will delete.
    pub(super) fn borrowed(folder: &Path) -> Self {
        Self { folder: folder.to_path_buf(), _owned: None }
    }
}

/// Why an archive was refused.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The file, or the temporary folder, cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },

    /// Not a zip archive, or a damaged one.
    #[error("{}: not a readable zip archive ({reason}); expected an .fmu file", path.display())]
    Zip {
        /// The archive.
        path: PathBuf,
        /// What the decoder says.
        reason: String,
    },

    /// An entry that no FMU needs and an attack would have.
    #[error("{}: entry {entry:?} is {found}; expected {expected}", path.display())]
    Entry {
        /// The archive.
        path: PathBuf,
        /// Its name in there.
        entry: String,
        /// What is wrong with it.
        found: &'static str,
        /// What is allowed.
        expected: &'static str,
    },

    /// More than the limits allow.
    #[error(
        "{}: holds more than {limit} {what} unpacked; if you trust it, raise the limit", path.display()
    )]
    TooMuch {
        /// The archive.
        path: PathBuf,
        /// `entries` or `bytes`.
        what: &'static str,
        /// The limit.
        limit: u64,
    },
}

/// Unpacks `archive` into a new temporary folder.
pub fn unpack(archive: &Path, limits: Limits) -> Result<Unpacked, ArchiveError> {
    let open = || File::open(archive).map(io::BufReader::new).map_err(io_error(archive));
    let damaged = |error: zip::result::ZipError| ArchiveError::Zip {
        path: archive.to_path_buf(),
        reason: error.to_string(),
    };
    let too_much = |what, limit| ArchiveError::TooMuch { path: archive.to_path_buf(), what, limit };
    // Counted before the names are read into memory: a million of them would fill it.
    if ZipIterable::try_new(open()?, Config::default()).map_err(damaged)?.len() > limits.entries {
        return Err(too_much("entries", limits.entries as u64));
    }
    let mut zip = ZipArchive::new(open()?).map_err(damaged)?;
    let refused = |entry: &str, found, expected| ArchiveError::Entry {
        path: archive.to_path_buf(),
        entry: entry.to_owned(),
        found,
        expected,
    };
    if zip.has_duplicate_names() {
        return Err(refused("(several)", "there twice", "unique names"));
    }
    // Many entries over the same few bytes: the one bomb that needs no nesting.
    if zip.has_overlapping_entries().map_err(damaged)? {
        return Err(refused("(several)", "laid over another one", "entries one after the other"));
    }
    // An honest bomb says how large it is: refused before the disk is touched.
    if zip.decompressed_size().is_some_and(|bytes| bytes > u128::from(limits.bytes)) {
        return Err(too_much("bytes", limits.bytes));
    }
    let folder = tempfile::Builder::new().prefix("fmu-").tempdir().map_err(io_error(archive))?;
    let mut seen = BTreeSet::new();
    let mut left = limits.bytes;
    for index in 0..zip.len() {
        let entry = zip.by_index(index).map_err(damaged)?;
        let name = entry.name().map_err(damaged)?.into_owned();
        if name.len() > LONGEST_NAME {
            return Err(refused("(a very long name)", "named by more than 1024 bytes", "a shorter name"));
        }
        let relative =
            safe_path(&name).map_err(|found| refused(&name, found, "a relative path without .."))?;
        if entry.is_symlink() {
            return Err(refused(&name, "a symbolic link", "files and folders only"));
        }
        // Windows and macOS fold case: there, two such names would overwrite each other.
        if !seen.insert(relative.to_string_lossy().to_lowercase()) {
            return Err(refused(&name, "there twice", "unique names, also without regard to case"));
        }
        let target = folder.path().join(&relative);
        if entry.is_dir() {
            std::fs::create_dir_all(&target).map_err(io_error(&target))?;
            continue;
        }
        if let Some(parent) = target.parent() {
            std::fs::create_dir_all(parent).map_err(io_error(parent))?;
        }
        // The size that an entry claims is no promise, so what comes out is counted.
        let mut source = entry.take(left.saturating_add(1));
        let written = write_new(&target, &mut source).map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData
            | io::ErrorKind::InvalidInput
            | io::ErrorKind::UnexpectedEof
            | io::ErrorKind::Unsupported => {
                ArchiveError::Zip { path: archive.to_path_buf(), reason: format!("{name}: {error}") }
            }
            _ => ArchiveError::Io { path: target.clone(), source: error },
        })?;
        left = left.checked_sub(written).ok_or_else(|| too_much("bytes", limits.bytes))?;
    }
    Ok(Unpacked { folder: folder.path().to_path_buf(), _owned: Some(folder) })
}

/// The path that a name stands for, or what is wrong with it. Backslashes count as separators: some
/// tools on Windows write them, and on Windows they would act as such.
fn safe_path(name: &str) -> Result<PathBuf, &'static str> {
    let name = name.replace('\\', "/");
    if name.contains('\0') {
        return Err("a name with a NUL byte");
    }
    if name.starts_with('/') || name.as_bytes().get(1) == Some(&b':') {
        return Err("an absolute path");
    }
    let mut path = PathBuf::new();
    for component in Path::new(&name).components() {
        match component {
            Component::Normal(part) => path.push(part),
            Component::CurDir => {}
            Component::ParentDir => return Err("a path that leaves the archive"),
            Component::RootDir | Component::Prefix(_) => return Err("an absolute path"),
        }
    }
    if path.as_os_str().is_empty() { Err("an empty name") } else { Ok(path) }
}

fn write_new(target: &Path, source: &mut impl Read) -> io::Result<u64> {
    let mut file = File::create_new(target)?;
    let written = io::copy(source, &mut file)?;
    file.flush()?;
    Ok(written)
}

fn io_error(path: &Path) -> impl FnOnce(io::Error) -> ArchiveError {
    let path = path.to_path_buf();
    move |source| ArchiveError::Io { path, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside_or_are_refused() {
        for (name, expected) in [
            ("modelDescription.xml", Some("modelDescription.xml")),
            ("binaries/linux64/a.so", Some("binaries/linux64/a.so")),
            ("binaries\\win64\\a.dll", Some("binaries/win64/a.dll")),
            ("./resources/x", Some("resources/x")),
            ("../x", None),
            ("resources/../../x", None),
            ("resources/../x", None),
            ("..\\x", None),
            ("/etc/passwd", None),
            ("\\\\server\\share", None),
            ("C:/x", None),
            ("", None),
            ("a\0b", None),
        ] {
            assert_eq!(safe_path(name).ok(), expected.map(PathBuf::from), "{name:?}");
        }
    }
}

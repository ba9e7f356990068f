//! The shared libraries that go into an FMU: those that the program carries inside itself, or those of a
//! folder. Never looks anywhere else, and never loads one.

use super::PackageError;
use super::archive::Entries;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// FMI 2.0 platform folders with the suffix of their shared libraries. FMI 2.0 names no folder for 64-bit
/// Arm; FMI 3.0's name is what importers look for.
const PLATFORMS: [(&str, &str); 4] =
    [("linux64", ".so"), ("win64", ".dll"), ("darwin64", ".dylib"), ("aarch64-linux", ".so")];

/// FMI 2.0 name of the platform that this program runs on.
pub const PLATFORM: &str = if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
    "linux64"
} else if cfg!(all(target_os = "windows", target_arch = "x86_64")) {
    "win64"
} else if cfg!(all(target_os = "macos", target_arch = "x86_64")) {
    "darwin64"
} else if cfg!(all(target_os = "linux", target_arch = "aarch64")) {
    "aarch64-linux"
} else {
    "unknown"
};

/// What `cargo build` calls the shared library of a model on this platform.
pub fn library_file_name(identifier: &str) -> String {
    format!("{}{identifier}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX)
}

/// Where the shared libraries of an FMU come from.
#[derive(Clone, Debug)]
pub enum Libraries {
    /// A zip archive inside the program, with entries `PLATFORM/IDENTIFIER.SUFFIX`.
    Carried(&'static [u8]),
    /// A folder with files `PLATFORM/IDENTIFIER.SUFFIX`; or, for this platform alone, a cargo target folder.
    Folder(PathBuf),
}

impl Libraries {
    /// The platforms that an FMU of this model would be for; unpacks nothing.
    pub fn platforms(&self, identifier: &str) -> Result<Vec<&'static str>, PackageError> {
        let here = match self {
            Libraries::Carried(archive) => {
                let archive = open(archive)?;
                of_platforms(
                    |file| archive.as_ref().is_some_and(|a| a.index_for_name(file).is_some()),
                    identifier,
                )
            }
            Libraries::Folder(folder) => of_platforms(|file| folder.join(file).is_file(), identifier),
        };
        match self {
            Libraries::Folder(folder)
                if here.is_empty() && folder.join(library_file_name(identifier)).is_file() =>
            {
                Ok(vec![PLATFORM])
            }
            _ => Ok(here),
        }
    }

    /// The archive entries `binaries/PLATFORM/FILE` of a model; an error if there is none.
    pub(super) fn of(&self, identifier: &str) -> Result<Entries, PackageError> {
        let found = match self {
            Libraries::Carried(archive) => carried(archive, identifier)?,
            Libraries::Folder(folder) => in_folder(folder, identifier)?,
        };
        match (found.is_empty(), self) {
            (false, _) => Ok(found),
            (true, Libraries::Carried(_)) => Err(PackageError::NotCarried { model: identifier.to_owned() }),
            (true, Libraries::Folder(folder)) => {
                Err(PackageError::NoLibrary { file: folder.join(library_file_name(identifier)) })
            }
        }
    }
}

/// The platforms whose `PLATFORM/IDENTIFIER.SUFFIX` is there.
fn of_platforms(is_there: impl Fn(&str) -> bool, identifier: &str) -> Vec<&'static str> {
    let found =
        PLATFORMS.iter().filter(|(platform, suffix)| is_there(&format!("{platform}/{identifier}{suffix}")));
    found.map(|(platform, _)| *platform).collect()
}

fn damaged(cause: impl std::fmt::Display) -> PackageError {
    PackageError::Damaged { cause: cause.to_string() }
}

/// The archive; none if the program carries none.
fn open(archive: &[u8]) -> Result<Option<ZipArchive<Cursor<&[u8]>>>, PackageError> {
    if archive.is_empty() {
        Ok(None)
    } else {
        ZipArchive::new(Cursor::new(archive)).map(Some).map_err(damaged)
    }
}

fn carried(archive: &[u8], identifier: &str) -> Result<Entries, PackageError> {
    let mut found = Entries::new();
    let Some(mut archive) = open(archive)? else { return Ok(found) };
    for (platform, suffix) in PLATFORMS {
        let name = format!("{platform}/{identifier}{suffix}");
        let Some(index) = archive.index_for_name(&name) else { continue };
        let mut bytes = Vec::new();
        archive.by_index(index).map_err(damaged)?.read_to_end(&mut bytes).map_err(damaged)?;
        found.insert(format!("binaries/{name}"), bytes);
    }
    Ok(found)
}

fn in_folder(folder: &Path, identifier: &str) -> Result<Entries, PackageError> {
    let mut found = Entries::new();
    for (platform, suffix) in PLATFORMS {
        let name = format!("{platform}/{identifier}{suffix}");
        let file = folder.join(&name);
        if file.is_file() {
            found.insert(format!("binaries/{name}"), read(&file)?);
        }
    }
    let built = folder.join(library_file_name(identifier));
    if found.is_empty() && built.is_file() {
        let name = format!("binaries/{PLATFORM}/{identifier}{}", std::env::consts::DLL_SUFFIX);
        found.insert(name, read(&built)?);
    }
    Ok(found)
}

fn read(file: &Path) -> Result<Vec<u8>, PackageError> {
    std::fs::read(file).map_err(|cause| PackageError::Read { file: file.into(), cause })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn archive(entries: &[(&str, &[u8])]) -> &'static [u8] {
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, contents) in entries {
            archive.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
            archive.write_all(contents).unwrap();
        }
        archive.finish().unwrap().into_inner().leak()
    }

    #[test]
    fn carried_libraries_come_by_platform_and_only_the_models_own() {
        let carried = Libraries::Carried(archive(&[
            ("linux64/BessGrid.so", b"grid"),
            ("linux64/BessConsensus.so", b"elf"),
            ("win64/BessConsensus.dll", b"pe"),
            ("README", b"not a library"),
        ]));
        let found = carried.of("BessConsensus").unwrap();
        let expected: Entries = [
            ("binaries/linux64/BessConsensus.so".to_owned(), b"elf".to_vec()),
            ("binaries/win64/BessConsensus.dll".to_owned(), b"pe".to_vec()),
        ]
        .into();
        assert_eq!(found, expected);
        assert_eq!(carried.platforms("BessConsensus").unwrap(), ["linux64", "win64"]);
        assert!(matches!(carried.of("Other"), Err(PackageError::NotCarried { .. })));
    }

    #[test]
    fn nothing_carried_and_a_damaged_archive_are_told_apart() {
        assert!(matches!(Libraries::Carried(&[]).of("X"), Err(PackageError::NotCarried { .. })));
        assert!(matches!(Libraries::Carried(b"PK??").of("X"), Err(PackageError::Damaged { .. })));
    }

    #[test]
    fn a_folder_has_platforms_or_is_cargos() {
        let folder = tempfile::tempdir().unwrap();
        let libraries = Libraries::Folder(folder.path().to_owned());
        assert!(matches!(libraries.of("X"), Err(PackageError::NoLibrary { .. })));
        std::fs::write(folder.path().join(library_file_name("X")), "here").unwrap();
        assert_eq!(libraries.platforms("X").unwrap(), [PLATFORM]);
        std::fs::create_dir(folder.path().join("win64")).unwrap();
        std::fs::write(folder.path().join("win64/X.dll"), "there").unwrap();
        assert_eq!(libraries.platforms("X").unwrap(), ["win64"]);
    }
}

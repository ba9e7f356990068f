//! The archive as an archive: can it be unpacked, is everything at its place, what else is in there. Reads the
//! entries into memory; what it unpacks to see whether that can be done is gone when it is done.

use super::Report;
use super::finding::{Finding, Place};
use super::rules::{self, Rule};
use crate::harness::archive::{self, ArchiveError, Limits};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use zip::{CompressionMethod, ZipArchive};

/// What stands in the root of an FMU (FMI 2.0.4, section 2.3).
const ROOT: [&str; 8] = [
    "modelDescription.xml",
    "model.png",
    "documentation",
    "sources",
    "binaries",
    "resources",
    "extra",
    "terminalsAndIcons",
];

/// The entries that the other rules look at.
pub struct Contents {
    /// `modelDescription.xml`.
    pub description: Option<Vec<u8>>,
    /// Everything under `binaries/`: path to contents.
    pub binaries: BTreeMap<String, Vec<u8>>,
    /// Whether there is a file under `sources/`.
    pub has_sources: bool,
}

/// Reads the archive, or says why it cannot be.
pub fn read(path: &Path, report: &mut Report) -> Option<Contents> {
    // The importer's own reader refuses whatever could do harm, and counts what comes out.
    if let Err(error) = archive::unpack(path, Limits::default()) {
        let of_reader = matches!(error, ArchiveError::Zip { .. });
        report.findings.push(match other_method(path).filter(|_| of_reader) {
            Some((entry, method)) => Finding::new(
                &rules::METHOD,
                Place::file(entry),
                format!("compressed with {method}"),
                "deflate or no compression (FMI 2.0.4, section 2.3)",
                "zip it with deflate",
            ),
            None => Finding::new(
                &rules::ARCHIVE,
                Place::file(path.display().to_string()),
                error.to_string(),
                "a zip archive with safe, unique names",
                "pack it again with an ordinary zip program",
            ),
        });
        return None;
    }
    match entries(path, report) {
        Ok(contents) => Some(contents),
        Err(error) => {
            let place = Place::file(path.display().to_string());
            report.findings.push(Finding::new(
                &rules::ARCHIVE,
                place,
                error,
                "a readable zip archive",
                "pack it again",
            ));
            None
        }
    }
}

/// The first entry that is neither deflated nor stored, which the importer's reader refuses, and how it is.
fn other_method(path: &Path) -> Option<(String, CompressionMethod)> {
    let mut zip = ZipArchive::new(std::io::BufReader::new(std::fs::File::open(path).ok()?)).ok()?;
    (0..zip.len()).find_map(|index| {
        let entry = zip.by_index_raw(index).ok()?;
        let method = entry.compression();
        let is_known = matches!(method, CompressionMethod::Stored | CompressionMethod::Deflated);
        if is_known { None } else { Some((entry.name().ok()?.into_owned(), method)) }
    })
}

fn entries(path: &Path, report: &mut Report) -> Result<Contents, String> {
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    let mut zip = ZipArchive::new(std::io::BufReader::new(file)).map_err(|e| e.to_string())?;
    let mut contents = Contents { description: None, binaries: BTreeMap::new(), has_sources: false };
    let (mut documented, mut nested) = (false, None);
    for index in 0..zip.len() {
        let mut entry = zip.by_index(index).map_err(|e| e.to_string())?;
        let name = entry.name().map_err(|e| e.to_string())?.into_owned();
        let mut complain = |rule: &'static Rule, found: String, expected: &str, mend: &str| {
            report.findings.push(Finding::new(rule, Place::file(name.clone()), found, expected, mend));
        };
        if name.contains('\\') {
            let mend = "write / between folders, whatever the system";
            complain(&rules::BACKSLASH, "a backslash in the name".into(), "forward slashes", mend);
        }
        let plain = name.replace('\\', "/");
        let top = plain.split('/').next().unwrap_or_default();
        if !ROOT.contains(&top) {
            let expected = format!("only {} in the root", ROOT.join(", "));
            complain(
                &rules::STRAY,
                "an entry that FMI 2.0 does not know".into(),
                &expected,
                "move it to resources/ or extra/",
            );
        }
        if entry.is_dir() {
            continue;
        }
        documented |= plain == "documentation/index.html";
        contents.has_sources |= plain.starts_with("sources/");
        let mut bytes = Vec::new();
        if plain == "modelDescription.xml" || plain.starts_with("binaries/") {
            entry.read_to_end(&mut bytes).map_err(|e| format!("{name}: {e}"))?;
        }
        if plain == "modelDescription.xml" {
            contents.description = Some(bytes);
        } else if plain.starts_with("binaries/") {
            contents.binaries.insert(plain, bytes);
        } else if plain.ends_with("/modelDescription.xml") {
            nested = Some(plain);
        }
    }
    if contents.description.is_none() {
        let (found, mend) = match nested {
            Some(nested) => {
                (format!("it lies in {nested}"), "zip the contents of the folder, not the folder itself")
            }
            None => ("nothing of that name".to_owned(), "export the FMU again"),
        };
        report.findings.push(Finding::new(
            &rules::NO_DESCRIPTION,
            Place::file("modelDescription.xml"),
            found,
            "modelDescription.xml in the root of the archive",
            mend,
        ));
    }
    if !documented {
        report.findings.push(Finding::new(
            &rules::NO_DOCUMENTATION,
            Place::file("documentation/index.html"),
            "no such file",
            "a page that says what the model is (FMI 2.0.4, section 2.3)",
            "write one",
        ));
    }
    Ok(contents)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Write};
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    #[test]
    fn another_compression_is_told_from_a_damaged_archive() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("compression method.fmu");
        let found = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            let mut report = Report::default();
            assert!(read(&file, &mut report).is_none());
            assert_eq!(report.findings.len(), 1);
            report.findings.remove(0)
        };
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        archive.start_file("modelDescription.xml", stored).unwrap();
        archive.write_all(b"<fmiModelDescription/>").unwrap();
        let mut bytes = archive.finish().unwrap().into_inner();
        assert_eq!(found(&bytes[1..bytes.len() / 2]).rule, &rules::ARCHIVE);
        // 12 is bzip2, once in the entry's own header and once in the directory.
        let directory = bytes.windows(4).position(|four| four == b"PK\x01\x02").unwrap();
        (bytes[8], bytes[directory + 10]) = (12, 12);
        let finding = found(&bytes);
        assert_eq!((finding.rule, finding.place.file.as_str()), (&rules::METHOD, "modelDescription.xml"));
    }
}

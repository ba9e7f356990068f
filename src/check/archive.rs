//! The archive as an archive: can it be unpacked, is everything at its place, what else is in there. Reads the
//! entries into memory; writes nothing.

use super::Report;
use super::finding::{Finding, Place};
use super::rules::{self, Rule};
use crate::harness::Limits;
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
    if let Err(error) = crate::harness::archive::unpack(path, Limits::default()) {
        let mend = "pack it again with an ordinary zip program";
        let place = Place::file(path.display().to_string());
        let rule = if error.to_string().contains("ompression") { &rules::METHOD } else { &rules::ARCHIVE };
        report.findings.push(Finding::new(
            rule,
            place,
            error.to_string(),
            "a zip archive with safe, unique names",
            mend,
        ));
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
        if !matches!(entry.compression(), CompressionMethod::Stored | CompressionMethod::Deflated) {
            let found = format!("compressed with {}", entry.compression());
            complain(
                &rules::METHOD,
                found,
                "deflate or no compression (FMI 2.0.4, section 2.3)",
                "zip it with deflate",
            );
        }
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

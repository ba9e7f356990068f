#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
//! Archives and descriptions that are damaged or mean harm.

mod harness_support;

use bess_consensus::harness::archive::unpack;
use bess_consensus::harness::{Limits, ModelDescription};
use harness_support::{integrator_xml, zip};
use std::path::{Path, PathBuf};

/// An archive with `placeholder` renamed to `name` (of equal length) behind the writer's back.
fn disguised(folder: &Path, placeholder: &str, name: &str) -> PathBuf {
    assert_eq!(placeholder.len(), name.len());
    let path = folder.join("disguised.fmu");
    zip(&path, &[("resources/aa", b"1"), (placeholder, b"2")]);
    let mut bytes = std::fs::read(&path).unwrap();
    let mut replaced = 0;
    for start in 0..bytes.len() - name.len() {
        if bytes[start..].starts_with(placeholder.as_bytes()) {
            bytes[start..start + name.len()].copy_from_slice(name.as_bytes());
            replaced += 1;
        }
    }
    assert_eq!(replaced, 2, "local and central header");
    std::fs::write(&path, bytes).unwrap();
    path
}

fn refused(path: &Path, limits: Limits) -> String {
    unpack(path, limits).expect_err("refused").to_string()
}

#[test]
fn nothing_is_written_outside() {
    let folder = tempfile::tempdir().unwrap();
    for (name, expected) in [
        ("../aaaa/evil", "leaves the archive"),
        ("a/../../evil", "leaves the archive"),
        ("..\\aaaa\\evil", "leaves the archive"),
        ("/tmp/aa/evil", "an absolute path"),
        ("C:\\aaaa\\evil", "an absolute path"),
    ] {
        let path = disguised(folder.path(), "bb/bbbb/bbbb", name);
        let error = refused(&path, Limits::default());
        assert!(error.contains(expected), "{name}: {error}");
    }
}

#[test]
fn no_entry_replaces_another() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["resources/aa", "resources/AA", "resources\\aa"] {
        let error = refused(&disguised(folder.path(), "resources/bb", name), Limits::default());
        assert!(error.contains("there twice") || error.contains("duplicate"), "{name}: {error}");
    }
}

#[test]
fn links_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("link.fmu");
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    zip.add_symlink("resources", "/etc", zip::write::SimpleFileOptions::default()).unwrap();
    zip.finish().unwrap();
    let error = refused(&path, Limits::default());
    assert!(error.contains("\"resources\" is a symbolic link"), "{error}");
}

#[test]
fn bombs_are_refused_by_number_and_by_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.fmu");
    let zeros = vec![0; 1 << 20];
    zip(&path, &[("a", &zeros), ("b", &zeros), ("c", b"")]);
    let limits = |entries, bytes| Limits { entries, bytes };
    assert!(refused(&path, limits(2, u64::MAX)).contains("more than 2 entries"));
    assert!(refused(&path, limits(3, (2 << 20) - 1)).contains("more than 2097151 bytes"));
    assert!(unpack(&path, limits(3, 2 << 20)).is_ok());
}

#[test]
fn what_is_no_archive_is_called_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.fmu");
    assert!(refused(&path, Limits::default()).contains("x.fmu: No such file"));
    std::fs::write(&path, b"PK\x03\x04 not really").unwrap();
    assert!(refused(&path, Limits::default()).contains("not a readable zip archive"));
    // A damaged entry: one flipped bit in the data must not pass the checksum.
    zip(&path, &[("resources/data", &[7; 5000])]);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[30 + "resources/data".len() + 5] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    assert!(refused(&path, Limits::default()).contains("not a readable zip archive"));
}

fn read(xml: impl AsRef<[u8]>) -> Result<ModelDescription, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("modelDescription.xml");
    std::fs::write(&path, xml).unwrap();
    ModelDescription::read(&path).map_err(|error| error.to_string())
}

#[test]
fn descriptions_that_are_wrong_are_refused_with_line_and_expectation() {
    let good = integrator_xml();
    let line_of = |text: &str| 1 + good.lines().position(|line| line.contains(text)).unwrap();
    assert!(read(&good).is_ok());
    let table: &[(&str, &str, usize, &str)] = &[
        ("fmiVersion=\"2.0\"", "fmiVersion=\"3.0\"", 2, "fmiVersion=\"3.0\"; expected fmiVersion=\"2.0\""),
        (" guid=", " gid=", 2, "<fmiModelDescription> without guid"),
        (
            "\"integrator\"",
            "\"../x\"",
            line_of("<CoSimulation"),
            "modelIdentifier=\"../x\"; expected a C identifier",
        ),
        (
            "canSerializeFMUstate=\"1\"",
            "canSerializeFMUstate=\"yes\"",
            line_of("<CoSimulation"),
            "true, false, 1 or 0",
        ),
        (
            "valueReference=\"2\"",
            "valueReference=\"-2\"",
            line_of("name=\"y\""),
            "valueReference=\"-2\" of \"y\"",
        ),
        ("valueReference=\"2\" ", "", line_of("name=\"y\""), "<ScalarVariable> without valueReference"),
        ("name=\"y\"", "name=\"u\"", line_of("name=\"y\""), "a second variable \"u\"; expected unique names"),
        ("causality=\"output\"", "causality=\"out\"", line_of("name=\"y\""), "expected one of parameter"),
        ("start=\"0.0\"", "start=\"zero\"", line_of("name=\"u\""), "start=\"zero\"; expected a number"),
        ("start=\"true\"", "start=\"TRUE\"", line_of("name=\"enable\""), "true, false, 1 or 0"),
        ("<Integer start=\"3\"/>", "", line_of("name=\"mode\""), "\"mode\" without a type"),
        ("<Integer start=\"3\"/>", "<Integer start=\"3.5\"/>", line_of("name=\"mode\""), "a number"),
        ("</ModelVariables>", "</Variables>", line_of("</ModelVariables>"), "malformed XML"),
        ("</fmiModelDescription>", "", good.lines().count() + 1, "</fmiModelDescription>"),
        ("&amp;", "&evil;", 2, "five entities"),
    ];
    for (old, new, line, expected) in table {
        assert!(good.contains(old), "{old}");
        let error = read(good.replacen(old, new, 1)).unwrap_err();
        assert!(error.contains(&format!("line {line}: ")), "{old} -> {new}: {error}");
        assert!(error.contains(expected), "{old} -> {new}: {error}");
    }
}

#[test]
fn doctypes_and_entities_are_refused() {
    let doctype =
        "<?xml version=\"1.0\"?>\n<!DOCTYPE fmi [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]>\n<x>&b;</x>";
    let error = read(doctype).unwrap_err();
    assert!(error.contains("line 2: found a DOCTYPE; expected none"), "{error}");
    let error =
        read("<fmiModelDescription fmiVersion=\"2.0\" modelName=\"\" guid=\"\">\n&b;</fmiModelDescription>");
    assert!(error.unwrap_err().contains("line 2: found an entity of the file's own"));
}

#[test]
fn what_is_no_co_simulation_fmu_is_called_so() {
    let good = integrator_xml();
    let start = good.find("<CoSimulation").unwrap();
    let end = start + good[start..].find("/>").unwrap() + 2;
    let error = read(good.replace(&good[start..end], "<ModelExchange modelIdentifier=\"x\"/>")).unwrap_err();
    assert!(error.contains("only <ModelExchange>; expected <CoSimulation>"), "{error}");
    assert!(read("").unwrap_err().contains("expected <fmiModelDescription>"));
    assert!(read("<html></html>").unwrap_err().contains("found <html>; expected <fmiModelDescription>"));
    assert!(read(b"\xff\xfe\x00<").unwrap_err().contains("not UTF-8"));
}

#[test]
fn encodings_of_the_field_are_read() {
    let name = "Gr\u{f6}\u{df}e";
    let xml = integrator_xml().replace("Integrator &amp; co", name);
    assert_eq!(read(format!("\u{feff}{xml}")).unwrap().model_name, name);
    let latin: Vec<u8> =
        xml.replace("UTF-8", "ISO-8859-1").chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    assert_eq!(read(latin).unwrap().model_name, name);
}

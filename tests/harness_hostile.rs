#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
//! Archives and descriptions that are damaged or mean harm.

mod harness_support;

use bess_consensus::harness::archive::unpack;
use bess_consensus::harness::{Limits, ModelDescription};
use harness_support::{integrator_xml, zip};
use std::io::Write;
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

/// The zip records that a writer would not make: one local header, then as many central ones as asked for, all over it.
fn handmade(names: impl ExactSizeIterator<Item = String>, claimed: u32) -> Vec<u8> {
    let name = "resources/x";
    let mut bytes = b"PK\x03\x04".to_vec();
    let fields =
        |bytes: &mut Vec<u8>, shorts: &[u16]| shorts.iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    let data = b"hello";
    let crc = 0x3610_a686_u32;
    let sizes = |bytes: &mut Vec<u8>| {
        bytes.extend(crc.to_le_bytes());
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(claimed.to_le_bytes());
    };
    fields(&mut bytes, &[45, 0, 0, 0, 33]);
    sizes(&mut bytes);
    fields(&mut bytes, &[name.len() as u16, 0]);
    bytes.extend(name.as_bytes());
    bytes.extend(data);
    let (start, count) = (bytes.len() as u64, names.len() as u64);
    for name in names {
        bytes.extend(b"PK\x01\x02");
        fields(&mut bytes, &[45, 45, 0, 0, 0, 33]);
        sizes(&mut bytes);
        fields(&mut bytes, &[name.len() as u16, 0, 0, 0, 0, 0, 0, 0, 0]);
        bytes.extend(name.as_bytes());
    }
    let (end, size) = (bytes.len() as u64, bytes.len() as u64 - start);
    bytes.extend(b"PK\x06\x06");
    bytes.extend(44_u64.to_le_bytes());
    fields(&mut bytes, &[45, 45, 0, 0, 0, 0]);
    [count, count, size, start].iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    bytes.extend(b"PK\x06\x07\0\0\0\0");
    bytes.extend(end.to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(b"PK\x05\x06");
    fields(&mut bytes, &[0, 0, 0xffff, 0xffff, 0xffff, 0xffff, 0xffff, 0xffff, 0]);
    bytes
}

#[test]
fn a_million_entries_are_counted_and_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("many.fmu");
    std::fs::write(&path, handmade((0..1_000_000).map(|k| format!("x/{k}")), 5)).unwrap();
    assert!(refused(&path, Limits::default()).contains("more than 10000 entries"));
    // The same made by hand with one entry is an archive.
    std::fs::write(&path, handmade(std::iter::once("resources/x".to_owned()), 5)).unwrap();
    let unpacked = unpack(&path, Limits::default()).unwrap();
    assert_eq!(std::fs::read(unpacked.path().join("resources/x")).unwrap(), b"hello");
}

#[test]
fn entries_over_the_same_bytes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("over.fmu");
    std::fs::write(&path, handmade(["resources/x", "resources/y"].map(str::to_owned).into_iter(), 5))
        .unwrap();
    let error = refused(&path, Limits::default());
    assert!(error.contains("laid over another one"), "{error}");
}

#[test]
fn sizes_that_lie_help_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("liar.fmu");
    // Says 3 GiB: refused for what it says. Says 1 byte: counted.
    std::fs::write(&path, handmade(std::iter::once("resources/x".to_owned()), 3 << 30)).unwrap();
    assert!(refused(&path, Limits::default()).contains("more than 1073741824 bytes"));
    zip(&path, &[("resources/zeros", &[0; 100_000])]);
    let mut bytes = std::fs::read(&path).unwrap();
    let size = 100_000_u32.to_le_bytes();
    for at in 0..bytes.len() - 4 {
        if bytes[at..at + 4] == size {
            bytes[at..at + 4].copy_from_slice(&1_u32.to_le_bytes());
        }
    }
    std::fs::write(&path, bytes).unwrap();
    let error = refused(&path, Limits { entries: 10, bytes: 1000 });
    assert!(error.contains("more than 1000 bytes") || error.contains("not a readable zip"), "{error}");
}

/// One attribute of more than the limit of a whole archive, a thousandth of that on disk.
#[test]
fn a_description_of_one_endless_attribute_is_refused_before_it_is_unpacked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("attribute.fmu");
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    let fast = zip::write::SimpleFileOptions::default().compression_level(Some(1)).large_file(true);
    zip.start_file("modelDescription.xml", fast).unwrap();
    zip.write_all(b"<fmiModelDescription fmiVersion=\"2.0\" modelName=\"").unwrap();
    let piece = vec![b'a'; 1 << 20];
    for _ in 0..1025 {
        zip.write_all(&piece).unwrap();
    }
    zip.write_all(b"\"/>").unwrap();
    zip.finish().unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() < 20 << 20);
    assert!(refused(&path, Limits::default()).contains("more than 1073741824 bytes"));
}

#[test]
fn names_too_long_for_a_file_system_and_names_that_move_the_cursor() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("names.fmu");
    std::fs::write(&path, handmade(std::iter::once("a/".repeat(20_000) + "x"), 5)).unwrap();
    assert!(refused(&path, Limits::default()).contains("named by more than 1024 bytes"));
    std::fs::write(&path, handmade(std::iter::once("../\u{1b}[2J".to_owned()), 5)).unwrap();
    let error = refused(&path, Limits::default());
    assert!(error.contains("leaves the archive") && !error.contains('\u{1b}'), "{error}");
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
fn entity_bombs_and_external_entities_are_not_even_looked_at() {
    let laughs: String =
        (1..10).map(|k| format!("<!ENTITY l{k} \"{}\">", format!("&l{};", k - 1).repeat(10))).collect();
    let bomb = format!(
        "<?xml version=\"1.0\"?>\n<!DOCTYPE l [<!ENTITY l0 \"ha\">{laughs}]>\n<fmiModelDescription modelName=\"&l9;\"/>"
    );
    let folder = tempfile::tempdir().unwrap();
    let secret = folder.path().join("secret");
    std::fs::write(&secret, "password").unwrap();
    let external = format!(
        "<?xml version=\"1.0\"?>\n<!DOCTYPE x [<!ENTITY e SYSTEM \"file://{}\">]>\n<fmiModelDescription>&e;\
         </fmiModelDescription>",
        secret.display()
    );
    let outside =
        "<?xml version=\"1.0\"?>\n<!DOCTYPE x SYSTEM \"http://127.0.0.1:9/x.dtd\">\n<fmiModelDescription/>";
    for xml in [&bomb, &external, outside] {
        let error = read(xml).unwrap_err();
        assert!(error.contains("line 2: found a DOCTYPE; expected none"), "{error}");
        assert!(!error.contains("password"));
    }
}

#[test]
fn tags_and_depths_that_no_fmu_has_are_refused() {
    let good = integrator_xml();
    let long = |n: usize| good.replacen("modelName=\"", &format!("modelName=\"{}", "a".repeat(n)), 1);
    assert_eq!(read(long(500_000)).unwrap().model_name.len(), 500_000 + "Integrator & co".len());
    let error = read(long(1 << 20)).unwrap_err();
    assert!(error.contains("line 2: found a tag of ") && error.contains("at most 1048576 bytes"), "{error}");
    let deep = |n: usize| {
        let inside =
            format!("<VendorAnnotations>{}{}</VendorAnnotations></fmi", "<a>".repeat(n), "</a>".repeat(n));
        good.replacen("</fmi", &inside, 1)
    };
    assert!(read(deep(60)).is_ok());
    let error = read(deep(1_000_000)).unwrap_err();
    assert!(error.contains("an element inside 64 others"), "{error}");
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

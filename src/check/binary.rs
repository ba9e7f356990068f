//! The shared libraries, for every platform, read as files and never loaded: name, format, the functions of the
//! standard, foreign symbols, needed libraries, the glibc that they ask for.

use super::archive::Contents;
use super::document::Document;
use super::finding::{Finding, Place, first_of};
use super::rules::{self, Rule};
use object::read::{File, ImportFlags, NameOrOrdinal};
use object::{Architecture, BinaryFormat, Object};
use std::collections::BTreeSet;

/// Folder under `binaries/`, extension, format, machine.
type Platform = (&'static str, &'static str, BinaryFormat, Architecture);
const PLATFORMS: [Platform; 9] = [
    ("linux64", "so", BinaryFormat::Elf, Architecture::X86_64),
    ("linux32", "so", BinaryFormat::Elf, Architecture::I386),
    ("aarch64-linux", "so", BinaryFormat::Elf, Architecture::Aarch64),
    ("linux-aarch64", "so", BinaryFormat::Elf, Architecture::Aarch64),
    ("win64", "dll", BinaryFormat::Pe, Architecture::X86_64),
    ("win32", "dll", BinaryFormat::Pe, Architecture::I386),
    ("darwin64", "dylib", BinaryFormat::MachO, Architecture::X86_64),
    ("aarch64-darwin", "dylib", BinaryFormat::MachO, Architecture::Aarch64),
    ("darwin-aarch64", "dylib", BinaryFormat::MachO, Architecture::Aarch64),
];

const COMMON: &str = "GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment \
    EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString SetReal \
    SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate \
    DeSerializeFMUstate GetDirectionalDerivative";
const CO_SIMULATION: &str = "SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus \
    GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus";
const MODEL_EXCHANGE: &str = "EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep \
    SetTime SetContinuousStates GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates";

/// Libraries that every system of that kind has.
const ELF_SYSTEM: &[&str] =
    &["libc.so", "libm.so", "libpthread.so", "libdl.so", "librt.so", "libgcc_s.so", "ld-linux"];
const PE_SYSTEM: &[&str] = &[
    "kernel32",
    "ntdll",
    "msvcrt",
    "api-ms-win-",
    "ucrtbase",
    "user32",
    "advapi32",
    "ws2_32",
    "userenv",
    "bcrypt",
    "shell32",
    "ole32",
    "synchronization",
];
/// What linkers put into every library.
const LINKER: &[&str] = &["_init", "_fini", "__bss_start", "_edata", "_end", "DllMain", "DllEntryPoint"];
/// The glibc that the oldest systems in use have (CentOS 7).
const OLD_GLIBC: (u32, u32) = (2, 17);

/// What is wrong with the libraries; adds what is there to `facts`.
pub fn check(
    document: &Document<'_>,
    contents: &Contents,
    facts: &mut Vec<(String, String)>,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    let folder = |path: &str| path.split('/').nth(1).unwrap_or_default().to_owned();
    let folders: BTreeSet<String> = contents
        .binaries
        .keys()
        .filter(|path| path.split('/').count() > 2)
        .map(|path| folder(path))
        .collect();
    if folders.is_empty() {
        let (found, mend) = if contents.has_sources {
            ("sources only", "compile the sources and add the library")
        } else {
            ("neither binaries nor sources", "export the FMU again")
        };
        let place = Place::file("binaries/");
        findings.push(Finding::new(&rules::NO_BINARY, place, found, "binaries/linux64/, win64/, ...", mend));
        return findings;
    }
    let list = folders.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
    facts.push(("platforms".to_owned(), list.clone()));
    for name in &folders {
        let Some(platform) = PLATFORMS.iter().find(|(known, ..)| known == name) else {
            findings.push(Finding::new(
                &rules::PLATFORM,
                Place::file(format!("binaries/{name}/")),
                "a platform that importers do not know",
                "linux64, win64, darwin64, ...",
                "rename the folder, if it is one of these",
            ));
            continue;
        };
        one_platform(document, contents, platform, facts, &mut findings);
    }
    let absent: Vec<&str> =
        ["linux64", "win64", "darwin64"].into_iter().filter(|name| !folders.contains(*name)).collect();
    if !absent.is_empty() {
        findings.push(Finding::new(
            &rules::PLATFORMS,
            Place::file("binaries/"),
            format!("{list}; nothing for {}", absent.join(", ")),
            "the platforms that its users have",
            "add their libraries, if they are wanted",
        ));
    }
    findings
}

fn one_platform(
    document: &Document<'_>,
    contents: &Contents,
    platform: &Platform,
    facts: &mut Vec<(String, String)>,
    findings: &mut Vec<Finding>,
) {
    let (folder, extension, ..) = platform;
    let identifiers: BTreeSet<&str> =
        document.implementations.iter().filter_map(|node| node.attribute("modelIdentifier")).collect();
    for identifier in identifiers {
        let path = format!("binaries/{folder}/{identifier}.{extension}");
        let Some(bytes) = contents.binaries.get(&path) else {
            let prefix = format!("binaries/{folder}/");
            let there: Vec<&str> =
                contents.binaries.keys().filter_map(|name| name.strip_prefix(prefix.as_str())).collect();
            findings.push(Finding::new(
                &rules::BINARY_NAME,
                Place::file(path),
                format!("not there; the folder holds {}", there.join(", ")),
                "a library named like modelIdentifier",
                "rename the library or modelIdentifier",
            ));
            continue;
        };
        let of = |name| document.implementations.iter().any(|n| n.has_tag_name(name));
        let mut wanted: Vec<&str> = COMMON.split_whitespace().collect();
        if of("CoSimulation") {
            wanted.extend(CO_SIMULATION.split_whitespace());
        }
        if of("ModelExchange") {
            wanted.extend(MODEL_EXCHANGE.split_whitespace());
        }
        match File::parse(bytes.as_slice()) {
            Ok(file) => library(&path, &file, platform, &wanted, contents, facts, findings),
            Err(error) => findings.push(Finding::new(
                &rules::BINARY_FORMAT,
                Place::file(path),
                format!("no shared library ({error})"),
                format!("a library for {folder}"),
                "put the right file there",
            )),
        }
    }
}

fn library(
    path: &str,
    file: &File<'_>,
    (folder, _, format, machine): &Platform,
    wanted: &[&str],
    contents: &Contents,
    facts: &mut Vec<(String, String)>,
    findings: &mut Vec<Finding>,
) {
    let mut complain = |rule: &'static Rule, found: String, expected: &str, mend: &str| {
        findings.push(Finding::new(rule, Place::file(path), found, expected, mend));
    };
    // A Mach-O library may hold several machines; the first slice is another's, perhaps.
    if file.format() != *format || (file.architecture() != *machine && *format != BinaryFormat::MachO) {
        let found = format!("{:?} for {:?}", file.format(), file.architecture());
        let expected = format!("{format:?} for {machine:?}");
        complain(&rules::BINARY_FORMAT, found, &expected, "put the library into the folder of its platform");
        return;
    }
    let mut exported = BTreeSet::new();
    for export in file.exports().into_iter().flatten().flatten() {
        if let NameOrOrdinal::Name(name) = export.name() {
            let name = String::from_utf8_lossy(name).into_owned();
            // Mach-O puts an underscore before every C name.
            let name =
                if *format == BinaryFormat::MachO { name.trim_start_matches('_').to_owned() } else { name };
            exported.insert(name);
        }
    }
    let missing: Vec<String> =
        wanted.iter().map(|name| format!("fmi2{name}")).filter(|name| !exported.contains(name)).collect();
    if !missing.is_empty() {
        complain(
            &rules::FUNCTIONS,
            format!("misses {}", first_of(&missing)),
            &format!("all {} functions of FMI 2.0 for what it implements", wanted.len()),
            "export them all; one that is not supported returns fmi2Error",
        );
    }
    let foreign: Vec<String> = exported
        .iter()
        .filter(|name| {
            !name.starts_with("fmi2") && !name.starts_with("fmi3") && !LINKER.contains(&name.as_str())
        })
        .cloned()
        .collect();
    if !foreign.is_empty() {
        complain(
            &rules::FOREIGN,
            format!("{} other symbols exported: {}", foreign.len(), first_of(&foreign)),
            "fmi2... only, or fmi3... beside it",
            "hide them: -fvisibility=hidden, a version script or a .def file",
        );
    }
    let libraries: Vec<String> = file
        .import_libraries()
        .into_iter()
        .flatten()
        .flatten()
        .map(|library| String::from_utf8_lossy(library.name()).into_owned())
        .collect();
    let system: &[&str] = if *format == BinaryFormat::Pe { PE_SYSTEM } else { ELF_SYSTEM };
    let other: Vec<String> = libraries
        .iter()
        .filter(|name| {
            let plain = name.to_lowercase();
            let is_system = *format == BinaryFormat::MachO
                && (plain.starts_with("/usr/lib/") || plain.starts_with("/system/"));
            let beside = format!("binaries/{folder}/{name}");
            !is_system
                && !system.iter().any(|start| plain.starts_with(start))
                && !contents.binaries.contains_key(&beside)
        })
        .cloned()
        .collect();
    if !other.is_empty() {
        complain(
            &rules::LIBRARY,
            format!("needs {}", first_of(&other)),
            "the C runtime only, or libraries in the same folder",
            "link it statically, or put it beside the library",
        );
    }
    let glibc = newest_glibc(file);
    if let Some((major, minor)) = glibc.filter(|version| *version > OLD_GLIBC) {
        complain(
            &rules::GLIBC,
            format!("needs GLIBC_{major}.{minor}"),
            "GLIBC_2.17 or older, to load on every Linux in use",
            "build against an old glibc, for example with cargo-zigbuild or in a manylinux container",
        );
    }
    let version = glibc.map_or(String::new(), |(major, minor)| format!(", GLIBC_{major}.{minor}"));
    let needs = if libraries.is_empty() { "nothing".to_owned() } else { libraries.join(", ") };
    facts.push((path.to_owned(), format!("{} exports, needs {needs}{version}", exported.len())));
}

/// The newest symbol version of glibc that an import asks for.
fn newest_glibc(file: &File<'_>) -> Option<(u32, u32)> {
    let versions = file.imports().into_iter().flatten().flatten().filter_map(|import| match import.flags() {
        ImportFlags::Elf { version: Some(version), .. } => {
            let text = std::str::from_utf8(version).ok()?.strip_prefix("GLIBC_")?;
            let mut parts = text.split('.').map(|part| part.parse().ok());
            Some((parts.next()??, parts.next()??))
        }
        _ => None,
    });
    versions.max()
}

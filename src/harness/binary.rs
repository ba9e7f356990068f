//! Whether a library suits this machine and is whole, read from its first bytes and never loaded: the system's loader
//! may crash on a library that is cut short.

use object::read::elf::{FileHeader, ProgramHeader};
use object::read::{FileKind, ReadCache, ReadRef};
use object::{Endianness, elf};
use std::fs::File;
use std::io;
use std::path::Path;

#[cfg(target_arch = "aarch64")]
const MACHINE: (elf::Machine, &str) = (elf::EM_AARCH64, "an ELF library for aarch64");
#[cfg(not(target_arch = "aarch64"))]
const MACHINE: (elf::Machine, &str) = (elf::EM_X86_64, "an ELF library for x86-64");

/// What the file is instead, and what it should be; none if it may be loaded. Only ELF is known, which is what
/// Linux loads.
pub(super) fn unfit(path: &Path) -> io::Result<Option<(String, &'static str)>> {
    if !cfg!(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64"))) {
        return Ok(None);
    }
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let cache = ReadCache::new(file);
    let found = match FileKind::parse(&cache) {
        Ok(FileKind::Elf64) => elf64(&cache, length),
        Ok(FileKind::Elf32) => Some("a 32-bit ELF file".to_owned()),
        Ok(FileKind::Pe32 | FileKind::Pe64) => Some("a Windows library".to_owned()),
        Ok(FileKind::MachO32 | FileKind::MachO64 | FileKind::MachOFat32 | FileKind::MachOFat64) => {
            Some("a macOS library".to_owned())
        }
        Ok(other) => Some(format!("a file of another kind ({other:?})")),
        Err(_) if length == 0 => Some("an empty file".to_owned()),
        Err(_) => Some("no library at all".to_owned()),
    };
    Ok(found.map(|found| (found, MACHINE.1)))
}

fn elf64<'data, R: ReadRef<'data>>(data: R, length: u64) -> Option<String> {
    let cut = || Some(format!("an ELF library that is cut short at {length} bytes"));
    let Ok(header) = elf::FileHeader64::<Endianness>::parse(data) else { return cut() };
    let Ok(endian) = header.endian() else { return Some("an ELF file of no byte order".to_owned()) };
    if header.e_machine(endian) != MACHINE.0 {
        return Some(match header.e_machine(endian) {
            elf::EM_X86_64 => "an ELF library for x86-64".to_owned(),
            elf::EM_AARCH64 => "an ELF library for aarch64".to_owned(),
            other => format!("an ELF library for another machine ({other:?})"),
        });
    }
    if header.e_type(endian) != elf::ET_DYN {
        return Some("an ELF file that is no shared library".to_owned());
    }
    let Ok(segments) = header.program_headers(endian, data) else { return cut() };
    let is_cut = segments.iter().any(|segment| {
        let end = segment.p_offset(endian).checked_add(segment.p_filesz(endian));
        end.is_none_or(|end| end > length)
    });
    if is_cut { cut() } else { None }
}

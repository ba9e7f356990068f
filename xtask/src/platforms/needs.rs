//! What a shared library asks of the system that loads it: the newest glibc among its symbol versions.

use super::Built;
use crate::error::Failure;

/// `GLIBC_2.34`, the newest of both libraries; none if they name no glibc, as those for Windows do.
pub fn needs(built: &Built) -> Result<Option<String>, Failure> {
    let mut newest = None;
    for file in &built.files {
        let bytes = std::fs::read(file).map_err(Failure::file("read", file))?;
        newest = newest.max(newest_glibc(&bytes));
    }
    Ok(newest.map(|(major, minor)| format!("GLIBC_{major}.{minor}")))
}

/// An ELF file names the versions it needs as strings that end in a zero byte.
fn newest_glibc(bytes: &[u8]) -> Option<(u32, u32)> {
    const PREFIX: &[u8] = b"GLIBC_";
    let starts = bytes.windows(PREFIX.len()).enumerate().filter(|(_, window)| *window == PREFIX);
    let versions = starts.filter_map(|(at, _)| {
        let rest = bytes.get(at + PREFIX.len()..)?;
        let end = rest.iter().take(16).position(|&byte| byte == 0)?;
        let mut numbers = std::str::from_utf8(rest.get(..end)?).ok()?.split('.');
        Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
    });
    versions.max()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_compared_as_numbers() {
        let bytes = b"\x7fELF\0GLIBC_2.4\0GLIBC_2.17\0libc.so.6\0GLIBC_2.2.5\0GLIBC_PRIVATE\0GLIBC_2.9";
        assert_eq!(newest_glibc(bytes), Some((2, 17)));
        assert_eq!(newest_glibc(b"MZ"), None);
    }
}

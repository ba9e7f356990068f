//! The folder behind `fmuResourceLocation`, in all the spellings that masters use. Pure text: whether
//! the folder can be read, the model finds out.

use std::path::PathBuf;

/// Reads a `file:` URI (RFC 8089) or a plain path. The error says what was found and expected.
pub fn to_path(location: &[u8]) -> Result<PathBuf, String> {
    let bytes = to_bytes(location, cfg!(windows))?;
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStringExt;
        Ok(PathBuf::from(std::ffi::OsString::from_vec(bytes)))
    }
    #[cfg(not(unix))]
    String::from_utf8(bytes).map(PathBuf::from).map_err(|_| describe(location, "is not valid UTF-8"))
}

fn describe(location: &[u8], problem: &str) -> String {
    format!(
        "fmuResourceLocation \"{}\" {problem}; expected the URI of the unpacked resources folder, like \
         file:///path/to/resources",
        String::from_utf8_lossy(location)
    )
}

fn to_bytes(location: &[u8], windows: bool) -> Result<Vec<u8>, String> {
    if location.is_empty() {
        return Err(describe(location, "is empty"));
    }
    let Some(after) = strip_scheme(location) else {
        if let Some(end) = location.windows(3).position(|w| w == b"://")
            && location[..end].iter().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(b))
        {
            return Err(describe(location, "has another scheme than file"));
        }
        return Ok(without_trailing_slash(location.to_vec()));
    };
    let path = match after.strip_prefix(b"//") {
        None => percent_decoded(after),
        Some(rest) => {
            let host_end = rest.iter().position(|b| *b == b'/' || *b == b'\\').unwrap_or(rest.len());
            let (host, path) = rest.split_at(host_end);
            let path = percent_decoded(path);
            if host.is_empty() || host.eq_ignore_ascii_case(b"localhost") {
                // Four slashes (Ecos, OMSimulator) are three and the root again; on Windows they
                // also begin a share.
                let slashes = path.iter().take_while(|b| **b == b'/').count();
                let drive = starts_with_drive(&path[slashes..]);
                if slashes > 1 && (!windows || drive) { path[slashes - 1..].to_vec() } else { path }
            } else if starts_with_drive(host) {
                // file://C:/p, where two slashes were meant to be three.
                [b"/", host, path.as_slice()].concat()
            } else if windows {
                [b"//", host, path.as_slice()].concat()
            } else {
                return Err(describe(location, "names another computer"));
            }
        }
    };
    if path.is_empty() {
        return Err(describe(location, "has no path"));
    }
    if path.contains(&0) {
        return Err(describe(location, "contains a NUL character"));
    }
    let drive = path.first() == Some(&b'/') && starts_with_drive(&path[1..]);
    let path = if windows && drive { path[1..].to_vec() } else { path };
    Ok(without_trailing_slash(path))
}

fn strip_scheme(location: &[u8]) -> Option<&[u8]> {
    let (scheme, rest) = location.split_at_checked(5)?;
    scheme.eq_ignore_ascii_case(b"file:").then_some(rest)
}

/// `C:` or the older `C|`, alone or before a separator.
fn starts_with_drive(path: &[u8]) -> bool {
    matches!(path, [letter, b':' | b'|'] | [letter, b':' | b'|', b'/' | b'\\', ..] if letter.is_ascii_alphabetic())
}

/// `%41` is `A`; a percent sign without two hexadecimal digits stands for itself, because some
/// masters do not encode at all.
fn percent_decoded(text: &[u8]) -> Vec<u8> {
    let digit = |b: Option<&u8>| b.and_then(|b| char::from(*b).to_digit(16));
    let mut out = Vec::with_capacity(text.len());
    let mut position = 0;
    while let Some(byte) = text.get(position) {
        match (byte, digit(text.get(position + 1)), digit(text.get(position + 2))) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                position += 3;
            }
            _ => {
                out.push(*byte);
                position += 1;
            }
        }
    }
    out
}

/// Without slashes at the end, but a root stays a root.
fn without_trailing_slash(mut path: Vec<u8>) -> Vec<u8> {
    while path.len() > 1 && path.ends_with(b"/") && !(path.len() == 3 && starts_with_drive(&path)) {
        path.pop();
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on(windows: bool, location: &str) -> Result<String, String> {
        to_bytes(location.as_bytes(), windows).map(|bytes| String::from_utf8(bytes).unwrap())
    }

    #[test]
    fn the_spellings_of_masters_on_unix() {
        for location in [
            "file:///tmp/a b/res",
            "file:///tmp/a%20b/res",
            "file:////tmp/a%20b/res",
            "file:/tmp/a%20b/res",
            "file://localhost/tmp/a%20b/res",
            "FILE:///tmp/a%20b/res",
            "file:///tmp/a%20b/res/",
            "file:///tmp/a b/res//",
            "/tmp/a b/res",
            "/tmp/a b/res/",
        ] {
            assert_eq!(on(false, location).as_deref(), Ok("/tmp/a b/res"), "{location}");
        }
    }

    #[test]
    fn utf_8_raw_and_encoded_and_lone_percent_signs() {
        assert_eq!(on(false, "file:///tmp/Gr%C3%B6%C3%9fe").as_deref(), Ok("/tmp/Größe"));
        assert_eq!(on(false, "file:///tmp/Größe").as_deref(), Ok("/tmp/Größe"));
        assert_eq!(on(false, "file:///tmp/100% sure/%zz/5%").as_deref(), Ok("/tmp/100% sure/%zz/5%"));
        assert_eq!(on(false, "/tmp/a%20b").as_deref(), Ok("/tmp/a%20b"), "a plain path is not decoded");
        assert_eq!(on(false, "file:///tmp/a+b#c?d").as_deref(), Ok("/tmp/a+b#c?d"));
        assert_eq!(on(false, "file:///").as_deref(), Ok("/"));
    }

    #[test]
    fn drives_and_shares_on_windows() {
        for location in [
            "file:///C:/fmu/res",
            "file:////C:/fmu/res",
            "file:/C:/fmu/res",
            "file://C:/fmu/res",
            "file://localhost/C:/fmu/res/",
            "file:C:/fmu/res",
            "C:/fmu/res",
        ] {
            assert_eq!(on(true, location).as_deref(), Ok("C:/fmu/res"), "{location}");
        }
        assert_eq!(on(true, r"C:\fmu\res").as_deref(), Ok(r"C:\fmu\res"));
        assert_eq!(on(true, "file://server/share/res").as_deref(), Ok("//server/share/res"));
        assert_eq!(on(true, "file:////server/share/res").as_deref(), Ok("//server/share/res"));
        assert_eq!(on(true, "file:///C:/").as_deref(), Ok("C:/"));
    }

    #[test]
    fn what_is_no_local_folder_is_refused_with_the_text() {
        for location in
            ["", "http://host/res", "fmu+https://host/res", "file://server/res", "file:", "file:///a%00b"]
        {
            let error = on(false, location).expect_err(location);
            assert!(error.contains(&format!("\"{location}\"")) && error.contains("expected"), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn bytes_that_are_no_utf_8_survive_on_unix() {
        use std::os::unix::ffi::OsStrExt;
        let path = to_path(b"file:///tmp/%ff%fe").unwrap();
        assert_eq!(path.as_os_str().as_bytes(), b"/tmp/\xff\xfe");
    }
}

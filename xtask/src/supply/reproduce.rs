//! The same bytes wherever a library is built: the compiler's flags that keep this machine's folders out of it, and
//! the proof, a second build of the same sources in other folders. Compares; mends nothing.

use crate::{
    error::Failure,
    fmu, licenses,
    platforms::{Built, MODELS, Platform},
    process::{command, output},
    workspace::Workspace,
};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

/// Where the sources of crates are, as a library's panic messages tell it.
const CRATES: &str = "/crates";
/// Where this project's are.
const OURS: &str = "/bess-consensus";

/// Has cargo name the same folders in what it builds on every machine. The flags count for cargo's cache, so builds
/// with them need a target folder of their own, or everything else in it is built anew.
pub fn remapped(
    build: &mut Command,
    workspace: &Workspace,
    platform: Option<Platform>,
    home: Option<&Path>,
) -> Result<(), Failure> {
    // Between the flags; a folder's name may have spaces.
    let separator = "\u{1f}";
    let mut flags: Vec<String> = std::env::var("RUSTFLAGS")
        .map(|given| given.split_whitespace().map(str::to_owned).collect())
        .unwrap_or_default();
    flags.push(format!("--remap-path-prefix={}={OURS}", workspace.root.display()));
    // The last that fits counts, and the registry may lie inside the workspace.
    let mut folders: BTreeSet<PathBuf> = licenses::folders(workspace)?
        .into_values()
        .filter(|folder| !folder.starts_with(&workspace.root))
        .filter_map(|folder| folder.parent().map(Path::to_path_buf))
        .collect();
    if let Some(home) = home {
        build.env("CARGO_HOME", home);
        folders = entries(&home.join("registry/src"))?;
    }
    flags.extend(folders.iter().map(|folder| format!("--remap-path-prefix={}={CRATES}", folder.display())));
    if platform == Some(Platform::Win64) {
        // GNU's linker writes the time of day into a library's header, and an address made of the path it has.
        flags.push("-Clink-arg=-Wl,--no-insert-timestamp,--disable-auto-image-base".to_owned());
    }
    build.env("CARGO_ENCODED_RUSTFLAGS", flags.join(separator));
    Ok(())
}

/// What is in a folder, by path.
fn entries(folder: &Path) -> Result<BTreeSet<PathBuf>, Failure> {
    let entries = std::fs::read_dir(folder).map_err(Failure::file("list", folder))?;
    Ok(entries.flatten().map(|entry| entry.path()).collect())
}

/// Builds the libraries of these packages again, in another folder with another target folder and another cargo
/// home, and compares them with those built here.
pub fn reproduce(workspace: &Workspace, only: Option<&str>) -> Result<(), Failure> {
    let platform = Platform::must_be_here()?;
    let models: Vec<_> =
        MODELS.into_iter().filter(|(_, model)| only.is_none_or(|only| only == *model)).collect();
    for (package, _) in &models {
        fmu::build_library(workspace, package, None)?;
    }
    let first = fmu::libraries(workspace, platform);

    let copy = std::env::temp_dir().join(format!("bess-reproduce-{}", std::process::id()));
    let begin = Instant::now();
    let compared = second(workspace, &copy, platform, &models).and_then(|second| same(&first, &second));
    if compared.is_ok() {
        println!("built a second time in {:.0} s", begin.elapsed().as_secs_f64());
        std::fs::remove_dir_all(&copy).map_err(Failure::file("remove", &copy))?;
    }
    compared
}

/// The second build. What this project's git knows is copied as it is now, committed or not.
fn second(
    workspace: &Workspace,
    folder: &Path,
    platform: Platform,
    models: &[(&str, &str)],
) -> Result<Built, Failure> {
    let copy = Workspace { root: folder.join("elsewhere/sources"), target: folder.join("t") };
    for name in output(command(workspace, "git").args(["ls-files", "-z"]))?.split_terminator('\0') {
        let (from, to) = (workspace.root.join(name), copy.root.join(name));
        // Deleted and not yet committed.
        if !from.is_file() {
            continue;
        }
        let parent = to.parent().unwrap_or(&copy.root);
        std::fs::create_dir_all(parent).map_err(Failure::file("make", parent))?;
        std::fs::copy(&from, &to).map_err(Failure::file("copy", &from))?;
    }
    let home = cargo_home(folder)?;
    for (package, _) in models {
        fmu::build_library(&copy, package, Some(&home))?;
    }
    Ok(fmu::libraries(&copy, platform))
}

/// Another cargo home with the same crates in it, so that nothing is fetched again.
fn cargo_home(folder: &Path) -> Result<PathBuf, Failure> {
    let home = folder.join("home");
    std::fs::create_dir_all(&home).map_err(Failure::file("make", &home))?;
    let ours = std::env::var_os("CARGO_HOME")
        .map(PathBuf::from)
        .or_else(|| std::env::var_os("HOME").map(|home| Path::new(&home).join(".cargo")));
    let Some(ours) = ours.filter(|ours| ours.join("registry").is_dir()) else { return Ok(home) };
    for name in ["registry", "config.toml"] {
        #[cfg(unix)]
        if ours.join(name).exists() {
            let link = home.join(name);
            std::os::unix::fs::symlink(ours.join(name), &link).map_err(Failure::file("link", &link))?;
        }
    }
    Ok(home)
}

/// Fails at the first library of the second build that is another one than in the first.
fn same(first: &Built, second: &Built) -> Result<(), Failure> {
    let read = |path: &Path| std::fs::read(path).map_err(Failure::file("read", path));
    for (one, two) in first.files.iter().zip(&second.files).filter(|(_, two)| two.exists()) {
        let (a, b) = (read(one)?, read(two)?);
        let name = one.file_name().unwrap_or_default().to_string_lossy();
        if let Some(finding) = difference(&a, &b) {
            return Err(Failure::Other(format!(
                "{name}: {finding}; compare {} with {}",
                one.display(),
                two.display()
            )));
        }
        println!("{name}: {} bytes, the same in both builds", a.len());
    }
    Ok(())
}

/// How two files differ, if they do.
fn difference(a: &[u8], b: &[u8]) -> Option<String> {
    let at = a.iter().zip(b).position(|(a, b)| a != b);
    match at {
        Some(at) => {
            let count = a.iter().zip(b).filter(|(a, b)| a != b).count();
            Some(format!("{count} bytes differ, the first at {at:#x} ({} and {} bytes)", a.len(), b.len()))
        }
        None if a.len() == b.len() => None,
        None => Some(format!("{} and {} bytes long", a.len(), b.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_byte_is_a_difference() {
        assert_eq!(difference(b"abc", b"abc"), None);
        assert!(difference(b"abc", b"axc").expect("differs").contains("1 bytes differ, the first at 0x1"));
        assert_eq!(difference(b"ab", b"abc").expect("differs"), "2 and 3 bytes long");
    }

    #[test]
    fn the_folders_of_this_machine_are_named_away() {
        let workspace = Workspace::find().expect("a workspace");
        let mut build = Command::new("cargo");
        remapped(&mut build, &workspace, Some(Platform::Linux64), None).expect("cargo knows its folders");
        let flags = build
            .get_envs()
            .find(|(name, _)| *name == "CARGO_ENCODED_RUSTFLAGS")
            .and_then(|(_, value)| value);
        let flags = flags.expect("set").to_string_lossy().into_owned();
        let ours = format!("--remap-path-prefix={}={OURS}", workspace.root.display());
        assert!(flags.split('\u{1f}').any(|flag| flag == ours), "{flags}");
        assert!(flags.ends_with(&format!("={CRATES}")), "{flags}");
    }
}

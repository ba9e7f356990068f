//! Links the unwinder into the FMU's shared library: without this the library would need libgcc_s at run time,
//! which an FMU cannot count on. The panic fence needs an unwinder, so it cannot be left out.

use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=../build.rs");
    let target = |name: &str| std::env::var(format!("CARGO_CFG_TARGET_{name}")).unwrap_or_default();
    let native = std::env::var("HOST") == std::env::var("TARGET");
    if native && target("OS") == "linux" && target("ENV") == "gnu" {
        // Where it does not work the library links libgcc_s as usual; `cargo xtask` says what a library needs.
        if let Some(folder) = stand_in() {
            println!("cargo::rustc-link-search=native={}", folder.display());
        }
    }
}

/// A folder with a linker script `libgcc_s.so`, which stands in for the real one and names the static halves.
/// rustc asks for `-lgcc_s` by name, and so `-static-libgcc` alone has no effect.
fn stand_in() -> Option<PathBuf> {
    let (unwinder, arithmetic) = (static_library("libgcc_eh.a")?, static_library("libgcc.a")?);
    // Another gcc has them elsewhere.
    println!("cargo::rerun-if-changed={}", unwinder.display());
    let folder = PathBuf::from(std::env::var_os("OUT_DIR")?);
    let script = format!("GROUP ( {} {} )\n", unwinder.display(), arithmetic.display());
    std::fs::write(folder.join("libgcc_s.so"), script).ok()?;
    Some(folder)
}

/// Where gcc has one of its libraries; it answers with the bare name if it has none.
fn static_library(name: &str) -> Option<PathBuf> {
    let output = Command::new("cc").arg(format!("-print-file-name={name}")).output().ok()?;
    let path = PathBuf::from(String::from_utf8(output.stdout).ok()?.trim());
    let plain = |path: &Path| path.to_str().is_some_and(|path| !path.contains(char::is_whitespace));
    (path.is_absolute() && path.is_file() && plain(&path)).then_some(path)
}

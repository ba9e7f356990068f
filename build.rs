//! Builds the importer's C logger shim (feature `host`) and, on request, the FMI 2.0 bindings
//! (feature `bindgen`, which alone needs libclang).

fn main() {
    println!("cargo:rerun-if-changed=src/harness/logger.c");
    println!("cargo:rerun-if-changed=src/fmi/headers");

    #[cfg(feature = "host")]
    cc::Build::new()
        .file("src/harness/logger.c")
        .include("src/fmi/headers")
        .warnings(true)
        .warnings_into_errors(true)
        .compile("bess_logger");

    #[cfg(feature = "bindgen")]
    write_bindings();
}

/// Writes `bindings.rs` into OUT_DIR; a test compares it with the checked-in `src/fmi/bindings.rs`.
#[cfg(feature = "bindgen")]
fn write_bindings() {
    let out = std::path::PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    bindgen::Builder::default()
        .header("src/fmi/headers/wrapper.h")
        .allowlist_file(".*/fmi2[A-Za-z]*\\.h")
        .blocklist_function(".*")
        .allowlist_recursively(true)
        .generate_comments(false)
        .layout_tests(false)
        .merge_extern_blocks(true)
        .raw_line("// The C types of FMI 2.0.1, made by bindgen from `headers/`. Do not edit: see build.rs.")
        .generate()
        .expect("bindgen reads src/fmi/headers")
        .write_to_file(out.join("bindings.rs"))
        .expect("OUT_DIR is writable");
}

//! Builds the importer's C logger shim (feature `host`) and, on request, the FMI bindings
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

/// Writes the bindings of both standards into OUT_DIR; a test compares them with those checked in, `src/fmi/bindings.rs`
/// and `src/fmi/three/bindings.rs`.
#[cfg(feature = "bindgen")]
fn write_bindings() {
    let out = std::path::PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    for (version, prefix, wrapper, file) in
        [("2.0.1", "fmi2", "wrapper.h", "bindings.rs"), ("3.0", "fmi3", "wrapper3.h", "bindings3.rs")]
    {
        bindgen::Builder::default()
            .header(format!("src/fmi/headers/{wrapper}"))
            .allowlist_file(format!(".*/{prefix}[A-Za-z]*\\.h"))
            .blocklist_function(".*")
            .allowlist_recursively(true)
            .generate_comments(false)
            .layout_tests(false)
            .merge_extern_blocks(true)
            .raw_line(format!(
                "// The C types of FMI {version}, made by bindgen from `headers/`. Do not edit: see build.rs."
            ))
            .generate()
            .expect("bindgen reads src/fmi/headers")
            .write_to_file(out.join(file))
            .expect("OUT_DIR is writable");
    }
}

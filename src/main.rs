//! The `bess` command; everything is in [`bess_consensus::cli`].
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    bess_consensus::cli::main()
}

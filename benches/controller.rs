//! The controller's hot loop as a program, so that `cargo xtask bench` can set it against the floor of the
//! machine and count its instructions: `cargo bench --bench controller -- step --agents 1000000`. Prints one
//! line of JSON.
#![allow(non_snake_case, reason = "the paper's letters")]

mod controller_support;
#[path = "support/options.rs"]
mod options;

use std::process::ExitCode;

const USAGE: &str = "Usage: controller TASK [--option value ...]
  step [--agents 1000000] [--eta 0.5] [--order local|random] [--delay-s 0] [--steps 9] [--floor yes|no]
      n agents of degree 4 (a ring, each with the two on either side), `random` with their numbers
      shuffled; prints the time of each step, the bytes it must move, and in turn with each step what the
      machine needs for them: square roots, the vector power, a triad over large arrays
  export [--agents 10000] --folder DIR --to FILE
      writes the FMU of such a controller with the shared library in DIR; prints the time that it took";

fn main() -> ExitCode {
    // Cargo passes --bench on.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words.as_slice() {
        ["step", rest @ ..] => options::options(rest).and_then(|o| controller_support::step(&o)),
        ["export", rest @ ..] => options::options(rest).and_then(|o| controller_support::export(&o)),
        _ => Err(USAGE.to_owned()),
    };
    match done {
        Ok(line) => {
            println!("{line}");
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

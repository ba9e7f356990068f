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
      writes the FMU of such a controller with the shared library in DIR; prints the time that it took
  load FILE
      opens an FMU as `bess run` does and makes an instance; prints the time that it took";

fn main() -> ExitCode {
    options::program(|words| match words {
        ["step", rest @ ..] => controller_support::step(&options::options(rest)?),
        ["export", rest @ ..] => controller_support::export(&options::options(rest)?),
        ["load", file] => controller_support::load(file),
        _ => Err(USAGE.to_owned()),
    })
}

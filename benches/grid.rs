//! The grid's hot loops as a program, so that `cargo xtask bench` can time them against peers and count
//! their instructions: `cargo bench --bench grid -- power-flow CASE.m --bus 5`. Prints one line of JSON.
#![allow(non_snake_case, reason = "the paper's letters")]

mod support;

use std::process::ExitCode;

const USAGE: &str = "Usage: grid TASK CASE [--option value ...]
CASE: case57, or a MATPOWER case file
  power-flow CASE [--bus ID] [--factor 1.1] [--solves 101] [--tolerance 1e-8] [--voltages FILE]
      solves once from the stored voltages, then again and again with the load of one bus times the
      factor and back, each from the solution before; writes the voltages of the first solution
  dynamics CASE [--seconds 2] [--step-ms 10] [--network auto|kron|sparse] [--bess N]
        [--load-model impedance|constant-power]
      a BESS at every bus with a generator in service (or the first N of them); frequency setpoints spread, a
      load step; all buses are read in every communication step
  parts CASE [--repeats 1000] [--network ...] [--bess N] [--load-model ...]
      the same grid; median times of a step of 10 ms at rest and with a setpoint moved, of reading all buses,
      and of a network made anew for a changed load";

fn main() -> ExitCode {
    support::program(|words| match words {
        ["power-flow", case, options @ ..] => support::power_flow(case, &support::options(options)?),
        ["dynamics", case, options @ ..] => support::dynamics(case, &support::options(options)?),
        ["parts", case, options @ ..] => support::parts(case, &support::options(options)?),
        _ => Err(USAGE.to_owned()),
    })
}

//! `cargo xtask`: builds and packs the FMUs, runs a scenario, runs every test, measures. It only starts
//! other programs and judges them by their exit code; it never links the library it builds.

mod bench;
mod bindings;
mod debian;
mod error;
mod fmu;
mod fuzz;
mod generate;
mod licenses;
mod platforms;
mod process;
mod python;
mod scenario;
mod stages;
mod supply;
mod table;
mod workspace;

use clap::{Parser, Subcommand};
use error::Failure;
use std::{path::PathBuf, process::ExitCode};
use workspace::Workspace;

/// Builds, runs, tests and measures bess-consensus.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

const EXAMPLES: &str = "Examples:
  cargo xtask run case1                     build both FMUs, couple them, write results/case1/
  cargo xtask run my.json -- --help         what else `bess run` takes
  cargo xtask fmu                           only build both and pack them into fmu/
  cargo xtask fmu --all-platforms           for linux64, win64 and aarch64-linux
  cargo xtask wheel                         `bess` as a Python wheel, target/wheels/
  cargo xtask test                          everything
  cargo xtask test --only fmt,clippy        two stages of it
  cargo xtask test --only fmpy -- -k reset  one stage, with arguments for pytest
  cargo xtask bench                         speed against the bars, target/bench/summary.json
  cargo xtask bench --only power-flow       one family of its rows
  cargo xtask generate schema               write schema/scenario.schema.json anew
  cargo xtask fuzz                          ten million random calls under AddressSanitizer
  cargo xtask fuzz --guided 600             ten minutes of cargo-fuzz, from fuzz/corpus on
  cargo xtask soak                          ten million steps and ten thousand lives of both FMUs
  cargo xtask miri                          the C interface under miri, where a nightly has it
  cargo xtask reproduce                     the libraries once more, in other folders: the same bytes?";

#[derive(Subcommand)]
enum Task {
    /// Build both shared libraries and `bess`, pack fmu/BessConsensus.fmu and fmu/BessGrid.fmu.
    ///
    /// `bess` (target/release/bess) then carries the libraries inside itself.
    Fmu {
        /// For linux64 (any glibc from 2.17 on), win64 and aarch64-linux; what cannot be built here is left out,
        /// and what to install is said.
        #[arg(long)]
        all_platforms: bool,
    },
    /// Build `bess` as a Python wheel that carries the libraries for all platforms, target/wheels/*.whl.
    Wheel,
    /// Build, pack, and couple controller and grid in a scenario; the results go to results/SCENARIO/.
    Run {
        /// Built-in name (case1 to case4, plug_and_play, voltage, energy) or path of a scenario file.
        #[arg(default_value = "case1")]
        scenario: PathBuf,
        /// Passed on to `bess run`.
        #[arg(last = true)]
        extra: Vec<String>,
    },
    /// Run every check; ends with a table and non-zero if any failed.
    ///
    /// A stage whose tool is missing is skipped and says so; with CI=true it fails. As root, missing
    /// Debian packages are installed.
    Test {
        /// Only these stages, and those they need.
        #[arg(long, value_enum, value_delimiter = ',', value_name = "STAGE")]
        only: Vec<stages::Stage>,
        /// Passed on to pytest.
        #[arg(last = true)]
        pytest: Vec<String>,
    },
    /// Measure speed against the bars; a missed bar is shown and is no error.
    ///
    /// Peers are installed as pinned in benches/peers (Python, and as root Octave and valgrind from
    /// Debian); a row whose peer is missing says so and is not met.
    Bench {
        /// Only these families of rows.
        #[arg(long, value_enum, value_delimiter = ',', value_name = "FAMILY")]
        only: Vec<bench::Family>,
        /// How many times each figure is measured; the median counts.
        #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=1000))]
        runs: u32,
    },
    /// Random calls on the C interface of both FMUs under AddressSanitizer; the first finding ends it.
    ///
    /// A finding names the sequence and the line to type to see it call by call.
    Fuzz {
        /// How many calls.
        #[arg(long, default_value_t = 10_000_000)]
        calls: u64,
        /// Chooses the sequences; the same seed gives the same calls.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Instead, look for new paths with cargo-fuzz for so many seconds; what is found goes to target/fuzz-corpus.
        #[arg(long, value_name = "SECONDS")]
        guided: Option<u64>,
    },
    /// The C interface with a mock model under miri; needs a nightly toolchain with miri and rust-src.
    Miri,
    /// Long runs of both FMUs: memory must not grow, and the last run must give the bits of the first.
    Soak {
        /// fmi2DoStep calls for each FMU.
        #[arg(long, default_value_t = 10_000_000)]
        steps: u64,
        /// Lives from fmi2Instantiate to fmi2FreeInstance for each FMU.
        #[arg(long, default_value_t = 10_000)]
        lives: u64,
    },
    /// Build the FMUs' libraries a second time, in other folders, and compare: every byte must be the same.
    Reproduce {
        /// Only this library: BessConsensus or BessGrid.
        #[arg(value_parser = ["BessConsensus", "BessGrid"], value_name = "LIBRARY")]
        library: Option<String>,
    },
    /// Write anew the generated files that are checked in.
    Generate {
        /// Only these.
        #[arg(value_enum, value_name = "WHAT")]
        what: Vec<generate::Generated>,
    },
}

fn main() -> ExitCode {
    match dispatch(Arguments::parse().task) {
        Ok(code) => code,
        Err(failure) => {
            eprintln!("xtask: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn dispatch(task: Task) -> Result<ExitCode, Failure> {
    let workspace = Workspace::find()?;
    match task {
        Task::Fmu { all_platforms: true } => {
            fmu::build_and_pack_all(&workspace)?;
        }
        Task::Fmu { all_platforms: false } => fmu::build_and_pack(&workspace)?,
        Task::Wheel => println!("{}", platforms::wheel(&workspace)?.display()),
        Task::Run { scenario, extra } => {
            fmu::build_and_pack(&workspace)?;
            scenario::run(&workspace, &scenario, &extra)?;
        }
        Task::Test { only, pytest } => return stages::run(&workspace, &only, pytest),
        Task::Bench { only, runs } => bench::run(&workspace, runs, &only)?,
        Task::Fuzz { guided: Some(seconds), .. } => fuzz::guided(&workspace, seconds)?,
        Task::Fuzz { calls, seed, guided: None } => fuzz::seeded(&workspace, calls, seed)?,
        Task::Miri => fuzz::miri(&workspace)?,
        Task::Soak { steps, lives } => fuzz::soak(&workspace, (steps, lives))?,
        Task::Reproduce { library } => supply::reproduce(&workspace, library.as_deref())?,
        Task::Generate { what } => generate::run(&workspace, &what)?,
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn run_defaults_to_case1_and_passes_the_rest_on() {
        let parsed = Arguments::try_parse_from(["xtask", "run", "--", "--step", "0.1"]).expect("parses");
        let Task::Run { scenario, extra } = parsed.task else { panic!("not run") };
        assert_eq!(scenario, PathBuf::from("case1"));
        assert_eq!(extra, ["--step", "0.1"]);
    }

    #[test]
    fn stages_are_listed_with_commas() {
        let parsed = Arguments::try_parse_from(["xtask", "test", "--only", "fmt,fmpy"]).expect("parses");
        let Task::Test { only, .. } = parsed.task else { panic!("not test") };
        assert_eq!(only, [stages::Stage::Fmt, stages::Stage::Fmpy]);
        assert!(Arguments::try_parse_from(["xtask", "test", "--only", "nonsense"]).is_err());
    }
}

//! `bess-fuzz`: the seeded run, a single sequence of it with every call told, and the long runs.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a finding is a panic")]

use bess_fuzz::fmus;
use bess_fuzz::seeded::{self, Run};
use bess_fuzz::soak::{Load, soak};
use bess_fuzz::stranger::Stranger;
use bess_fuzz::subject::Subject;
use bess_fuzz::world::World;
use clap::{Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;

/// Random calls on the C interface of both FMUs.
#[derive(Parser)]
#[command(after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

const EXAMPLES: &str = "Examples:
  bess-fuzz run --calls 1000000                    both FMUs, half of the calls each
  bess-fuzz run --only grid --seed 7               another million for one of them
  bess-fuzz play --only grid --seed 7 --sequence 42   one sequence, every call told
  bess-fuzz soak --libraries target/release        the long runs, through the shared libraries";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Fmu {
    Controller,
    Grid,
}

#[derive(Subcommand)]
enum Task {
    /// Play sequences until so many calls are made; ends with a table by function and outcome.
    Run {
        /// In all.
        #[arg(long, default_value_t = 1_000_000)]
        calls: u64,
        /// Chooses the sequences.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Threads, each with instances of its own.
        #[arg(long, default_value_t = 2)]
        threads: usize,
        /// Number of the first sequence.
        #[arg(long, default_value_t = 0)]
        first: u64,
        /// One FMU only.
        #[arg(long)]
        only: Option<Fmu>,
    },
    /// Play one sequence and tell every call.
    Play {
        /// The FMU.
        #[arg(long)]
        only: Fmu,
        /// Of the run.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// The sequence.
        #[arg(long)]
        sequence: u64,
    },
    /// Steps, lives and many instances at once; memory flat, bits equal.
    Soak {
        /// fmi2DoStep calls for each FMU.
        #[arg(long, default_value_t = 10_000_000)]
        steps: u64,
        /// Lives from fmi2Instantiate to fmi2FreeInstance for each FMU.
        #[arg(long, default_value_t = 10_000)]
        lives: u64,
        /// Folder with both shared libraries; without it the same functions, linked into this program.
        #[arg(long, value_name = "DIR")]
        libraries: Option<PathBuf>,
    },
}

fn main() -> ExitCode {
    match dispatch(Arguments::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(text) => {
            eprintln!("bess-fuzz: {text}");
            ExitCode::FAILURE
        }
    }
}

fn dispatch(task: Task) -> Result<(), String> {
    let [controller, grid] = [fmus::controller()?, fmus::grid()?];
    match task {
        Task::Run { calls, seed, threads, first, only } => {
            let wanted = |fmu| only.is_none_or(|one| one == fmu);
            let calls = if only.is_some() { calls } else { calls.div_ceil(2) };
            for (fmu, subject, other) in
                [(Fmu::Controller, &controller, &grid), (Fmu::Grid, &grid, &controller)]
            {
                if wanted(fmu) {
                    fuzz(subject, other, Run { seed, calls, first, threads }, fmu)?;
                }
            }
            Ok(())
        }
        Task::Play { only, seed, sequence } => {
            let (subject, other) =
                if only == Fmu::Grid { (&grid, &controller) } else { (&controller, &grid) };
            let (stranger, bytes) = (Stranger::of(other), seeded::bytes(seed, sequence));
            println!("{}", World::play(subject, stranger.state(), &bytes, true));
            Ok(())
        }
        Task::Soak { steps, lives, libraries } => {
            let load = Load { steps, lives, crowd: (64, 8) };
            for subject in [controller, grid] {
                println!("{}", soak(&through(subject, libraries.as_ref())?, load)?);
            }
            Ok(())
        }
    }
}

fn fuzz(subject: &Subject, other: &Subject, run: Run, fmu: Fmu) -> Result<(), String> {
    match seeded::run(subject, Some(other), run) {
        Ok(tally) => {
            println!("{}, seed {}\n{tally}\n", subject.name, run.seed);
            Ok(())
        }
        Err(finding) => {
            let name = fmu.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default();
            let (seed, sequence) = (run.seed, finding.sequence);
            Err(format!(
                "{}\nto see it: bess-fuzz play --only {name} --seed {seed} --sequence {sequence}",
                finding.text
            ))
        }
    }
}

fn through(subject: Subject, folder: Option<&PathBuf>) -> Result<Subject, String> {
    let Some(folder) = folder else { return Ok(subject) };
    let file = format!("{}{}{}", std::env::consts::DLL_PREFIX, subject.name, std::env::consts::DLL_SUFFIX);
    subject.through(&folder.join(file))
}

//! `cargo xtask test`: the stages, in order, each with what it needs. A stage that cannot run is never
//! counted as passed.

use crate::{
    bindings,
    debian::{Need, provide},
    error::Failure,
    fmu, fuzz, platforms,
    process::{cargo, command, run as start},
    python, scenario, supply,
    table::{Outcome, Row, render},
    workspace::Workspace,
};
use clap::ValueEnum;
use std::{io::IsTerminal, path::Path, process::ExitCode, time::Instant};

/// The cases of the paper, each run and its report looked at.
const CASES: [&str; 4] = ["case1", "case2", "case3", "case4"];

/// One stage of the test run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Stage {
    /// The source is formatted
    Fmt,
    /// No warning in any target
    Clippy,
    /// The tests in Rust
    Rust,
    /// Pins, lock files, licences, duplicate versions; the FMUs' bills of materials
    Supply,
    /// No version with a known vulnerability, none that was taken back
    Advisories,
    /// The documentation builds without a warning
    Doc,
    /// src/fmi/bindings.rs is what the FMI headers give
    Bindings,
    /// Both FMUs build and pack
    Fmu,
    /// The controller's library built a second time, elsewhere: the same bytes
    Reproduce,
    /// The FMUs in FMPy, against the reference data
    Fmpy,
    /// Case 1 in the masters of others, and the .ssp
    Masters,
    /// Grids of other people: pandapower as an FMU, ANDES in Python
    Grids,
    /// Grid and controllers as federates of HELICS, also in networks that lose and delay
    Federation,
    /// The cases of the paper through the harness
    Run,
    /// Their reports in a browser without network
    Browser,
    /// The libraries for linux64, win64 and aarch64-linux: what they ask for, and that they give equal numbers
    Platforms,
    /// `bess` as a wheel in an empty environment, its FMU in FMPy
    Wheel,
    /// 300 000 random calls on the C interface under AddressSanitizer
    Fuzz,
    /// Half a million steps and a thousand lives of each FMU: memory flat, bits equal
    Soak,
}

impl Stage {
    /// As typed after `--only`.
    fn name(self) -> &'static str {
        match self {
            Stage::Fmt => "fmt",
            Stage::Clippy => "clippy",
            Stage::Rust => "rust",
            Stage::Supply => "supply",
            Stage::Advisories => "advisories",
            Stage::Doc => "doc",
            Stage::Bindings => "bindings",
            Stage::Fmu => "fmu",
            Stage::Reproduce => "reproduce",
            Stage::Fmpy => "fmpy",
            Stage::Masters => "masters",
            Stage::Grids => "grids",
            Stage::Federation => "federation",
            Stage::Run => "run",
            Stage::Browser => "browser",
            Stage::Platforms => "platforms",
            Stage::Wheel => "wheel",
            Stage::Fuzz => "fuzz",
            Stage::Soak => "soak",
        }
    }

    /// Tools beyond cargo and gcc.
    fn needs(self) -> &'static [Need] {
        match self {
            Stage::Fmt => &[Need::Rustfmt],
            Stage::Clippy => &[Need::Clippy],
            Stage::Bindings => &[Need::Libclang],
            Stage::Fmpy | Stage::Grids | Stage::Supply | Stage::Advisories => &[Need::Python],
            Stage::Masters => &[Need::Python, Need::Tbb],
            Stage::Federation => &[Need::Python, Need::Iproute],
            Stage::Browser => &[Need::Python, Need::Chromium],
            Stage::Platforms => &[Need::Python, Need::CrossRust, Need::Mingw, Need::Wine, Need::QemuAarch64],
            Stage::Wheel => &[Need::Python, Need::CrossRust, Need::Mingw],
            Stage::Fuzz => &[Need::Asan],
            Stage::Rust | Stage::Doc | Stage::Fmu | Stage::Reproduce | Stage::Run | Stage::Soak => &[],
        }
    }

    /// The stages whose work this one uses.
    fn after(self) -> &'static [Stage] {
        match self {
            Stage::Fmpy
            | Stage::Masters
            | Stage::Grids
            | Stage::Federation
            | Stage::Run
            | Stage::Reproduce => &[Stage::Fmu],
            Stage::Browser => &[Stage::Fmu, Stage::Run],
            _ => &[],
        }
    }

    fn execute(self, workspace: &Workspace, pytest: &[String]) -> Result<(), Failure> {
        let cargo = |arguments: &str| {
            let mut cargo = cargo(workspace);
            cargo.args(arguments.split(' '));
            cargo
        };
        match self {
            Stage::Fmt => start(&mut cargo("fmt --all --check")),
            // All in release, so that macros, build scripts and dependencies are built once for lints, tests and
            // FMUs, and the tests see the numbers that users get.
            Stage::Clippy => {
                start(&mut cargo("clippy --locked --release --workspace --all-targets -- -D warnings"))
            }
            Stage::Rust => start(&mut cargo("test --locked --release --workspace")),
            Stage::Supply => supply::check(workspace),
            Stage::Advisories => supply::advisories(workspace),
            Stage::Doc => start(
                cargo("doc --locked --release --workspace --no-deps").env("RUSTDOCFLAGS", "-D warnings"),
            ),
            Stage::Bindings => bindings::check(workspace),
            Stage::Fmu => fmu::build_and_pack(workspace),
            // The grid's takes three times as long.
            Stage::Reproduce => supply::reproduce(workspace, Some("BessConsensus")),
            Stage::Fmpy => start(python::tests(workspace, "fmpy", "fmpy")?.args(pytest)),
            Stage::Masters => {
                // CoFmuPy wants another FMPy than the rest.
                let cofmupy = python::environment(workspace, "masters/cofmupy")?;
                let mut test = python::tests(workspace, "masters", "masters")?;
                start(test.env("BESS_COFMUPY_PYTHON", cofmupy).args(pytest))
            }
            Stage::Grids => start(python::tests(workspace, "grids", "grids")?.args(pytest)),
            Stage::Federation => start(python::tests(workspace, "federation", "federation")?.args(pytest)),
            Stage::Run => CASES
                .iter()
                .try_for_each(|case| scenario::run(workspace, Path::new(case), &[]))
                .and_then(|()| scenario::isolated(workspace)),
            Stage::Browser => CASES.iter().try_for_each(|case| {
                let report = Path::new(&scenario::results(Path::new(case))?).join("report.html");
                start(command(workspace, "python3").arg("tests/browser/check_report.py").arg(report))
            }),
            Stage::Platforms => platforms::test(workspace, pytest),
            Stage::Wheel => platforms::test_wheel(workspace, pytest),
            Stage::Fuzz => fuzz::seeded(workspace, fuzz::STAGE_CALLS, 1),
            Stage::Soak => fuzz::soak(workspace, fuzz::STAGE_SOAK),
        }
    }
}

/// Runs the stages named (all, if none is) and those they need; prints the table.
pub fn run(workspace: &Workspace, only: &[Stage], pytest: Vec<String>) -> Result<ExitCode, Failure> {
    let stages = selected(only);
    let needs: Vec<Need> = stages.iter().flat_map(|stage| stage.needs()).copied().collect();
    provide(workspace, &needs);

    let strict = std::env::var("CI").is_ok_and(|value| value == "true");
    let mut rows: Vec<Row> = Vec::new();
    for stage in stages {
        eprintln!("\n== {}", stage.name());
        let begin = Instant::now();
        let outcome = match obstacle(stage, &rows) {
            Some(why) if strict => Outcome::Failed(why),
            Some(why) => Outcome::Skipped(why),
            None => match stage.execute(workspace, &pytest) {
                Ok(()) => Outcome::Passed,
                // Nothing here could be installed to have it: shown, and no reason to turn a change away.
                Err(Failure::Absent(what)) => Outcome::Skipped(what),
                Err(failure) => Outcome::Failed(failure.to_string()),
            },
        };
        rows.push(Row { stage: stage.name(), outcome, time: begin.elapsed() });
    }

    let colour = std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    print!("\n{}", render(&rows, colour));
    let failed = rows.iter().any(|row| matches!(row.outcome, Outcome::Failed(_)));
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The stages named and those they need, in order.
fn selected(only: &[Stage]) -> Vec<Stage> {
    let wanted = |stage: &Stage| only.contains(stage) || only.iter().any(|one| one.after().contains(stage));
    Stage::value_variants().iter().filter(|stage| only.is_empty() || wanted(stage)).copied().collect()
}

/// Why a stage cannot run, if it cannot.
fn obstacle(stage: Stage, so_far: &[Row]) -> Option<String> {
    let missing = stage.needs().iter().find(|need| !need.met()).map(|need| need.advice());
    missing.or_else(|| {
        let lost = |name: &str| so_far.iter().any(|row| row.stage == name && row.outcome != Outcome::Passed);
        let before = stage.after().iter().find(|before| lost(before.name()))?;
        Some(format!("needs `{}`, which did not pass", before.name()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn names_are_those_of_the_command_line() {
        for stage in Stage::value_variants() {
            let value = stage.to_possible_value().expect("no stage is hidden");
            assert_eq!(value.get_name(), stage.name());
        }
    }

    #[test]
    fn a_stage_brings_those_it_needs_in_order() {
        assert_eq!(selected(&[Stage::Browser]), [Stage::Fmu, Stage::Run, Stage::Browser]);
        assert_eq!(selected(&[Stage::Fmpy, Stage::Fmt]), [Stage::Fmt, Stage::Fmu, Stage::Fmpy]);
        assert_eq!(selected(&[]), Stage::value_variants());
    }

    #[test]
    fn what_a_stage_needs_comes_before_it_and_is_complete() {
        let order = Stage::value_variants();
        let position = |stage| order.iter().position(|&one| one == stage);
        for &stage in order {
            for &before in stage.after() {
                assert!(position(before) < position(stage));
                assert!(before.after().iter().all(|one| stage.after().contains(one)));
            }
        }
    }

    #[test]
    fn a_stage_does_not_run_after_a_failure_it_depends_on() {
        let row = |outcome| Row { stage: "fmu", outcome, time: Duration::ZERO };
        assert_eq!(obstacle(Stage::Run, &[row(Outcome::Passed)]), None);
        let expected = Some("needs `fmu`, which did not pass".to_string());
        assert_eq!(obstacle(Stage::Run, &[row(Outcome::Failed(String::new()))]), expected);
        assert_eq!(obstacle(Stage::Run, &[row(Outcome::Skipped(String::new()))]), expected);
    }
}

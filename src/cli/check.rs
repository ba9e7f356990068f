//! `bess check`: what is wrong with an FMU, and which tools would refuse it.

use super::{Failure, print};
use crate::check::{self, Finding, Report, Runner, Severity};
use clap::Args;
use miette::IntoDiagnostic;
use serde_json::json;
use std::fmt::Write as _;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Duration;

/// The command line of `bess check`.
#[derive(Args)]
#[command(after_help = "Examples:
  bess check MyGrid.fmu                      everything, with a short run
  bess check --no-run Unknown.fmu            no code of the FMU is executed
  bess check --json My.fmu | jq '.findings[] | select(.severity == \"error\")'

Looks at the archive, the model description (schema, variables, units, model structure), the shared library of every
platform (functions, symbols, needed libraries, glibc) and, for co-simulation, runs it for ten steps in a process of
its own. THE SHORT RUN EXECUTES THE CODE IN THE FMU with your rights: use --no-run for FMUs that you do not trust.

Exit codes: 0 no error found, 1 errors found (with --strict also warnings), 2 the command line is wrong or the file
is not there.")]
pub struct CheckArgs {
    /// The FMU
    file: PathBuf,
    /// Do not run it: no code of the FMU is executed
    #[arg(long)]
    no_run: bool,
    /// Findings as JSON on standard output
    #[arg(long)]
    json: bool,
    /// Warnings too end with exit code 1
    #[arg(long)]
    strict: bool,
    /// How long the short run may take, s
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    patience: u64,
}

/// The hidden command that runs the FMU in a process of its own.
pub const PROBE: &str = "probe-fmu";

/// Checks and prints; whether it passed.
pub fn check(args: &CheckArgs) -> Result<bool, Failure> {
    if !args.file.is_file() {
        let report = miette::miette!(help = "name an .fmu file", "{}: no such file", args.file.display());
        return Err(Failure { report, code: 2 });
    }
    let runner = if args.no_run { None } else { Some(runner(args.patience)?) };
    if runner.is_some() && std::io::stderr().is_terminal() {
        eprintln!("the short run executes the code in {}; --no-run does not", args.file.display());
    }
    let report = check::check(&args.file, runner.as_ref());
    if args.json {
        print(&as_json(args, &report)?)?;
    } else {
        let colour = std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        print(&as_text(args, &report, colour))?;
    }
    let (errors, warnings) = (report.count(Severity::Error), report.count(Severity::Warning));
    Ok(errors == 0 && !(args.strict && warnings > 0))
}

fn runner(patience_s: u64) -> Result<Runner, Failure> {
    let program = std::env::current_exe().into_diagnostic()?;
    Ok(Runner { command: (program, vec![PROBE.to_owned()]), patience: Duration::from_secs(patience_s) })
}

fn as_json(args: &CheckArgs, report: &Report) -> Result<String, Failure> {
    let facts: serde_json::Map<_, _> =
        report.facts.iter().map(|(name, value)| (name.clone(), value.clone().into())).collect();
    let text = serde_json::to_string_pretty(&json!({
        "file": args.file.display().to_string(),
        "ran": !args.no_run,
        "errors": report.count(Severity::Error),
        "warnings": report.count(Severity::Warning),
        "notes": report.count(Severity::Note),
        "facts": facts,
        "findings": report.findings,
    }))
    .into_diagnostic()?;
    Ok(text + "\n")
}

fn as_text(args: &CheckArgs, report: &Report, colour: bool) -> String {
    let mut text = format!("{}\n", args.file.display());
    for (name, value) in &report.facts {
        let _ = writeln!(text, "  {}: {}", printable(name), printable(value));
    }
    for finding in &report.findings {
        write_finding(&mut text, finding, colour);
    }
    let count = |severity, one: &str| {
        let count = report.count(severity);
        format!("{count} {one}{}", if count == 1 { "" } else { "s" })
    };
    let _ = writeln!(
        text,
        "\n{}, {}, {}{}",
        count(Severity::Error, "error"),
        count(Severity::Warning, "warning"),
        count(Severity::Note, "note"),
        if args.no_run { "; not run" } else { "" }
    );
    text
}

fn write_finding(text: &mut String, finding: &Finding, colour: bool) {
    let severity = finding.rule.severity;
    let (on, off) = match (colour, severity) {
        (false, _) => ("", ""),
        (true, Severity::Error) => ("\u{1b}[1;31m", "\u{1b}[0m"),
        (true, Severity::Warning) => ("\u{1b}[1;33m", "\u{1b}[0m"),
        (true, Severity::Note) => ("\u{1b}[1;36m", "\u{1b}[0m"),
    };
    let refused = match finding.rule.refused_by {
        [] => "none known to mind".to_owned(),
        tools => tools.join("; "),
    };
    let _ = write!(
        text,
        "\n{on}{}{off} [{}] {}\n  found     {}\n  expected  {}\n  mend      {}\n  tools     {refused}\n",
        severity.name(),
        finding.rule.id,
        printable(&finding.place.to_string()),
        printable(&finding.found),
        printable(&finding.expected),
        finding.mend,
    );
}

/// Foreign text for a terminal: no control characters.
fn printable(text: &str) -> String {
    let clean = |c: char| if c.is_control() && c != '\n' { '\u{fffd}' } else { c };
    text.trim_end().chars().map(clean).collect::<String>().replace('\n', "\n            ")
}

//! `bess check` on FMUs that misbehave when run: each fault is a finding, and none takes `bess` with it.
#![cfg(all(feature = "host", target_os = "linux"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod harness_support;

use harness_support::{compile, fmu, integrator_xml};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// Exit code and what `--json` says.
fn check(file: &Path, options: &[&str]) -> (i32, Value) {
    let output = Command::new(env!("CARGO_BIN_EXE_bess"))
        .args(["check", "--json"])
        .args(options)
        .arg(file)
        .output()
        .unwrap();
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    (output.status.code().unwrap(), serde_json::from_slice(&output.stdout).unwrap())
}

/// The finding of a rule, as text.
fn finding<'a>(report: &'a Value, rule: &str) -> Option<&'a Value> {
    report["findings"].as_array().unwrap().iter().find(|finding| finding["rule"] == rule)
}

/// The integrator with what its description lacks.
fn whole_xml() -> String {
    integrator_xml()
        .replace(
            "causality=\"output\"><Integer/>",
            "causality=\"output\" variability=\"discrete\"><Integer/>",
        )
        .replace("<Integer start=\"3\"/>", "<Integer start=\"0\"/>")
        .replace("<String start=\"x\"/>", "<String/>")
        .replace(
            "<Unknown index=\"2\" dependencies=\"\"/></Outputs>",
            "<Unknown index=\"2\" dependencies=\"\"/><Unknown index=\"4\" dependencies=\"\"/>\
             <Unknown index=\"7\" dependencies=\"\"/></Outputs><InitialUnknowns><Unknown index=\"2\"/>\
             <Unknown index=\"4\"/><Unknown index=\"7\"/></InitialUnknowns>",
        )
}

#[test]
fn each_fault_is_a_finding_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    // Fault, rule, severity, what the finding must say.
    let faults = [
        ("1", "run-crash", "error", "signal 6, an abort) in fmi2DoStep, step 3"),
        // Ten steps, and one more that a state was taken back to.
        ("3", "run-reset", "warning", "steps is 21.0 instead of 10.0"),
        ("4", "run-state", "error", "y is 1.0 instead of 0.0"),
        ("5", "run-not-finite", "warning", "not finite"),
        ("6", "run-same-name", "error", "fmi2Instantiate: returned NULL"),
    ];
    for (fault, rule, severity, said) in faults {
        let library = compile(&[&format!("-DFAULT={fault}")]);
        let (code, report) = check(&fmu(folder.path(), &whole_xml(), &library), &[]);
        let found = finding(&report, rule).unwrap_or_else(|| panic!("no {rule} in {report:#}"));
        assert_eq!(found["severity"], severity);
        assert!(found["found"].as_str().unwrap().contains(said), "{found:#}");
        assert_eq!(code, i32::from(severity == "error"), "{report:#}");
    }
}

#[test]
fn a_sound_one_runs_to_the_end_and_its_description_is_right() {
    let folder = tempfile::tempdir().unwrap();
    let (code, report) = check(&fmu(folder.path(), &whole_xml(), &compile(&[])), &[]);
    assert_eq!((code, &report["errors"]), (0, &Value::from(0)), "{report:#}");
    assert!(report["facts"]["short run"].as_str().unwrap().contains("nothing went wrong"));
    assert!(finding(&report, "guid-braces").is_some());
}

#[test]
fn one_that_never_returns_is_left_after_the_time_given() {
    let folder = tempfile::tempdir().unwrap();
    // It sleeps, it prints without end, it closes its output and sleeps.
    for fault in [2, 7, 8] {
        let file = fmu(folder.path(), &whole_xml(), &compile(&[&format!("-DFAULT={fault}")]));
        let begin = Instant::now();
        let (code, report) = check(&file, &["--patience", "2"]);
        assert!(begin.elapsed() < Duration::from_secs(60));
        assert_eq!(code, 1);
        let found = finding(&report, "run-hang").unwrap();
        let said = found["found"].as_str().unwrap();
        assert!(said.contains("within 2 s, in fmi2DoStep, step 3"), "fault {fault}: {said}");
        assert!(finding(&report, "run-crash").is_none());
    }
}

#[test]
fn start_values_that_the_library_does_not_keep_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let xml = whole_xml().replace("<Real start=\"0.0\" unit=\"pu\"/>", "<Real start=\"2.5\" unit=\"pu\"/>");
    let (_, report) = check(&fmu(folder.path(), &xml, &compile(&[])), &[]);
    let found = finding(&report, "run-start").unwrap();
    assert_eq!((&found["variable"], &found["found"]), (&"u".into(), &"0.0 after initialisation".into()));
}

#[test]
fn model_exchange_is_looked_at_and_not_run() {
    let folder = tempfile::tempdir().unwrap();
    let xml = whole_xml().replace(
        "<CoSimulation modelIdentifier=\"integrator\" canHandleVariableCommunicationStepSize=\"true\"",
        "<ModelExchange modelIdentifier=\"integrator\"",
    );
    // What the model is called says nothing.
    let xml = xml.replace("Integrator &amp; co", "for co-simulation");
    assert!(xml.contains("for co-simulation"));
    let (code, report) = check(&fmu(folder.path(), &xml, &compile(&[])), &[]);
    assert_eq!(code, 1);
    assert!(finding(&report, "not-run").is_some() && finding(&report, "event-indicators").is_some());
    let missing = finding(&report, "functions").unwrap()["found"].as_str().unwrap();
    assert!(missing.contains("fmi2EnterEventMode") && !missing.contains("fmi2DoStep"), "{missing}");
}

#[test]
fn another_version_of_fmi_is_one_finding() {
    let folder = tempfile::tempdir().unwrap();
    let xml = "<?xml version=\"1.0\"?>\n<fmiModelDescription fmiVersion=\"3.0\" instantiationToken=\"x\"/>";
    let (code, report) = check(&fmu(folder.path(), xml, b""), &[]);
    assert_eq!((code, &report["errors"]), (1, &Value::from(1)), "{report:#}");
    assert!(finding(&report, "fmi-version").is_some() && finding(&report, "not-run").is_some());
}

#[test]
fn a_file_that_is_not_there_and_one_that_is_no_archive() {
    let folder = tempfile::tempdir().unwrap();
    let absent = Command::new(env!("CARGO_BIN_EXE_bess")).args(["check", "absent.fmu"]).output().unwrap();
    assert_eq!(absent.status.code(), Some(2));
    let file = folder.path().join("text.fmu");
    std::fs::write(&file, "no archive").unwrap();
    let (code, report) = check(&file, &[]);
    assert_eq!(code, 1);
    assert!(finding(&report, "archive").is_some());
    let text = Command::new(env!("CARGO_BIN_EXE_bess")).arg("check").arg(&file).output().unwrap();
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(text.contains("error [archive]") && text.contains("every importer") && !text.contains('\u{1b}'));
}

//! `bess run` when it does not go well: an FMU that crashes or hangs, a run that is killed. What is on disk then, and
//! what the exit code says.
#![cfg(all(feature = "host", target_os = "linux"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod harness_support;
mod run_support;

use run_support::{PART, Running, bess, files, output, scenario, summary, times, until};
use serde_json::{Value, json};

#[test]
fn a_crash_and_a_hang_end_the_run_with_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    // Step 150 begins at 3 s.
    for (fault, how, said) in [
        (20, "died", "its process died (signal 11, a memory fault)"),
        (1, "died", "its process died (signal 6, an abort)"),
        (2, "hung", "no answer within 1.5s"),
    ] {
        scenario(folder.path(), fault, 150);
        let results = folder.path().join("out");
        let arguments = ["run", "toy.json", "--isolate", "--call-limit", "1500ms", "-o", "out"];
        let (code, message) = output(folder.path(), &arguments);
        assert_eq!(code, Some(3), "{message}");
        assert!(message.contains(&format!("grid at t = 3.0 s: fmi2DoStep: {said}")), "{message}");
        assert!(message.contains("report.html tells what happened"), "{message}");
        assert_eq!(files(&results), ["report.html", "summary.json", PART]);
        let times = times(&results.join(PART));
        assert_eq!((times.len(), times.last()), (151, Some(&3.0)));
        let summary = summary(&results);
        let ended = &summary["ended"];
        assert_eq!((&ended["participant"], &ended["call"]), (&json!("grid"), &json!("fmi2DoStep")));
        assert_eq!((&ended["time_s"], &ended["how"]), (&json!(3.0), &json!(how)));
        assert_eq!(summary["simulated_s"], json!(3.0));
        let report = std::fs::read_to_string(results.join("report.html")).unwrap();
        assert!(report.contains("Ended early: grid") && report.contains("What ended the run"));
        if fault == 1 {
            assert!(message.contains("grid: last words"), "{message}");
            assert_eq!(ended["log"], json!(["[logEvents] about to abort", "last words"]));
            assert!(report.contains("last words"));
        }
    }
    // The same without the fault: whole, and the remains are gone.
    scenario(folder.path(), 0, 0);
    let (code, message) = output(folder.path(), &["run", "toy.json", "--isolate", "-o", "out"]);
    assert_eq!(
        (code, files(&folder.path().join("out"))),
        (Some(0), vec!["report.html".into(), "summary.json".into(), "trajectory.csv".into()]),
        "{message}"
    );
    assert_eq!(summary(&folder.path().join("out"))["ended"], Value::Null);
}

/// The FMU refuses an input of -1: its second battery's setpoint with a sign turned.
#[test]
fn a_refusal_has_a_report_too_and_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 0, 0);
    let path = folder.path().join("toy.json");
    let mut toy: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    toy["connections"][1] = json!({"from": "grid.steps", "to": "grid.mode"});
    toy["connections"][2] = json!({"from": "controller.omega_set[{i}]", "to": "grid.u"});
    std::fs::write(&path, toy.to_string()).unwrap();
    // Two sources of one input are the user's mistake: nothing is written.
    let (code, message) = output(folder.path(), &["run", "toy.json", "-o", "out"]);
    assert_eq!(code, Some(2), "{message}");
    assert!(!folder.path().join("out").exists());
    scenario(folder.path(), 0, 0);
    let mut toy: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    // omega_set is 1: mode becomes 7 from the start on, which the FMU refuses.
    toy["connections"][2]["factor"] = json!(7);
    std::fs::write(&path, toy.to_string()).unwrap();
    let (code, message) = output(folder.path(), &["run", "toy.json", "-o", "out"]);
    assert_eq!(code, Some(1), "{message}");
    assert!(
        message.contains("fmi2SetInteger: returned fmi2Error [logStatusError] mode = 7 is refused"),
        "{message}"
    );
    let report = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(report.contains("Ended early: grid failed in fmi2SetInteger at t = 0.0 s"));
}

/// Isolated or not, the same bytes.
#[test]
fn isolation_changes_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 0, 0);
    let run = |name: &str, more: &[&str]| {
        let mut arguments = vec!["run", "toy.json", "--no-report", "-o", name];
        arguments.extend(more);
        let (code, message) = output(folder.path(), &arguments);
        assert_eq!(code, Some(0), "{message}");
        std::fs::read(folder.path().join(name).join("trajectory.csv")).unwrap()
    };
    assert!(run("plain", &[]) == run("isolated", &["--isolate"]), "the trajectories differ");
}

/// The processes that this one has started and that still live.
fn children(process: u32) -> Vec<u32> {
    let text =
        std::fs::read_to_string(format!("/proc/{process}/task/{process}/children")).unwrap_or_default();
    text.split_whitespace().map(|number| number.parse().unwrap()).collect()
}

#[test]
fn an_fmu_that_hangs_does_not_outlive_the_run() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 2, 150);
    let mut run = Running::start(bess(
        folder.path(),
        &["run", "toy.json", "--isolate", "--call-limit", "1h", "-o", "out"],
    ));
    // It hangs in the step from 3 s on; the row of 3 s is there then.
    let part = folder.path().join("out").join(PART);
    until("the row of 3 s", || std::fs::read_to_string(&part).is_ok_and(|text| text.contains("\n3.0,")));
    let workers = children(run.0.id());
    assert_eq!(workers.len(), 1);
    run.kill();
    let gone = |process: &u32| {
        let status = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        status.is_empty() || status.contains(") Z ")
    };
    until("the end of its process", || workers.iter().all(gone));
    // Killed outright, it left all rows up to the last whole second.
    assert_eq!(times(&part).last(), Some(&3.0));
}

#[test]
fn two_runs_do_not_write_into_one_folder() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 2, 150);
    let arguments = ["run", "toy.json", "--isolate", "--call-limit", "1h", "-o", "out"];
    let mut first = Running::start(bess(folder.path(), &arguments));
    let part = folder.path().join("out").join(PART);
    until("the first one's file", || std::fs::metadata(&part).is_ok_and(|data| data.len() > 0));
    let (code, message) = output(folder.path(), &arguments);
    assert_eq!(files(&folder.path().join("out")), [PART], "the second one left something");
    first.kill();
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("is being written by another run"), "{message}");
}

/// Without isolation the program dies with it; what the last whole second left is there.
#[test]
fn a_crash_of_the_whole_program_leaves_the_trajectory() {
    let folder = tempfile::tempdir().unwrap();
    // It waits two seconds before it crashes, so that a whole second of the clock has passed too.
    scenario(folder.path(), 22, 150);
    let (code, message) = output(folder.path(), &["run", "toy.json", "-o", "out"]);
    assert_eq!(code, None, "{message}");
    assert_eq!(files(&folder.path().join("out")), [PART]);
    let times = times(&folder.path().join("out").join(PART));
    assert_eq!((times.len(), times.last()), (151, Some(&3.0)));
}

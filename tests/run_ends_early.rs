//! `bess run` when it does not go well: an FMU that crashes or hangs, a run that is killed and resumed, a checkpoint of
//! another run. What is on disk then, and what the exit code says.
#![cfg(all(feature = "host", target_os = "linux"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod harness_support;

use harness_support::{compile, fmu, integrator_xml};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PART: &str = "trajectory.csv.part";

fn bess(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bess"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    command
}

fn output(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let Output { status, stderr, .. } = bess(folder, arguments).output().unwrap();
    let said = String::from_utf8_lossy(&stderr).replace('\u{2502}', " ");
    (status.code(), said.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Two batteries beside an FMU that holds its frequency and misbehaves in step `at`: 50 of them make a second.
fn scenario(folder: &Path, fault: u32, at: u32) {
    let xml = integrator_xml();
    let library = compile(&[&format!("-DFAULT={fault}"), &format!("-DAT={at}")]);
    std::fs::rename(fmu(folder, &xml, &library), folder.join("Toy.fmu")).unwrap();
    let battery = |bus: u32| json!({"bus": bus, "K_P": 0.01, "K_Q": 0.05, "capacity": 1.0});
    let line = |from: &str, to: &str| json!({"from": from, "to": to});
    let document = json!({
        "extends": "case1",
        "name": "toy",
        "stop_s": 10,
        "step_s": 0.02,
        "bess": [battery(1), battery(2)],
        "grid": {"case": "none", "fmu": "Toy.fmu"},
        "bases": {"MVA": 100, "kV": 20, "Hz": 50},
        "communication": {"distance": {"given": [[0, 1], [1, 0]]}},
        "control": {"gains": {"E": 0, "V": 0, "Q": 0}},
        "connections": [
            line("grid.y", "controller.omega[{i}]"),
            line("controller.omega_set[1]", "grid.u"),
            line("controller.omega_set[2]", "grid.mode"),
        ],
        "initial": {
            "grid.x_start": 1, "controller.P[{i}]": 0.1, "controller.Q[{i}]": 0, "controller.V[{i}]": 1,
            "controller.E[{i}]": 0.5,
        },
        "events": [
            {"at_s": 0, "label": "held", "set": {"grid.enable": false}},
            {"at_s": 1, "label": "on", "set": {"controller.enable": true}},
        ],
        "compare": [],
    });
    std::fs::write(folder.join("toy.json"), document.to_string()).unwrap();
}

/// The times of a trajectory; every line whole.
fn times(path: &Path) -> Vec<f64> {
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.ends_with('\n'), "the last line is cut");
    let width = text.lines().next().unwrap().split(',').count();
    let rows = text.lines().skip(1);
    rows.map(|row| {
        assert_eq!(row.split(',').count(), width);
        row.split(',').next().unwrap().parse().unwrap()
    })
    .collect()
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn summary(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("summary.json")).unwrap()).unwrap()
}

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

fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(120), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn kill(child: &mut Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn an_fmu_that_hangs_does_not_outlive_the_run() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 2, 150);
    let mut run = bess(folder.path(), &["run", "toy.json", "--isolate", "--call-limit", "1h", "-o", "out"])
        .spawn()
        .unwrap();
    // It hangs in the step from 3 s on; the row of 3 s is there then.
    let part = folder.path().join("out").join(PART);
    until("the row of 3 s", || std::fs::read_to_string(&part).is_ok_and(|text| text.contains("\n3.0,")));
    let workers = children(run.id());
    assert_eq!(workers.len(), 1);
    kill(&mut run);
    let gone = |process: &u32| {
        let status = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        status.is_empty() || status.contains(") Z ")
    };
    until("the end of its process", || workers.iter().all(gone));
    // Killed outright, it left all rows up to the last whole second.
    assert_eq!(times(&part).last(), Some(&3.0));
}

/// What a summary says but for the clock.
fn timeless(folder: &Path) -> Value {
    let mut summary = summary(folder);
    for key in ["wall_s", "real_time_factor", "resumed_at_s"] {
        summary.as_object_mut().unwrap().remove(key);
    }
    summary
}

/// Killed at these shares of its trajectory and resumed after each, a run leaves the bytes of one that was let alone.
fn killed_and_resumed(folder: &Path, run: &[&str], shares: &[f64]) {
    let mut plain = run.to_vec();
    plain.extend(["-o", "plain"]);
    let (code, message) = output(folder, &plain);
    assert_eq!(code, Some(0), "{message}");
    let expected = std::fs::read(folder.join("plain/trajectory.csv")).unwrap();
    let mut start = run.to_vec();
    start.extend(["-o", "killed", "--checkpoint", "250ms"]);
    let (results, mut kills) = (folder.join("killed"), 0);
    for (number, share) in shares.iter().enumerate() {
        if number > 0 {
            if !results.join("checkpoint.bin").exists() {
                break;
            }
            start.retain(|word| !["--checkpoint", "250ms", "--resume"].contains(word));
            start.push("--resume");
        }
        let mut child = bess(folder, &start).stdout(Stdio::null()).spawn().unwrap();
        let enough = (share * expected.len() as f64) as u64;
        let size = |name: &str| std::fs::metadata(results.join(name)).map_or(0, |data| data.len());
        let mut is_over = false;
        until("enough of the trajectory, or the end", || {
            is_over = child.try_wait().unwrap().is_some();
            is_over || (size(PART) > enough && size("checkpoint.bin") > 0)
        });
        if is_over {
            break;
        }
        kill(&mut child);
        kills += 1;
        assert!(!results.join("summary.json").exists(), "a result under its final name");
    }
    assert!(kills > 0, "it was always over first");
    let mut last = run.to_vec();
    last.extend(["-o", "killed", "--resume"]);
    if results.join("checkpoint.bin").exists() {
        let (code, message) = output(folder, &last);
        assert_eq!(code, Some(0), "{message}");
    }
    let found = std::fs::read(results.join("trajectory.csv")).unwrap();
    assert!(found == expected, "after {kills} kills the trajectory differs");
    assert_eq!(timeless(&results), timeless(&folder.join("plain")));
    assert!(!files(&results).iter().any(|name| name.contains("checkpoint")), "{:?}", files(&results));
}

#[test]
fn our_own_models_killed_and_resumed_leave_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    // Past the events at 20 s and 50 s; with delay, so that the history in flight is part of the state.
    let run = [
        "run",
        "case4",
        "--set",
        "stop_s=60",
        "--set",
        "record_every=3",
        "--set",
        "step_s=0.005",
        "--no-report",
    ];
    killed_and_resumed(folder.path(), &run, &[0.0, 0.23, 0.41, 0.77, 0.93]);
}

#[test]
fn fmus_killed_and_resumed_leave_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 0, 0);
    let run = ["run", "toy.json", "--isolate", "--set", "step_s=0.001"];
    killed_and_resumed(folder.path(), &run, &[0.11, 0.52, 0.86]);
}

#[test]
fn a_checkpoint_of_another_run_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 1, 150);
    let resume = |more: &[&str]| {
        let mut arguments = vec!["run", "toy.json", "--resume", "--isolate", "-o", "out"];
        arguments.extend(more);
        output(folder.path(), &arguments)
    };
    let (code, message) = resume(&[]);
    assert_eq!(code, Some(2), "{message}");
    assert!(
        message.contains("there is no checkpoint to resume from; start the run with --checkpoint"),
        "{message}"
    );
    assert!(!folder.path().join("out").exists());

    let (code, message) =
        output(folder.path(), &["run", "toy.json", "--isolate", "--checkpoint", "1", "-o", "out"]);
    assert_eq!(code, Some(3), "{message}");
    assert!(message.contains("with --resume goes on from the last checkpoint"), "{message}");
    let out = folder.path().join("out");
    let whole = |name: &str| std::fs::read(out.join(name)).unwrap();
    // Resumed as it is, it crashes again at the same place, and not before.
    let (code, message) = resume(&[]);
    assert_eq!(code, Some(3), "{message}");
    assert_eq!(summary(&out)["ended"]["time_s"], json!(3.0));
    let before: Vec<Vec<u8>> = files(&out).iter().map(|name| whole(name)).collect();

    let (code, message) = resume(&["--set", "control.eta=0.4"]);
    assert_eq!(code, Some(2), "{message}");
    assert!(
        message.contains("belongs to another run: the scenario's control.eta was 0.5; it is now 0.4"),
        "{message}"
    );

    std::fs::copy(folder.path().join("Toy.fmu"), folder.path().join("Crashing.fmu")).unwrap();
    scenario(folder.path(), 0, 0);
    let (code, message) = resume(&[]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("belongs to another run: the model of grid was {integrator-1}"), "{message}");
    std::fs::rename(folder.path().join("Crashing.fmu"), folder.path().join("Toy.fmu")).unwrap();
    assert!(
        files(&out).iter().map(|name| whole(name)).collect::<Vec<_>>() == before,
        "a refusal changed something"
    );

    for (name, said) in [
        (PART, "does not begin with what the checkpoint says"),
        ("checkpoint.samples", "does not begin with what the checkpoint says"),
        ("checkpoint.bin", "its checksum does not fit"),
    ] {
        let good = whole(name);
        let mut bad = good.clone();
        bad[good.len() / 3] ^= 1;
        std::fs::write(out.join(name), &bad).unwrap();
        let (code, message) = resume(&[]);
        assert!(code == Some(1) || code == Some(2), "{message}");
        assert!(message.contains(said), "{name}: {message}");
        std::fs::write(out.join(name), &good).unwrap();
    }
}

#[test]
fn two_runs_do_not_write_into_one_folder() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 2, 150);
    let arguments = ["run", "toy.json", "--isolate", "--call-limit", "1h", "-o", "out"];
    let mut first = bess(folder.path(), &arguments).spawn().unwrap();
    let part = folder.path().join("out").join(PART);
    until("the first one's file", || std::fs::metadata(&part).is_ok_and(|data| data.len() > 0));
    let (code, message) = output(folder.path(), &arguments);
    kill(&mut first);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("is being written by another run"), "{message}");
}

#[test]
fn an_fmu_without_states_is_refused_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path(), 0, 0);
    let xml = integrator_xml().replace("canSerializeFMUstate=\"1\"", "");
    let path: PathBuf = fmu(folder.path(), &xml, &compile(&[]));
    std::fs::rename(path, folder.path().join("Toy.fmu")).unwrap();
    let (code, message) = output(folder.path(), &["run", "toy.json", "--checkpoint", "1s", "-o", "out"]);
    assert_eq!(code, Some(1), "{message}");
    assert!(
        message.contains("grid at t = 0.0 s: fmi2SerializeFMUstate: not called: the FMU does not declare"),
        "{message}"
    );
}

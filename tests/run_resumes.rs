//! `bess run --checkpoint` and `--resume`: killed at any time and resumed, a run leaves the bytes of one that was let
//! alone; what belongs to another run is refused.
#![cfg(all(feature = "host", target_os = "linux"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod harness_support;
mod run_support;

use harness_support::{compile, fmu, integrator_xml};
use run_support::{PART, Running, bess, files, output, scenario, summary, until};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

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
        let mut child = Running::start(bess(folder, &start));
        let enough = (share * expected.len() as f64) as u64;
        let size = |name: &str| std::fs::metadata(results.join(name)).map_or(0, |data| data.len());
        let mut is_over = false;
        until("enough of the trajectory, or the end", || {
            is_over = child.0.try_wait().unwrap().is_some();
            is_over || (size(PART) > enough && size("checkpoint.bin") > 0)
        });
        if is_over {
            break;
        }
        child.kill();
        kills += 1;
        assert!(!results.join("summary.json").exists(), "a result under its final name");
    }
    assert!(kills > 0, "it was always over first");
    let mut last = run.to_vec();
    last.extend(["-o", "killed", "--resume"]);
    if results.join("checkpoint.bin").exists() {
        // As if the last kill had come while a checkpoint was written.
        std::fs::write(results.join("checkpoint.bin.part"), "half of one").unwrap();
        let (code, message) = output(folder, &last);
        assert_eq!(code, Some(0), "{message}");
    }
    let found = std::fs::read(results.join("trajectory.csv")).unwrap();
    assert!(found == expected, "after {kills} kills the trajectory differs");
    assert_eq!(timeless(&results), timeless(&folder.join("plain")));
    // Nothing else, whatever it was killed in the middle of.
    assert_eq!(files(&results), files(&folder.join("plain")));
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

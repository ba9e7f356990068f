//! `bess run` as a process, beside an FMU that misbehaves on request.
#![allow(dead_code)]

use crate::harness_support::{compile, fmu, integrator_xml};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub const PART: &str = "trajectory.csv.part";

pub fn bess(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bess"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    command
}

pub fn output(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let Output { status, stderr, .. } = bess(folder, arguments).output().unwrap();
    let said = String::from_utf8_lossy(&stderr).replace('\u{2502}', " ");
    (status.code(), said.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Two batteries beside an FMU that holds its frequency and misbehaves in step `at`: 50 of them make a second.
pub fn scenario(folder: &Path, fault: u32, at: u32) {
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
pub fn times(path: &Path) -> Vec<f64> {
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

pub fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

pub fn summary(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("summary.json")).unwrap()).unwrap()
}

pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(120), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A process that does not outlive its test, whatever becomes of that.
pub struct Running(pub Child);

impl Running {
    pub fn start(mut command: Command) -> Self {
        Self(command.stdout(Stdio::null()).spawn().unwrap())
    }

    pub fn kill(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

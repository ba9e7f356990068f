//! Case 1: both FMUs in the harness, trajectory recorded, against real time and against ANDES.

use super::peers::Peers;
use super::program::{last_line, median_of, number};
use super::row::{Bar, Row, median};
use crate::{
    error::Failure,
    fmu::{self, CONTROLLER, GRID},
    process::{command, output},
    workspace::Workspace,
};
use serde_json::{Value, json};
use std::time::Instant;

/// Case 1 runs 120 s.
const STOP_S: f64 = 120.0;
/// Case 1 through the harness, trajectory recorded: times real time.
const REAL_TIME: Bar = Bar::AtLeast(500.0);
/// Wall time per simulated second of ANDES over that of Case 1.
const FASTER_THAN_ANDES: Bar = Bar::AtLeast(200.0);

/// The coupled simulation as `bess` times it, the whole command with its reports, and ANDES.
pub fn rows(workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
    fmu::build_and_pack(workspace)?;
    let folder = workspace.target.join("bench/case1");
    std::fs::create_dir_all(&folder).map_err(Failure::file("make", &folder))?;
    let (mut coupling, mut whole) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let mut bess = command(workspace, workspace.bess());
        bess.args(["run", "case1", "--controller", CONTROLLER, "--grid", GRID, "-o"]).arg(&folder);
        let start = Instant::now();
        output(&mut bess)?;
        whole.push(STOP_S / start.elapsed().as_secs_f64());
        coupling.push(real_time_factor(&folder.join("summary.json"))?);
    }
    let real_time = median(coupling);
    let mut rows = vec![
        Row::figure("Case 1, simulation", real_time, "x real time").bar(REAL_TIME),
        Row::figure("Case 1, whole command with report", median(whole), "x real time"),
    ];
    let name = "Case 1 against ANDES, 7 REGF1 on case57";
    rows.push(match andes(workspace, runs) {
        Ok(peer) => {
            let wall = median_of(&peer, "wall_per_second");
            let note = format!(
                "per simulated second {:.3} ms here, {:.1} ms in ANDES {} (default step)",
                1e3 / real_time,
                1e3 * wall,
                peer["version"].as_str().unwrap_or("?")
            );
            Row::figure(name, wall * real_time, "x faster")
                .bar(FASTER_THAN_ANDES)
                .note(note, json!({ "real_time": real_time, "andes": peer }))
        }
        Err(failure) => Row::missing(name, "x faster", FASTER_THAN_ANDES, failure.to_string()),
    });
    Ok(rows)
}

fn andes(workspace: &Workspace, runs: u32) -> Result<Value, Failure> {
    let peers = Peers::new(workspace)?;
    let mut andes = command(workspace, &peers.python);
    andes.args(["benches/peers/andes_case57.py", &peers.case("case57"), "--runs", &runs.to_string()]);
    last_line(&output(&mut andes)?)
}

/// The figure `real_time_factor` of a run's summary.json.
fn real_time_factor(path: &std::path::Path) -> Result<f64, Failure> {
    let text = std::fs::read_to_string(path).map_err(Failure::file("read", path))?;
    let summary = serde_json::from_str::<Value>(&text).unwrap_or_default();
    number(&summary, "real_time_factor").map_err(|failure| match failure {
        Failure::Other(_) => Failure::Other(format!("{} has no number `real_time_factor`", path.display())),
        other => other,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_without_the_figure_is_an_error() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("summary.json");
        std::fs::write(&path, r#"{"real_time_factor": 512.5}"#).expect("writable");
        assert_eq!(real_time_factor(&path).expect("is there"), 512.5);
        std::fs::write(&path, r#"{"speed": 1}"#).expect("writable");
        assert!(real_time_factor(&path).is_err());
    }
}

//! The warm power flow, one load changed: against lightsim2grid up to 9241 buses, against MATPOWER in
//! Octave with 70,000. Here and there in turn, run by run; the voltages are compared.

use super::peers::Peers;
use super::program::{build, last_line, measure, median_of, number};
use super::row::{Bar, Row, median};
use crate::{
    debian::{Need, provide},
    error::Failure,
    process::{command, output},
    workspace::Workspace,
};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Time here over time in lightsim2grid.
const LIGHTSIM: Bar = Bar::AtMost(1.0);
/// Time in MATPOWER over time here.
const MATPOWER: Bar = Bar::AtLeast(2.0);
/// How far voltages may be apart for the two to have solved the same, pu.
const AGREEMENT_PU: f64 = 1e-8;
/// Solves per run.
const SOLVES: &str = "21";

/// All rows.
pub fn rows(workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
    let program = build(workspace, "grid")?;
    let mut rows = Vec::new();
    let by_lightsim = ["case57", "case2869pegase", "case9241pegase"]
        .map(|case| (case, format!("warm power flow, {case}, against lightsim2grid")));
    let by_matpower = "warm power flow, case_ACTIVSg70k, against MATPOWER";
    let peers = match Peers::new(workspace) {
        Ok(peers) => peers,
        Err(failure) => {
            let why = format!("no case files and peers: {failure}");
            let missing =
                by_lightsim.map(|(_, name)| Row::missing(name, "x the time", LIGHTSIM, why.as_str()));
            rows.extend(missing);
            rows.push(Row::missing(by_matpower, "x faster", MATPOWER, why));
            return Ok(rows);
        }
    };
    for (case, name) in by_lightsim {
        rows.push(
            against(workspace, &program, &peers, case, runs, &lightsim)
                .map(|pairs| pairs.row(&name, "lightsim2grid", false))
                .unwrap_or_else(|failure| Row::missing(name, "x the time", LIGHTSIM, failure.to_string())),
        );
    }
    let name = by_matpower;
    provide(workspace, &[Need::Octave]);
    rows.push(if Need::Octave.met() {
        against(workspace, &program, &peers, "case_ACTIVSg70k", runs, &matpower)
            .map(|pairs| pairs.row(name, "MATPOWER", true))
            .unwrap_or_else(|failure| Row::missing(name, "x faster", MATPOWER, failure.to_string()))
    } else {
        Row::missing(name, "x faster", MATPOWER, Need::Octave.advice())
    });
    Ok(rows)
}

/// What a peer is given: case file, id of the bus whose load changes, our voltages.
type Peer = dyn Fn(&Workspace, &Peers, &str, u64, &Path) -> Result<Value, Failure>;

fn lightsim(w: &Workspace, peers: &Peers, case: &str, bus: u64, voltages: &Path) -> Result<Value, Failure> {
    let mut python = command(w, &peers.python);
    python.args(["benches/peers/lightsim.py", case, "--bus", &bus.to_string(), "--solves", SOLVES]);
    last_line(&output(python.arg("--voltages").arg(voltages))?)
}

fn matpower(w: &Workspace, peers: &Peers, case: &str, bus: u64, voltages: &Path) -> Result<Value, Failure> {
    let (folder, voltages) = (peers.matpower.display(), voltages.display());
    let call = format!("matpower_power_flow('{folder}', '{case}', {bus}, 1.1, 3, '{voltages}')");
    let mut octave = command(w, "octave-cli");
    // Absolute, because MATPOWER changes folders.
    octave.args(["--quiet", "--no-init-file", "--path"]).arg(w.root.join("benches/peers"));
    octave.args(["--eval", &call]);
    last_line(&output(&mut octave)?)
}

/// Runs here and there in turn.
struct Pairs {
    ours: Vec<f64>,
    theirs: Vec<f64>,
    our_last: Value,
    their_last: Value,
}

fn against(
    workspace: &Workspace,
    program: &PathBuf,
    peers: &Peers,
    case: &str,
    runs: u32,
    peer: &Peer,
) -> Result<Pairs, Failure> {
    let (file, voltages) = (peers.case(case), workspace.target.join(format!("bench/{case}.voltages")));
    let mut pairs = Pairs { ours: vec![], theirs: vec![], our_last: Value::Null, their_last: Value::Null };
    for _ in 0..runs {
        let wanted = voltages.display().to_string();
        let arguments = ["power-flow", &file, "--solves", SOLVES, "--voltages", &wanted];
        pairs.our_last = measure(workspace, program, &arguments)?;
        let bus = number(&pairs.our_last, "bus")? as u64;
        pairs.their_last = peer(workspace, peers, &file, bus, &voltages)?;
        pairs.ours.push(median_of(&pairs.our_last, "warm_s"));
        pairs.theirs.push(number(&pairs.their_last, "median_s")?);
    }
    Ok(pairs)
}

impl Pairs {
    /// Median of the ratios pair by pair: a machine whose speed drifts is the same for both of a pair.
    fn row(&self, name: &str, peer: &str, is_speed_up: bool) -> Row {
        let (unit, bar) = if is_speed_up { ("x faster", MATPOWER) } else { ("x the time", LIGHTSIM) };
        let difference = self.their_last["difference_pu"].as_f64().unwrap_or(f64::NAN);
        // A NaN difference agrees with nothing.
        if difference.is_nan() || difference > AGREEMENT_PU {
            let why = format!("the solutions differ by {difference:.1e} pu, more than {AGREEMENT_PU:.0e}");
            return Row::missing(name, unit, bar, why);
        }
        let ratios = self.ours.iter().zip(&self.theirs);
        let value = if is_speed_up {
            median(ratios.map(|(ours, theirs)| theirs / ours).collect())
        } else {
            median(ratios.map(|(ours, theirs)| ours / theirs).collect())
        };
        let (ours, theirs) = (median(self.ours.clone()), median(self.theirs.clone()));
        let note = format!(
            "{:.3} ms here, {:.3} ms in {peer} {}; voltages agree within {difference:.0e} pu",
            1e3 * ours,
            1e3 * theirs,
            self.their_last["version"].as_str().unwrap_or("?"),
        );
        let iterations = |value: &Value| value["warm_iterations"].clone();
        let detail = json!({
            "ours_s": self.ours, "theirs_s": self.theirs, "difference_pu": difference,
            "iterations": [iterations(&self.our_last), iterations(&self.their_last)],
            "pivoted": self.our_last["pivoted"],
        });
        Row::figure(name, value, unit).bar(bar).note(note, detail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voltages_that_differ_are_no_measurement() {
        let mut pairs = Pairs {
            ours: vec![1.0, 2.0, 3.0],
            theirs: vec![2.0, 2.0, 2.0],
            our_last: Value::Null,
            their_last: json!({ "difference_pu": 1e-12, "version": "1" }),
        };
        assert_eq!(pairs.row("a", "b", false).value, Ok(1.0));
        assert_eq!(pairs.row("a", "b", true).value, Ok(1.0));
        pairs.their_last = json!({ "difference_pu": 1e-3 });
        assert!(pairs.row("a", "b", false).value.is_err());
        pairs.their_last = json!({});
        assert!(pairs.row("a", "b", false).value.is_err());
    }
}

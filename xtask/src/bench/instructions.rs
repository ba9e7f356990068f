//! Instructions of the hot loops, counted by valgrind: the same on every machine and on a busy one, so
//! that a slow-down in the source shows (of processors, valgrind knows AVX2 and nothing wider). What a loop takes is the difference between a long and a short
//! run over the number of rounds between them.

use super::drive::{Driver, Fmu};
use super::peers::Peers;
use super::program::{build, measure, number};
use super::row::{Bar, Row};
use crate::{
    debian::{Need, provide},
    error::Failure,
    process::command,
    workspace::Workspace,
};
use std::{ffi::OsStr, path::PathBuf};

/// A loop, and the millions of instructions per round that it may take: what it took when it was last
/// made faster, and a tenth.
struct Loop {
    name: &'static str,
    case: &'static str,
    task: &'static str,
    option: &'static str,
    short: &'static str,
    long: &'static str,
    rounds: f64,
    most: f64,
}

const fn warm(case: &'static str, most: f64) -> Loop {
    let name = "warm power flow";
    Loop { name, case, task: "power-flow", option: "--solves", short: "2", long: "12", rounds: 10.0, most }
}

const fn step(case: &'static str, most: f64) -> Loop {
    let name = "communication step";
    Loop { name, case, task: "dynamics", option: "--seconds", short: "0.2", long: "0.4", rounds: 20.0, most }
}

const LOOPS: [Loop; 5] = [
    warm("case57", 0.18),
    warm("case2869pegase", 9.8),
    warm("case9241pegase", 57.0),
    step("case57", 0.045),
    step("case9241pegase", 22.0),
];

/// All rows.
pub fn rows(workspace: &Workspace) -> Result<Vec<Row>, Failure> {
    let program = build(workspace, "grid")?;
    provide(workspace, &[Need::Valgrind]);
    let peers = Peers::new(workspace);
    let mut rows = Vec::new();
    for one in &LOOPS {
        let (name, unit) = (format!("{}, {}", one.name, one.case), "M instr.");
        let counted = match &peers {
            Err(failure) => Err(format!("no case files: {failure}")),
            Ok(peers) => {
                let file = peers.case(one.case);
                let count = |rounds| count(workspace, &program, &[one.task, &file, one.option, rounds]);
                count(one.long)
                    .and_then(|long| Ok((long - count(one.short)?) / one.rounds / 1e6))
                    .map_err(|failure| failure.to_string())
            }
        };
        let bar = Bar::AtMost(one.most);
        rows.push(match counted {
            Ok(millions) => Row::figure(name, millions, unit).bar(bar),
            Err(why) => Row::missing(name, unit, bar, why),
        });
    }
    rows.push(row(format!("controller step per edge, {AGENTS} agents"), per_edge(workspace)));
    let [ours, in_c] = ["7-agent FMU, set + doStep + get", "the same law in C"].map(str::to_owned);
    match Driver::new(workspace) {
        Ok(driver) => {
            rows.push(row(ours, per_step(workspace, &driver, &driver.ours)));
            let peer = driver.peer_c(workspace);
            rows.push(row(in_c, peer.and_then(|peer| per_step(workspace, &driver, &peer))));
        }
        Err(failure) => {
            let why = failure.to_string();
            rows.extend([ours, in_c].map(|name| Row::unknown(name, "instr.", why.as_str())));
        }
    }
    Ok(rows)
}

/// Agents whose step is counted.
const AGENTS: &str = "10000";

/// A row without a bar: the same loops have theirs in time.
fn row(name: String, counted: Result<f64, Failure>) -> Row {
    match counted {
        Ok(count) => Row::figure(name, count, "instr."),
        Err(failure) => Row::unknown(name, "instr.", failure.to_string()),
    }
}

/// Instructions of the controller's step, in process, per undirected edge.
fn per_edge(workspace: &Workspace) -> Result<f64, Failure> {
    let program = build(workspace, "controller")?;
    let arguments = |steps| ["step", "--agents", AGENTS, "--floor", "no", "--steps", steps];
    let edges = number(&measure(workspace, &program, &arguments("1"))?, "edges")?;
    let (short, long) = ("2", "22");
    let more = count(workspace, &program, &arguments(long))? - count(workspace, &program, &arguments(short))?;
    Ok(more / 20.0 / edges)
}

/// Instructions of one communication step of an FMU.
fn per_step(workspace: &Workspace, driver: &Driver, fmu: &Fmu) -> Result<f64, Failure> {
    let run = |steps| {
        let (program, arguments) = driver.count(steps, fmu);
        count(workspace, &program, &arguments)
    };
    Ok((run("4000")? - run("2000")?) / 2000.0)
}

/// Instructions of a whole run.
fn count(workspace: &Workspace, program: &PathBuf, arguments: &[impl AsRef<OsStr>]) -> Result<f64, Failure> {
    if !Need::Valgrind.met() {
        return Err(Failure::Other(Need::Valgrind.advice()));
    }
    let mut valgrind = command(workspace, "valgrind");
    valgrind.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]).arg(program).args(arguments);
    let shown = || "valgrind --tool=callgrind".to_owned();
    let done = valgrind.output().map_err(|source| Failure::Start { command: shown(), source })?;
    if !done.status.success() {
        return Err(Failure::Command { command: shown(), status: done.status });
    }
    collected(&String::from_utf8_lossy(&done.stderr))
        .ok_or_else(|| Failure::Other("callgrind printed no line `Collected : N`".into()))
}

/// `==1== Collected : 687124493`.
fn collected(text: &str) -> Option<f64> {
    text.lines().find_map(|line| line.split_once("Collected :")?.1.trim().parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_is_read_from_callgrinds_last_words() {
        let text = "==7== Events    : Ir\n==7== Collected : 687124493\n==7==\n";
        assert_eq!(collected(text), Some(687124493.0));
        assert_eq!(collected("==7== I refs: 3"), None);
    }
}

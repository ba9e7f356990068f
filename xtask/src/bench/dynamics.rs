//! The grid model with a BESS at every generator, all buses read in every communication step of 10 ms,
//! against real time.

use super::peers::Peers;
use super::program::{build, measure, number};
use super::row::{Bar, Row, median};
use crate::{error::Failure, workspace::Workspace};
use serde_json::Value;

const REAL_TIME: Bar = Bar::AtLeast(1.0);

/// 9241 buses with a bar; 57, 2869 and 70,000 for information.
const CASES: [(&str, Option<Bar>); 4] = [
    ("case57", None),
    ("case2869pegase", None),
    ("case9241pegase", Some(REAL_TIME)),
    ("case_ACTIVSg70k", None),
];

/// One row a case.
pub fn rows(workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
    let program = build(workspace, "grid")?;
    let peers = match Peers::new(workspace) {
        Ok(peers) => peers,
        Err(failure) => {
            let why = format!("no case files: {failure}");
            let missing = |(case, bar): (&str, Option<Bar>)| {
                let row = Row::unknown(format!("dynamics, {case}"), "x real time", why.as_str());
                Row { bar, ..row }
            };
            return Ok(CASES.map(missing).into());
        }
    };
    let mut rows = Vec::new();
    for (case, bar) in CASES {
        let file = peers.case(case);
        let (mut speed, mut last) = (Vec::new(), Value::Null);
        for _ in 0..runs {
            last = measure(workspace, &program, &["dynamics", &file])?;
            speed.push(number(&last, "real_time")?);
        }
        let note = format!(
            "{} BESS, {} internal steps in {} of 10 ms, steady state found in {:.3} s, longest step {:.1} ms",
            last["bess"],
            last["internal_steps"],
            last["communication_steps"],
            number(&last, "initialise_s")?,
            1e3 * number(&last, "longest_step_s")?,
        );
        let row = Row::figure(format!("dynamics, {case}"), median(speed), "x real time").note(note, last);
        rows.push(match bar {
            Some(bar) => row.bar(bar),
            None => row,
        });
    }
    Ok(rows)
}

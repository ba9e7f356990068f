//! The controller's FMU of Case 1 through its C interface: all Real inputs set, a step, the setpoints read; against the
//! same law written by hand in C and against NumPy in an FMU of PythonFMU. Here and there in turn in one process, on
//! the measurements of a run of Case 1; that the setpoints agree is looked at first.

use super::drive::{Driver, Fmu};
use super::peers::Peers;
use super::program::{last_line, median_of, number};
use super::row::{Bar, Row, median};
use crate::{
    error::Failure,
    process::{command, output, run},
    workspace::Workspace,
};
use serde_json::{Value, json};
use std::path::Path;

/// Time here over time in C.
const C: Bar = Bar::AtMost(1.2);
/// Time in NumPy over time here.
const NUMPY: Bar = Bar::AtLeast(100.0);
/// How far setpoints may be apart, pu.
const AGREEMENT_C: f64 = 1e-12;
/// The same with NumPy, whose sums are in another order.
const AGREEMENT_NUMPY: f64 = 1e-9;

/// Both rows.
pub fn rows(workspace: &Workspace, runs: u32) -> Result<Vec<Row>, Failure> {
    let driver = Driver::new(workspace)?;
    // An FMU's step is short: many runs cost nothing.
    let rounds = (5 * runs).to_string();
    let name = "7-agent FMU, set + doStep + get, against C";
    let c = driver.peer_c(workspace).and_then(|peer| {
        let found = driver.compare(workspace, &rounds, &peer)?;
        let ratio = agreed(&found, AGREEMENT_C)?;
        Ok(Row::figure(name, ratio, "x the time").note(note(&found, "in C (-O3)"), found))
    });
    let numpy_name = "7-agent FMU, set + doStep + get, against NumPy in PythonFMU";
    let numpy = numpy(workspace, &driver, runs).and_then(|found| {
        let ratio = agreed(&found, AGREEMENT_NUMPY)?;
        Ok(Row::figure(numpy_name, 1.0 / ratio, "x faster").note(note(&found, "in NumPy"), found))
    });
    let missing =
        |name, unit, bar| move |failure: Failure| Row::missing(name, unit, bar, failure.to_string());
    Ok(vec![
        c.unwrap_or_else(missing(name, "x the time", C)).bar(C),
        numpy.unwrap_or_else(missing(numpy_name, "x faster", NUMPY)).bar(NUMPY),
    ])
}

/// The median ratio of ours to the peer's, if both gave the same setpoints.
fn agreed(found: &Value, tolerance: f64) -> Result<f64, Failure> {
    let apart = number(found, "apart")?;
    if apart.is_nan() || apart > tolerance {
        let text = format!("setpoints are {apart:.1e} pu apart; expected {tolerance:.0e} at most");
        return Err(Failure::Other(text));
    }
    let times = |key: &str| -> Vec<f64> {
        found[key].as_array().map(|all| all.iter().filter_map(Value::as_f64).collect()).unwrap_or_default()
    };
    Ok(median(
        times("first_ns").iter().zip(&times("second_ns")).map(|(ours, theirs)| ours / theirs).collect(),
    ))
}

fn note(found: &Value, there: &str) -> String {
    format!(
        "{:.0} ns here, {:.0} ns {there}, processor time; setpoints within {:.0e} pu in {} steps",
        median_of(found, "first_ns"),
        median_of(found, "second_ns"),
        found["apart"].as_f64().unwrap_or(f64::NAN),
        found["steps"],
    )
}

/// Ours and NumPy's within Python, where an FMU of PythonFMU finds its interpreter.
fn numpy(workspace: &Workspace, driver: &Driver, runs: u32) -> Result<Value, Failure> {
    let python = Peers::new(workspace)?.python;
    let folder = &driver.folder;
    let build = ["-m", "pythonfmu", "build", "-f", "benches/peers/numpy_slave.py", "-d"];
    run(command(workspace, &python).args(build).arg(folder))?;
    let archive = folder.join("NumpyConsensus.fmu");
    let unpacked = Fmu::unpack(workspace, &archive, &folder.join("numpy"), 0)?;
    let library = driver.library(workspace)?;
    let mut inside = command(workspace, &python);
    inside.args(["-c", INSIDE]).arg(library).arg("compare").arg(&driver.inputs).arg(runs.to_string());
    inside.args(&driver.ours.words).args(&unpacked.words);
    let mut found = last_line(&output(&mut inside)?)?;
    found["pythonfmu"] = json!(version(workspace, &python)?);
    Ok(found)
}

/// Calls the driver's library. Leaves without Python's cleaning up: after that an FMU of PythonFMU 0.7.0 aborts.
const INSIDE: &str = "import ctypes, os, sys
words = [word.encode() for word in sys.argv[1:]]
status = ctypes.CDLL(sys.argv[1]).drive(len(words), (ctypes.c_char_p * len(words))(*words))
os._exit(status)";

fn version(workspace: &Workspace, python: &Path) -> Result<String, Failure> {
    let ask = "import importlib.metadata as m; print(m.version('pythonfmu'), m.version('numpy'))";
    Ok(output(command(workspace, python).args(["-c", ask]))?.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_agree_is_not_compared() {
        let mut found =
            json!({ "apart": 1e-13, "first_ns": [30.0, 20.0, 90.0], "second_ns": [10.0, 10.0, 10.0] });
        assert_eq!(agreed(&found, 1e-12).expect("agrees"), 3.0);
        found["apart"] = json!(2e-12);
        assert!(agreed(&found, 1e-12).is_err());
        // What C prints for not-a-number is no JSON number.
        found["apart"] = json!(null);
        assert!(agreed(&found, 1e-12).is_err());
    }
}

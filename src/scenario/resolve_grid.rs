//! The grid's configuration from the scenario, its case file included.

use super::document::Scenario;
use super::error::ScenarioError;
use super::load::Source;
use crate::grid::{self, Bess, Case, CaseSource, Config, GridError, Tie};

/// The checked configuration; none for the case "none".
pub fn grid(scenario: &Scenario, source: &Source) -> Result<Option<Config>, ScenarioError> {
    if scenario.grid.case == "none" {
        return Ok(None);
    }
    let config = Config {
        case: case(scenario, source)?,
        bess: scenario
            .bess
            .iter()
            .map(|b| Bess {
                bus: b.bus,
                K_P: b.k_p,
                K_Q: b.k_q,
                X_c: b.x_c,
                E_start: b.soc_start * b.capacity(),
                omega_set_start: b.omega_set_start,
                V_set_start: b.v_set_start,
            })
            .collect(),
        omega_c: scenario.grid.omega_c,
        f_nominal_hz: scenario.grid.f_nominal_hz,
        tie: scenario.grid.tie.as_ref().map(|t| Tie { bus: t.bus, X: t.x }),
        tie_closed_start: false,
        load_model: scenario.grid.load_model,
        network: scenario.grid.network,
        tolerances: scenario.grid.tolerances,
    };
    config.validate().map_err(|error| moved(&source.origin, &error))?;
    Ok(Some(config))
}

/// abs(Z_ii + Z_jj - 2 Z_ij) between the batteries' buses, n x n, pu.
pub fn electrical_distances(config: Option<&Config>, origin: &str) -> Result<Vec<Vec<f64>>, ScenarioError> {
    let config = config.ok_or_else(|| ScenarioError::Value {
        origin: origin.into(),
        path: "communication.distance".into(),
        found: "\"electrical\" with grid.case \"none\"".into(),
        expected:
            "{\"given\": [[...]]}, \"euclidean\", or `communication.graphs`: there is no network to measure"
                .into(),
    })?;
    let buses: Vec<u64> = config.bess.iter().map(|b| b.bus).collect();
    config
        .case
        .resolve()
        .and_then(|case| grid::electrical_distances(&case, &buses))
        .map_err(|error| moved(origin, &error))
}

fn case(scenario: &Scenario, source: &Source) -> Result<CaseSource, ScenarioError> {
    if !scenario.grid.case_is_file() {
        return Ok(CaseSource::BuiltIn(scenario.grid.case.clone()));
    }
    let file = source.folder.join(&scenario.grid.case);
    let text = std::fs::read_to_string(&file)
        .map_err(|cause| ScenarioError::Unreadable { file: file.clone(), cause })?;
    let read =
        if scenario.grid.case.ends_with(".m") { Case::from_matpower(&text) } else { Case::from_json(&text) };
    let case = read.map_err(|error| moved(&file.display().to_string(), &error))?;
    Ok(CaseSource::Inline(Box::new(case)))
}

fn moved(origin: &str, error: &GridError) -> ScenarioError {
    match error {
        GridError::Invalid { path, found, expected } => ScenarioError::Value {
            origin: origin.into(),
            path: if path.starts_with("bess") || path.starts_with("case.") {
                path.clone()
            } else {
                format!("grid.{path}")
            },
            found: found.clone(),
            expected: expected.clone(),
        },
        other => {
            ScenarioError::Document { origin: origin.into(), path: "grid".into(), problem: other.to_string() }
        }
    }
}

//! The controller's configuration from the scenario; a problem found there comes back with its path here.

use super::document::{Bess, Distance, Scenario};
use super::error::ScenarioError;
use crate::control::communication::{Communication, Explicit, StepByStep};
use crate::control::config::{Config, Limits};
use crate::control::told::MessageFault;
use crate::control::{ConfigError, Problem};

/// Per-agent vectors of `control::Config` that stand as a key of each battery here.
const PER_BESS: [&str; 12] = [
    "K_P",
    "K_Q",
    "capacity",
    "P_exchange_max",
    "omega_set_start",
    "V_set_start",
    "limits.P_max",
    "limits.Q_max",
    "limits.S_max",
    "limits.omega_set_rate",
    "limits.V_set_rate",
    "limits.P_set_rate",
];

/// Paths of `control::Config` and of the scenario, longest first.
const MOVED: [(&str, &str); 7] = [
    ("communication.step_by_step.distances", "communication.distance.given"),
    ("communication.step_by_step", "communication"),
    ("communication.explicit.topologies", "communication.graphs"),
    ("communication", "communication"),
    ("limits.SoC", "control.soc_limits"),
    ("limits.omega_set_range", "control.omega_set_range"),
    ("limits.V_set_range", "control.V_set_range"),
];

/// The checked configuration. `electrical` gives the distances between the batteries over the network, and
/// is asked only when they are needed.
pub fn control(
    scenario: &Scenario,
    message_faults: Vec<MessageFault>,
    origin: &str,
    electrical: impl FnOnce() -> Result<Vec<Vec<f64>>, ScenarioError>,
) -> Result<Config, ScenarioError> {
    let c = &scenario.control;
    let bess = &scenario.bess;
    let at = |path: String, found: String, expected: &str| ScenarioError::Value {
        origin: origin.into(),
        path,
        found,
        expected: expected.into(),
    };
    let all_or_none = |key: &str, value: fn(&Bess) -> Option<f64>| {
        let values: Vec<Option<f64>> = bess.iter().map(value).collect();
        if values.iter().all(Option::is_none) {
            return Ok(None);
        }
        let absent = values.iter().position(Option::is_none);
        absent.map_or(Ok(Some(values.iter().flatten().copied().collect())), |i| {
            Err(at(
                format!("bess[{i}].{key}"),
                "nothing".into(),
                "a number, because other batteries have one",
            ))
        })
    };
    let each = |value: fn(&Bess) -> f64| bess.iter().map(value).collect::<Vec<f64>>();

    let communication = match (&scenario.communication.graphs, &scenario.communication.distance) {
        (Some(graphs), _) => Communication::Explicit(Explicit { topologies: graphs.clone() }),
        (None, distance) => Communication::StepByStep(StepByStep {
            distances: match distance {
                Distance::Given(matrix) => matrix.clone(),
                Distance::Euclidean => euclidean(bess).map_err(|i| {
                    at(format!("bess[{i}].position"), "nothing".into(), "[x, y], for distance \"euclidean\"")
                })?,
                Distance::Electrical => electrical()?,
            },
            weights: scenario.communication.weights,
            topologies: scenario.communication.topologies.clone(),
        }),
    };
    let config = Config {
        K_P: each(|b| b.k_p),
        K_Q: each(|b| b.k_q),
        capacity: each(Bess::capacity),
        P_exchange_max: each(|b| b.p_exchange_max),
        omega_set_start: each(|b| b.omega_set_start),
        V_set_start: each(|b| b.v_set_start),
        eta: c.eta,
        gains: c.gains,
        delay_s: c.delay_s,
        theta_min_s: c.theta_min_s,
        theta_E_s: c.theta_e_s,
        voltage_policy: c.voltage_policy,
        discretisation: c.discretisation,
        law: c.law,
        communication,
        limits: Limits {
            P_max: all_or_none("P_max", |b| b.p_max)?,
            Q_max: all_or_none("Q_max", |b| b.q_max)?,
            S_max: all_or_none("S_max", |b| b.s_max)?,
            omega_set_rate: all_or_none("omega_set_rate", |b| b.omega_set_rate)?,
            V_set_rate: all_or_none("V_set_rate", |b| b.v_set_rate)?,
            P_set_rate: all_or_none("P_set_rate", |b| b.p_set_rate)?,
            omega_set_range: c.omega_set_range,
            V_set_range: c.v_set_range,
            SoC: c.soc_limits,
        },
        measurement_filter: c.measurement_filter,
        no_circulation: c.no_circulation,
        lost_link_fade_s: c.lost_link_fade_s,
        exchange_fade_s: c.exchange_fade_s,
        channel: c.channel,
        silence_s: c.silence_s,
        outlier_filter: c.outlier_filter,
        message_faults,
        part: None,
    };
    config.validate().map_err(|error| moved(origin, &error))?;
    Ok(config)
}

/// Distances between positions; the index of a battery without one is the error.
fn euclidean(bess: &[Bess]) -> Result<Vec<Vec<f64>>, usize> {
    let positions: Vec<[f64; 2]> =
        bess.iter().enumerate().map(|(i, b)| b.position.ok_or(i)).collect::<Result<_, _>>()?;
    let distance = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    Ok(positions.iter().map(|a| positions.iter().map(|b| distance(a, b)).collect()).collect())
}

/// The first problem of a configuration, at its place in the scenario.
fn moved(origin: &str, error: &ConfigError) -> ScenarioError {
    let unknown = Problem { path: "control".into(), found: "a problem".into(), expected: "none".into() };
    let problem = error.problems.first().unwrap_or(&unknown);
    ScenarioError::Value {
        origin: origin.into(),
        path: path_in_scenario(&problem.path),
        found: problem.found.clone(),
        expected: problem.expected.clone(),
    }
}

fn path_in_scenario(path: &str) -> String {
    let (vector, index) = path.split_once('[').unwrap_or((path, ""));
    if let Some(key) = PER_BESS.iter().find(|key| **key == vector) {
        let key = key.trim_start_matches("limits.");
        return match index.split_once(']') {
            Some((i, _)) => format!("bess[{i}].{key}"),
            None => format!("bess[*].{key}"),
        };
    }
    for (there, here) in MOVED {
        if let Some(rest) = path.strip_prefix(there) {
            return format!("{here}{rest}");
        }
    }
    format!("control.{path}")
}

#[cfg(test)]
mod tests {
    use super::path_in_scenario;

    #[test]
    fn paths_lead_to_the_key_that_the_user_wrote() {
        for (there, here) in [
            ("K_P[2]", "bess[2].K_P"),
            ("limits.S_max[0]", "bess[0].S_max"),
            ("limits.SoC.min", "control.soc_limits.min"),
            ("communication.explicit.topologies[0].edges[3].b", "communication.graphs[0].edges[3].b"),
            ("communication.step_by_step.distances[1][2]", "communication.distance.given[1][2]"),
            ("communication.step_by_step.topologies[0].name", "communication.topologies[0].name"),
            ("gains.E", "control.gains.E"),
        ] {
            assert_eq!(path_in_scenario(there), here);
        }
    }
}

//! What a run is judged by: its batteries, its events, and from when its controller works. A variant has its own,
//! because it may change any of them.

use super::record::Record;
use crate::report::{Agents, Figure, Phase, PhaseOptions, ReportError, error_systems, phases};
use crate::scenario::Resolved;
use serde_json::{Map, Value};

/// Taken from the configurations of one run.
pub struct Terms {
    /// The batteries.
    pub agents: Agents,
    /// Instants, s, and what happens.
    pub events: Vec<(f64, String)>,
    /// What counts as settled.
    pub options: PhaseOptions,
}

impl Terms {
    /// Those of a scenario or a variant of it.
    pub fn of(resolved: &Resolved) -> Self {
        let agents = Agents {
            names: (0..resolved.control.agents()).map(|i| resolved.bess_name(i)).collect(),
            K_P: resolved.control.K_P.clone(),
            K_Q: resolved.control.K_Q.clone(),
            capacity: resolved.control.capacity.clone(),
            omega_ref: 1.0,
            V_ref: 1.0,
        };
        let events = resolved.scenario.events.iter().map(|e| (e.at_s, e.label.clone())).collect();
        let options = PhaseOptions { active_from_s: enabled_from(resolved), ..PhaseOptions::default() };
        Self { agents, events, options }
    }

    /// From event to event.
    pub fn phases(&self, record: &Record) -> Result<Vec<Phase>, ReportError> {
        phases(&record.columns()?, &self.agents, &self.events, &self.options)
    }

    /// The first phase in which the controller works from its beginning.
    pub fn first_active<'a>(&self, phases: &'a [Phase]) -> Option<&'a Phase> {
        phases.iter().find(|phase| phase.from_s >= self.options.active_from_s)
    }

    /// The error systems over time.
    pub fn errors(&self, record: &Record) -> Result<Vec<Figure>, ReportError> {
        error_systems(&record.columns()?, &self.agents, &self.events)
    }
}

/// When the controller is first enabled, s; infinite if never.
pub fn enabled_from(resolved: &Resolved) -> f64 {
    let on = |set: &Map<String, Value>| {
        set.get("controller.enable").is_some_and(|v| v.as_bool() == Some(true) || v.as_f64() == Some(1.0))
    };
    if on(&resolved.scenario.initial) {
        return 0.0;
    }
    let times = resolved.scenario.events.iter().filter(|e| on(&e.set)).map(|e| e.at_s);
    times.fold(f64::INFINITY, f64::min)
}

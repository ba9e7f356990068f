//! Which configurations a plain step does whole, that of `sweep` and `few`, and what for. Looks at a configuration only.

use super::config::{Config, Law, Limits, MeasurementFilter};

/// What a plain way over all agents is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    /// An evaluation.
    Look,
    /// A step without diagnostics.
    Move,
    /// A step with them.
    LookAndMove,
}

impl Pass {
    /// Whether the setpoints move.
    pub fn moves(self) -> bool {
        self != Self::Look
    }

    /// Whether somebody wants the diagnostics.
    pub fn looks(self) -> bool {
        self != Self::Move
    }
}

/// Whether `sweep` does all that a configuration asks for, as far as nothing changes it between steps. Every option
/// is named, so that a new one is not forgotten here.
pub(super) fn is_plain(config: &Config) -> bool {
    let Config {
        // What `sweep` does.
        K_P: _,
        K_Q: _,
        capacity: _,
        P_exchange_max: _,
        omega_set_start: _,
        V_set_start: _,
        eta: _,
        gains: _,
        theta_min_s: _,
        theta_E_s: _,
        discretisation: _,
        exchange_fade_s: _,
        // What `Controller::is_plain` looks at in every step.
        delay_s: _,
        voltage_policy: _,
        communication: _,
        channel: _,
        // What it leaves to `evaluate`.
        law,
        limits,
        measurement_filter,
        no_circulation,
        lost_link_fade_s,
        silence_s,
        outlier_filter,
        message_faults,
        part,
    } = config;
    *law == Law::FiniteTime
        && *limits == Limits::default()
        && *measurement_filter == MeasurementFilter::default()
        && !no_circulation
        && lost_link_fade_s.is_none()
        && silence_s.is_none()
        && *outlier_filter == 0
        && message_faults.is_empty()
        && part.is_none()
}

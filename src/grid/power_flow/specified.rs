//! What a case specifies at each bus: powers, voltages, and which of angle and magnitude are unknown.

use super::super::case::{Case, ISOLATED, PV, REFERENCE};
use super::Start;
use faer::c64;

/// What is unknown at a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unknown {
    /// Nothing: the reference, or an isolated bus.
    Nothing,
    /// The angle: a bus that holds its voltage.
    Angle,
    /// Angle and magnitude.
    Both,
}

/// In the order of the bus table.
pub(super) struct Specified {
    /// Magnitudes to start from, held where they are not unknown, pu.
    pub vm: Vec<f64>,
    /// Angles to start from, rad.
    pub va: Vec<f64>,
    /// Generation less load, pu.
    pub power: Vec<c64>,
    /// What is to be found.
    pub unknown: Vec<Unknown>,
}

impl Specified {
    /// Of a validated case.
    pub fn of(case: &Case, start: Start) -> Self {
        let n = case.bus.len();
        let positions = case.positions();
        let mut power: Vec<c64> = case.bus.iter().map(|b| -c64::new(b.pd, b.qd) / case.base_mva).collect();
        let mut setpoint = vec![None; n];
        for generator in case.generator.iter().filter(|g| g.status == 1) {
            if let Some(&k) = positions.get(&generator.bus) {
                power[k] += c64::new(generator.pg, generator.qg) / case.base_mva;
                setpoint[k] = Some(generator.vg);
            }
        }
        let reference_angle =
            case.bus.iter().find(|b| b.kind == REFERENCE).map_or(0.0, |b| b.va.to_radians());
        let mut this = Self { vm: vec![0.0; n], va: vec![0.0; n], power, unknown: vec![Unknown::Nothing; n] };
        for (k, bus) in case.bus.iter().enumerate() {
            let holds_voltage = setpoint[k].filter(|_| bus.kind == PV || bus.kind == REFERENCE);
            let from_case = start == Start::Case || bus.kind == REFERENCE;
            (this.vm[k], this.va[k]) = match bus.kind {
                ISOLATED => (0.0, 0.0),
                _ if from_case => (holds_voltage.unwrap_or(bus.vm), bus.va.to_radians()),
                _ => (holds_voltage.unwrap_or(1.0), reference_angle),
            };
            this.unknown[k] = match bus.kind {
                ISOLATED | REFERENCE => Unknown::Nothing,
                // A PV bus without a generator in service is a PQ bus.
                _ if holds_voltage.is_some() => Unknown::Angle,
                _ => Unknown::Both,
            };
        }
        this
    }
}

//! What never changes during a simulation: the network with its loads at the solved voltage, and where
//! sources connect. Never solves for voltages itself.

use super::admittance::{SparseMatrix, bus_admittance, diagonal_positions};
use super::case::{Case, ISOLATED};
use super::config::Config;
use super::error::GridError;
use super::load::LoadModel;
use super::power_flow::{Start, power_flow};
use faer::c64;

/// The network as the sources see it before load changes, tie and source reactances are added.
#[derive(Clone, Debug)]
pub struct Plant {
    /// Bus admittance matrix with the loads' admittances at the solved voltage, as far as held, pu.
    pub(crate) admittance: SparseMatrix,
    /// Where the diagonal entries stand in its values.
    pub(crate) diagonal: Vec<usize>,
    /// Whether each bus is in service.
    pub(crate) live: Vec<bool>,
    /// Position of each BESS's bus, from 0.
    pub(crate) bess_bus: Vec<usize>,
    /// Angle of each bus in the power flow, rad: where the search for a steady state starts.
    pub(crate) angle: Vec<f64>,
    /// Position of the tie's bus, from 0, and the tie's reactance, pu.
    pub(crate) tie: Option<(usize, f64)>,
    /// Loads whose current is not proportional to their voltage.
    pub(crate) nonlinear: Vec<NonlinearLoad>,
    /// How those follow the voltage.
    pub(crate) load_model: LoadModel,
}

/// A load of the case that is not an impedance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NonlinearLoad {
    /// Position of its bus, from 0.
    pub bus: usize,
    /// Its admittance at the solved voltage, pu.
    pub admittance: c64,
    /// The solved voltage, pu.
    pub v0: f64,
}

impl Plant {
    /// From a validated configuration: solves the power flow and turns the loads into admittances.
    ///
    /// A BESS replaces all generators at its bus. Generators at other buses stay, as negative loads with
    /// the power that the power flow gave them, under the load model of the case.
    pub fn new(config: &Config) -> Result<Self, GridError> {
        let case = config.case.resolve()?;
        let buses: Vec<u64> = config.bess.iter().map(|bess| bess.bus).collect();
        let mut plant = Self::of_case(&case, &buses, config.load_model)?;
        if let Some(tie) = &config.tie {
            plant.tie = Some((bus_position(&case, "tie.bus", tie.bus)?, tie.X));
        }
        Ok(plant)
    }

    /// From a validated case and the ids of the BESS buses, without a tie.
    pub fn of_case(case: &Case, bess_buses: &[u64], load_model: LoadModel) -> Result<Self, GridError> {
        let bess_bus = bess_buses
            .iter()
            .enumerate()
            .map(|(i, &id)| bus_position(case, &format!("bess[{i}].bus"), id))
            .collect::<Result<Vec<_>, _>>()?;
        // A stored solution is the better start, a flat one the safer.
        let solution = power_flow(case, Start::Case).or_else(|_| power_flow(case, Start::Flat))?;
        let positions = case.positions();
        let mut load: Vec<c64> = case.bus.iter().map(|b| c64::new(b.pd, b.qd) / case.base_mva).collect();
        for generator in case.generator.iter().filter(|g| g.status == 1) {
            if let Some(&k) = positions.get(&generator.bus)
                && !bess_bus.contains(&k)
            {
                load[k] = -solution.injection[k];
            }
        }
        let mut admittance = bus_admittance(case)?;
        let diagonal = diagonal_positions(&admittance);
        let mut nonlinear = Vec::new();
        for (k, bus) in case.bus.iter().enumerate() {
            if bus.kind == ISOLATED {
                // Holds a dead bus at 0 V and keeps the matrix regular.
                admittance.val_mut()[diagonal[k]] = c64::ONE;
            } else if load[k] != c64::ZERO {
                let v0 = solution.vm[k];
                let y = load[k].conj() / (v0 * v0);
                admittance.val_mut()[diagonal[k]] += y * load_model.held_as_admittance();
                if !load_model.is_linear() {
                    nonlinear.push(NonlinearLoad { bus: k, admittance: y, v0 });
                }
            }
        }
        let live = case.bus.iter().map(|bus| bus.kind != ISOLATED).collect();
        let angle = solution.va;
        Ok(Self { admittance, diagonal, live, bess_bus, angle, tie: None, nonlinear, load_model })
    }

    /// Currents of the loads that are not impedances at their voltages `v`, less what the matrix holds
    /// of them, into the network, pu.
    pub(crate) fn load_currents(&self, v: &[c64], j: &mut [c64]) {
        for (k, load) in self.nonlinear.iter().enumerate() {
            j[k] = -v[k] * self.not_held(load, v[k].norm_sqr().sqrt());
        }
    }

    /// Tangent of such a load's current in [`Self::load_currents`], from that of its voltage `v`: by d abs(v) too.
    pub(crate) fn load_current_rate(&self, load: &NonlinearLoad, v: c64, dv: c64) -> c64 {
        let magnitude = v.norm_sqr().sqrt();
        let rate = if magnitude > 0.0 { (v.re * dv.re + v.im * dv.im) / magnitude } else { 0.0 };
        let slope = load.admittance * self.load_model.admittance_slope(magnitude, load.v0);
        -(dv * self.not_held(load, magnitude) + v * slope * rate)
    }

    /// Admittance of such a load at voltage magnitude `v`, less what the matrix holds of it, pu.
    pub(crate) fn not_held(&self, load: &NonlinearLoad, v: f64) -> c64 {
        let model = self.load_model;
        load.admittance * (model.admittance_ratio(v, load.v0) - model.held_as_admittance())
    }

    /// Number of BESS.
    pub fn n(&self) -> usize {
        self.bess_bus.len()
    }

    /// Number of buses.
    pub fn n_bus(&self) -> usize {
        self.diagonal.len()
    }
}

fn bus_position(case: &Case, path: &str, id: u64) -> Result<usize, GridError> {
    case.position(id)
        .filter(|&k| case.bus[k].kind != ISOLATED)
        .ok_or_else(|| GridError::invalid(path, id, "the id of a bus in service"))
}

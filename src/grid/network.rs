//! What the sources see of the network under the present load changes and tie: their currents from
//! their voltages, and bus voltages on demand. Small grids go through a dense matrix (Kron reduction),
//! large ones through a sparse solve; both agree to rounding. Rebuilt from the plant whenever loads,
//! tie or reactances change, so that nothing depends on the order of earlier changes.

use super::admittance::SparseMatrix;
use super::config::NetworkMethod;
use super::error::GridError;
use super::lu::Lu;
use super::plant::Plant;
use super::reduction::{LOAD_TOLERANCE_PU, MAX_LOAD_ITERATIONS, Reduction, worse};
use super::sparse::active::Active;
use super::workspace::Workspace;
use faer::c64;
use std::sync::Arc;

/// What the network depends on besides the plant.
#[derive(Clone, Debug, PartialEq)]
pub struct Conditions<'a> {
    /// Load changes per bus, pu at 1 pu voltage: admittance dP - j dQ.
    pub dP_load: &'a [f64],
    /// Reactive load changes per bus, pu at 1 pu voltage, positive inductive.
    pub dQ_load: &'a [f64],
    /// Reactance behind each source, pu.
    pub X_c: &'a [f64],
    /// Whether the breaker to the main grid is closed.
    pub tie_closed: bool,
}

/// The network between the sources.
#[derive(Clone)]
pub struct Network {
    pub(super) plant: Arc<Plant>,
    matrix: SparseMatrix,
    pub(super) lu: Lu,
    /// `Some` for the dense method.
    reduction: Option<Reduction>,
    /// `Some` for the sparse method with impedance loads: a solve for the buses of sources and tie alone.
    active: Option<ActiveBuses>,
    /// Admittance 1 / (j X_c) of each source, and of the tie when closed.
    pub(super) source: Vec<c64>,
    pub(super) tie: c64,
    dP_load: Vec<f64>,
    dQ_load: Vec<f64>,
    X_c: Vec<f64>,
    pub(super) tie_closed: bool,
    valid: bool,
}

/// The part of the factors that currents between the sources need.
#[derive(Clone)]
struct ActiveBuses {
    solve: Active<c64>,
    /// Where each source's bus stands in it, the tie's last.
    at: Vec<u32>,
    /// False when the factors needed pivoting, so that there is no part of them to take.
    valid: bool,
}

impl Network {
    /// The network of a plant under the given conditions.
    pub fn new(plant: Arc<Plant>, method: NetworkMethod, now: &Conditions<'_>) -> Result<Self, GridError> {
        let matrix = assemble(&plant, now, None);
        let lu = Lu::new(&matrix, "the network with its sources")?;
        let reduction = use_kron(&plant, method).then(|| Reduction::new(&plant, &lu));
        let active = (reduction.is_none() && plant.nonlinear.is_empty()).then(|| {
            let buses: Vec<usize> =
                plant.bess_bus.iter().copied().chain(plant.tie.map(|(bus, _)| bus)).collect();
            let (solve, at) = lu.active(&buses);
            ActiveBuses { solve, at, valid: false }
        });
        let mut this = Self {
            source: vec![c64::ZERO; plant.n()],
            tie: c64::ZERO,
            dP_load: vec![0.0; plant.n_bus()],
            dQ_load: vec![0.0; plant.n_bus()],
            X_c: vec![0.0; plant.n()],
            tie_closed: false,
            valid: false,
            plant,
            matrix,
            lu,
            reduction,
            active,
        };
        this.update(now)?;
        Ok(this)
    }

    /// Memory for evaluations of this network.
    pub fn workspace(&self) -> Workspace {
        let n_active = self.active.as_ref().map_or(0, |active| active.solve.n());
        let (n, n_bus, n_load) = (self.plant.n(), self.plant.n_bus(), self.plant.nonlinear.len());
        Workspace::new(n, n_bus, n_load, n_active, self.lu.scratch())
    }

    /// The plant that the network belongs to.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Whether the dense method is used.
    pub fn is_dense(&self) -> bool {
        self.reduction.is_some()
    }

    /// Brings the network in line with the conditions; does nothing when they have not changed.
    pub fn update(&mut self, now: &Conditions<'_>) -> Result<(), GridError> {
        let same = self.valid
            && self.tie_closed == now.tie_closed
            && self.X_c == now.X_c
            && self.dP_load == now.dP_load
            && self.dQ_load == now.dQ_load;
        if same { Ok(()) } else { self.rebuild(now, None) }
    }

    /// Makes the network anew; `extra` is added to the diagonal of the bus admittance matrix.
    pub(super) fn rebuild(&mut self, now: &Conditions<'_>, extra: Option<&[c64]>) -> Result<(), GridError> {
        self.valid = false;
        fill(&self.plant, now, extra, self.matrix.val_mut());
        self.lu.refactor(&self.matrix)?;
        for (y, &X) in self.source.iter_mut().zip(now.X_c) {
            *y = through(X);
        }
        self.tie = tie_admittance(&self.plant, now);
        if let Some(reduction) = &mut self.reduction {
            reduction.rebuild(&self.plant, &self.lu, &self.source, self.tie)?;
        }
        if let Some(active) = &mut self.active {
            active.valid = self.lu.update_active(&mut active.solve);
        }
        self.dP_load.copy_from_slice(now.dP_load);
        self.dQ_load.copy_from_slice(now.dQ_load);
        self.X_c.copy_from_slice(now.X_c);
        self.tie_closed = now.tie_closed;
        self.valid = extra.is_none();
        Ok(())
    }

    /// Currents `ws.i_*` that the sources send into the network, from their voltages `ws.e_*`, pu.
    #[inline(always)]
    pub fn currents(&self, ws: &mut Workspace) -> Result<(), GridError> {
        if let Some(reduction) = &self.reduction {
            return reduction.currents(&self.plant, ws);
        }
        if let Some(active) = self.active.as_ref().filter(|active| active.valid) {
            self.active_currents(active, ws);
            return Ok(());
        }
        self.voltages(ws)?;
        for (i, &bus) in self.plant.bess_bus.iter().enumerate() {
            let current = self.source[i] * (c64::new(ws.e_re[i], ws.e_im[i]) - ws.v[bus]);
            (ws.i_re[i], ws.i_im[i]) = (current.re, current.im);
        }
        Ok(())
    }

    fn active_currents(&self, active: &ActiveBuses, ws: &mut Workspace) {
        let n = self.plant.n();
        let v = &mut ws.v_active;
        v.fill(c64::ZERO);
        for (i, &at) in active.at[..n].iter().enumerate() {
            v[at as usize] += self.source[i] * c64::new(ws.e_re[i], ws.e_im[i]);
        }
        if let Some(&at) = active.at.get(n) {
            v[at as usize] += self.tie;
        }
        active.solve.solve(v);
        for (i, &at) in active.at[..n].iter().enumerate() {
            let current = self.source[i] * (c64::new(ws.e_re[i], ws.e_im[i]) - v[at as usize]);
            (ws.i_re[i], ws.i_im[i]) = (current.re, current.im);
        }
    }

    /// Bus voltages `ws.v` from the sources' voltages `ws.e_*`, pu.
    #[inline(always)]
    pub fn voltages(&self, ws: &mut Workspace) -> Result<(), GridError> {
        if let Some(reduction) = &self.reduction {
            return reduction.voltages(&self.plant, ws);
        }
        if self.plant.nonlinear.is_empty() || !ws.warm {
            self.linear_voltages(ws);
        }
        if self.plant.nonlinear.is_empty() {
            return Ok(());
        }
        if !std::mem::replace(&mut ws.warm, true) {
            for (k, load) in self.plant.nonlinear.iter().enumerate() {
                ws.v_load[k] = ws.v[load.bus];
            }
        }
        let mut change = f64::INFINITY;
        for _ in 0..MAX_LOAD_ITERATIONS {
            self.plant.load_currents(&ws.v_load, &mut ws.j_load);
            self.inject_sources(ws);
            for (k, load) in self.plant.nonlinear.iter().enumerate() {
                ws.v[load.bus] += ws.j_load[k];
            }
            self.lu.solve(&mut ws.v, &mut ws.scratch);
            change = 0.0;
            for (k, load) in self.plant.nonlinear.iter().enumerate() {
                change = worse(change, (ws.v[load.bus] - ws.v_load[k]).norm());
                ws.v_load[k] = ws.v[load.bus];
            }
            if change < LOAD_TOLERANCE_PU {
                return Ok(());
            }
        }
        ws.warm = false;
        Err(GridError::Loads { residual: change })
    }

    /// The same without the currents of loads that are not impedances.
    pub(super) fn linear_voltages(&self, ws: &mut Workspace) {
        if let Some(reduction) = &self.reduction {
            reduction.linear_voltages(ws);
        } else {
            self.inject_sources(ws);
            self.lu.solve(&mut ws.v, &mut ws.scratch);
        }
    }

    fn inject_sources(&self, ws: &mut Workspace) {
        ws.v.fill(c64::ZERO);
        for (i, &bus) in self.plant.bess_bus.iter().enumerate() {
            ws.v[bus] += self.source[i] * c64::new(ws.e_re[i], ws.e_im[i]);
        }
        if let Some((bus, _)) = self.plant.tie {
            ws.v[bus] += self.tie;
        }
    }

    /// Bus admittance matrix with loads, sources and tie in it, pu.
    pub(super) fn matrix(&self) -> &SparseMatrix {
        &self.matrix
    }

    /// Current of source `i` (from 0) at voltage `e` into buses at `v`, pu; linear, and so of tangents too.
    pub(super) fn source_current(&self, i: usize, e: c64, v: &[c64]) -> c64 {
        self.source[i] * (e - v[self.plant.bess_bus[i]])
    }

    /// Complex powers of the sources at these source and bus voltages, pu.
    pub(super) fn source_powers(&self, E: &[c64], v: &[c64]) -> Vec<c64> {
        (0..E.len()).map(|i| E[i] * self.source_current(i, E[i], v).conj()).collect()
    }

    /// Power (P, Q) that the main grid sends into the network, measured at the tie's bus, from the bus
    /// voltages `ws.v`, pu; zero when the breaker is open.
    pub fn tie_power(&self, v: &[c64]) -> (f64, f64) {
        match self.plant.tie {
            Some((bus, _)) if self.tie_closed => {
                let S = v[bus] * (self.tie * (c64::ONE - v[bus])).conj();
                (S.re, S.im)
            }
            _ => (0.0, 0.0),
        }
    }
}

/// Admittance of a reactance, pu.
fn through(X: f64) -> c64 {
    c64::new(0.0, -1.0 / X)
}

fn tie_admittance(plant: &Plant, now: &Conditions<'_>) -> c64 {
    match plant.tie {
        Some((_, X)) if now.tie_closed => through(X),
        _ => c64::ZERO,
    }
}

fn assemble(plant: &Plant, now: &Conditions<'_>, extra: Option<&[c64]>) -> SparseMatrix {
    let mut matrix = plant.admittance.clone();
    fill(plant, now, extra, matrix.val_mut());
    matrix
}

fn fill(plant: &Plant, now: &Conditions<'_>, extra: Option<&[c64]>, values: &mut [c64]) {
    values.copy_from_slice(plant.admittance.val());
    for (k, &at) in plant.diagonal.iter().enumerate().filter(|&(k, _)| plant.live[k]) {
        values[at] += c64::new(now.dP_load[k], -now.dQ_load[k]);
        if let Some(extra) = extra {
            values[at] += extra[k];
        }
    }
    for (i, &bus) in plant.bess_bus.iter().enumerate() {
        values[plant.diagonal[bus]] += through(now.X_c[i]);
    }
    if let Some((bus, _)) = plant.tie {
        values[plant.diagonal[bus]] += tie_admittance(plant, now);
    }
}

/// The dense method pays while its matrix stays small against the factors of the sparse one. With loads
/// that are not impedances it needs a column for each of them.
fn use_kron(plant: &Plant, method: NetworkMethod) -> bool {
    match method {
        NetworkMethod::Kron => true,
        NetworkMethod::Sparse => false,
        NetworkMethod::Auto if !plant.nonlinear.is_empty() => plant.n_bus() <= 300,
        NetworkMethod::Auto => plant.n() <= 64 || plant.n() * plant.n() <= 10 * plant.n_bus(),
    }
}

//! The power flow: Newton's method in polar coordinates, sparse. Its bus voltages turn the loads into
//! admittances. Enforces no reactive limits, as MATPOWER by default.

use super::admittance::{SparseMatrix, bus_admittance, multiply};
use super::case::{Case, ISOLATED, PV, REFERENCE};
use super::error::GridError;
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Col, c64};

/// Where Newton's method starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// The `vm`, `va` of the bus table.
    #[default]
    Case,
    /// 1 pu at the reference angle.
    Flat,
}

/// A solved power flow, in the order of the bus table; isolated buses are at 0 pu.
#[derive(Clone, Debug, PartialEq)]
pub struct PowerFlow {
    /// Voltage magnitudes, pu.
    pub vm: Vec<f64>,
    /// Voltage angles, rad.
    pub va: Vec<f64>,
    /// Complex power injected into the network at each bus, pu: generation less load.
    pub injection: Vec<c64>,
    /// Newton iterations made.
    pub iterations: usize,
    /// Largest power mismatch left, pu.
    pub mismatch: f64,
}

const MAX_ITERATIONS: usize = 30;
const TOLERANCE_PU: f64 = 1e-10;

/// Solves the power flow of a validated case from `start`.
pub fn power_flow(case: &Case, start: Start) -> Result<PowerFlow, GridError> {
    check_connected(case)?;
    let Y = bus_admittance(case)?;
    let specified = Specified::of(case, start);
    let (mut vm, mut va) = (specified.vm.clone(), specified.va.clone());
    let mut iterations = 0;
    loop {
        let V: Vec<c64> = vm.iter().zip(&va).map(|(&m, &a)| c64::from_polar(m, a)).collect();
        let I = multiply(&Y, &V);
        let S: Vec<c64> = V.iter().zip(&I).map(|(v, i)| v * i.conj()).collect();
        let mut worst = Mismatch { size: 0.0, quantity: "active", bus: 0 };
        let mut residual = Col::<f64>::zeros(specified.n_unknowns);
        for k in 0..case.bus.len() {
            let d = specified.power[k] - S[k];
            if let Some(at) = specified.angle_at[k] {
                residual[at] = d.re;
                worst.see(d.re, "active", k);
            }
            if let Some(at) = specified.magnitude_at[k] {
                residual[at] = d.im;
                worst.see(d.im, "reactive", k);
            }
        }
        if worst.size < TOLERANCE_PU {
            return Ok(PowerFlow { vm, va, injection: S, iterations, mismatch: worst.size });
        }
        let failed = GridError::PowerFlow {
            case: case.name.clone(),
            iterations,
            mismatch_pu: worst.size,
            quantity: worst.quantity,
            bus: case.bus[worst.bus].id,
        };
        if iterations == MAX_ITERATIONS || !worst.size.is_finite() {
            return Err(failed);
        }
        let Some(correction) =
            jacobian(&Y, &V, &S, &specified).and_then(|J| J.sp_lu().ok()).map(|lu| lu.solve(&residual))
        else {
            return Err(failed);
        };
        for k in 0..case.bus.len() {
            if let Some(at) = specified.angle_at[k] {
                va[k] += correction[at];
            }
            if let Some(at) = specified.magnitude_at[k] {
                vm[k] += correction[at];
            }
        }
        iterations += 1;
    }
}

/// The largest mismatch so far; NaN counts as the largest of all.
struct Mismatch {
    size: f64,
    quantity: &'static str,
    bus: usize,
}

impl Mismatch {
    fn see(&mut self, value: f64, quantity: &'static str, bus: usize) {
        if self.size.is_finite() && (value.is_nan() || value.abs() > self.size) {
            *self = Self { size: value.abs(), quantity, bus };
        }
    }
}

/// What is given at each bus, and where its unknowns stand in Newton's vector.
struct Specified {
    vm: Vec<f64>,
    va: Vec<f64>,
    power: Vec<c64>,
    angle_at: Vec<Option<usize>>,
    magnitude_at: Vec<Option<usize>>,
    n_unknowns: usize,
}

impl Specified {
    fn of(case: &Case, start: Start) -> Self {
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
        let mut this = Self {
            vm: vec![0.0; n],
            va: vec![0.0; n],
            power,
            angle_at: vec![None; n],
            magnitude_at: vec![None; n],
            n_unknowns: 0,
        };
        for (k, bus) in case.bus.iter().enumerate() {
            let holds_voltage = setpoint[k].filter(|_| bus.kind == PV || bus.kind == REFERENCE);
            let from_case = start == Start::Case || bus.kind == REFERENCE;
            (this.vm[k], this.va[k]) = match bus.kind {
                ISOLATED => (0.0, 0.0),
                _ if from_case => (holds_voltage.unwrap_or(bus.vm), bus.va.to_radians()),
                _ => (holds_voltage.unwrap_or(1.0), reference_angle),
            };
            if bus.kind != ISOLATED && bus.kind != REFERENCE {
                this.angle_at[k] = Some(this.n_unknowns);
                this.n_unknowns += 1;
                // A PV bus without a generator in service is a PQ bus.
                if holds_voltage.is_none() {
                    this.magnitude_at[k] = Some(this.n_unknowns);
                    this.n_unknowns += 1;
                }
            }
        }
        this
    }
}

/// d(P, Q) / d(angle, magnitude) at the unknowns.
fn jacobian(Y: &SparseMatrix, V: &[c64], S: &[c64], at: &Specified) -> Option<SparseColMat<usize, f64>> {
    let (col_ptr, row_idx) = (Y.symbolic().col_ptr(), Y.symbolic().row_idx());
    let mut entries = Vec::with_capacity(4 * row_idx.len());
    for k in 0..V.len() {
        for index in col_ptr[k]..col_ptr[k + 1] {
            let i = row_idx[index];
            let t = V[i] * (Y.val()[index] * V[k]).conj();
            let mut by_angle = c64::new(t.im, -t.re);
            let mut by_magnitude = t / V[k].norm();
            if i == k {
                by_angle += c64::new(-S[i].im, S[i].re);
                by_magnitude += S[i] / V[i].norm();
            }
            for (row, part) in [(at.angle_at[i], 0), (at.magnitude_at[i], 1)] {
                for (column, derivative) in [(at.angle_at[k], by_angle), (at.magnitude_at[k], by_magnitude)] {
                    if let (Some(row), Some(column)) = (row, column) {
                        let value = if part == 0 { derivative.re } else { derivative.im };
                        entries.push(Triplet::new(row, column, value));
                    }
                }
            }
        }
    }
    SparseColMat::try_new_from_triplets(at.n_unknowns, at.n_unknowns, &entries).ok()
}

/// All buses in service must hang together; a dead part would make the equations singular.
fn check_connected(case: &Case) -> Result<(), GridError> {
    let positions = case.positions();
    let live = |k: usize| case.bus[k].kind != ISOLATED;
    let mut neighbours = vec![Vec::new(); case.bus.len()];
    for branch in case.branch.iter().filter(|b| b.status == 1) {
        if let (Some(&f), Some(&t)) = (positions.get(&branch.from), positions.get(&branch.to))
            && live(f)
            && live(t)
        {
            neighbours[f].push(t);
            neighbours[t].push(f);
        }
    }
    let mut reached = vec![false; case.bus.len()];
    let mut waiting: Vec<usize> = case.bus.iter().position(|b| b.kind == REFERENCE).into_iter().collect();
    while let Some(k) = waiting.pop() {
        if !std::mem::replace(&mut reached[k], true) {
            waiting.extend(&neighbours[k]);
        }
    }
    match (0..case.bus.len()).find(|&k| live(k) && !reached[k]) {
        None => Ok(()),
        Some(k) => Err(GridError::invalid(
            format!("bus[{k}]"),
            format!("bus {} without a path to the reference bus", case.bus[k].id),
            "one connected network; close a branch, or mark dead buses as isolated (type 4)",
        )),
    }
}

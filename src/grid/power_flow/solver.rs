//! A power flow that is solved again and again on one network: loads change, the analysis stays, and each
//! solve starts from the solution before. Solving allocates nothing.

use super::super::admittance::bus_admittance;
use super::super::case::Case;
use super::super::error::{GridError, finite};
use super::super::sparse::{Guarded, Ordering, Real2};
use super::Start;
use super::connected::check_connected;
use super::network::{Ordered, OrderedNetwork};
use super::specified::Specified;
use faer::c64;

/// Newton iterations before giving up.
const MAX_ITERATIONS: usize = 30;
/// Largest mismatch of a solution unless told otherwise, pu.
const TOLERANCE_PU: f64 = 1e-10;

/// How a solve went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Newton iterations made.
    pub iterations: usize,
    /// Largest power mismatch left, pu.
    pub mismatch: f64,
    /// Iterations whose equations needed the pivoting LU.
    pub pivoted: usize,
}

/// The power flow of one network, kept between solves.
///
/// ```
/// use bess_consensus::grid::{Case, PowerFlowSolver, Start};
/// let mut solver = PowerFlowSolver::new(&Case::built_in("case57")?, Start::Case)?;
/// solver.solve()?;
/// solver.set_load(11, 0.5, 0.1)?;
/// let warm = solver.solve()?;
/// assert!(warm.mismatch < 1e-10 && solver.vm(11) > 0.9);
/// # Ok::<(), bess_consensus::grid::GridError>(())
/// ```
#[derive(Clone)]
pub struct PowerFlowSolver {
    name: String,
    bus_id: Vec<u64>,
    ordering: Ordering,
    network: OrderedNetwork,
    tolerance_pu: f64,
    /// Generation of the case, pu, in the order of the bus table.
    generation: Vec<c64>,
    /// From here on in elimination order: generation less load, pu.
    specified: Vec<c64>,
    vm: Vec<f64>,
    va: Vec<f64>,
    v: Vec<c64>,
    s: Vec<c64>,
    /// vm, va and s before a solve, to go back to when it fails.
    before: (Vec<f64>, Vec<f64>, Vec<c64>),
    mismatch: Vec<[f64; 2]>,
    correction: Vec<[f64; 2]>,
    jacobian: Vec<Real2>,
    factors: Guarded<Real2>,
}

impl PowerFlowSolver {
    /// For the network of a validated case, to start from its stored voltages or flat.
    pub fn new(case: &Case, start: Start) -> Result<Self, GridError> {
        check_connected(case)?;
        let specified = Specified::of(case, start);
        let Ordered { network, ordering, pattern } =
            OrderedNetwork::ordered(&bus_admittance(case)?, &specified.unknown);
        let n = case.bus.len();
        let ordered = |values: &[f64]| ordering.order.iter().map(|&k| values[k as usize]).collect::<Vec<_>>();
        let (vm, va) = (ordered(&specified.vm), ordered(&specified.va));
        let load = |k: usize| c64::new(case.bus[k].pd, case.bus[k].qd) / case.base_mva;
        Ok(Self {
            name: case.name.clone(),
            bus_id: case.bus.iter().map(|bus| bus.id).collect(),
            tolerance_pu: TOLERANCE_PU,
            generation: (0..n).map(|k| specified.power[k] + load(k)).collect(),
            specified: ordering.order.iter().map(|&k| specified.power[k as usize]).collect(),
            before: (vm.clone(), va.clone(), vec![c64::ZERO; n]),
            vm,
            va,
            v: vec![c64::ZERO; n],
            s: vec![c64::ZERO; n],
            mismatch: vec![[0.0; 2]; n],
            correction: vec![[0.0; 2]; n],
            jacobian: vec![Real2([0.0; 4]); network.entries()],
            factors: Guarded::new(pattern),
            ordering,
            network,
        })
    }

    /// Sets the load of the bus at position `b` (from 0), pu, reactive power positive inductive.
    pub fn set_load(&mut self, b: usize, p_pu: f64, q_pu: f64) -> Result<(), GridError> {
        finite(|| format!("load[{b}].p"), p_pu)?;
        finite(|| format!("load[{b}].q"), q_pu)?;
        let Some(&at) = self.ordering.position.get(b) else {
            let expected = format!("a position below {}", self.bus_id.len());
            return Err(GridError::invalid("b", b, expected));
        };
        self.specified[at as usize] = self.generation[b] - c64::new(p_pu, q_pu);
        Ok(())
    }

    /// The load of the bus at position `b` (from 0), pu.
    pub fn load(&self, b: usize) -> (f64, f64) {
        let load = self.generation[b] - self.specified[self.ordering.position[b] as usize];
        (load.re, load.im)
    }

    /// Sets the largest mismatch that a solution may leave, pu.
    pub fn set_tolerance(&mut self, tolerance_pu: f64) -> Result<(), GridError> {
        super::super::error::positive(|| "tolerance_pu".into(), tolerance_pu)?;
        self.tolerance_pu = tolerance_pu;
        Ok(())
    }

    /// Voltage magnitude of the bus at position `b` (from 0), pu; 0 at an isolated bus.
    pub fn vm(&self, b: usize) -> f64 {
        self.vm[self.ordering.position[b] as usize]
    }

    /// Voltage angle of the bus at position `b` (from 0), rad.
    pub fn va(&self, b: usize) -> f64 {
        self.va[self.ordering.position[b] as usize]
    }

    /// Power that the bus at position `b` (from 0) injects into the network at the last solution, pu.
    pub fn injection(&self, b: usize) -> c64 {
        self.s[self.ordering.position[b] as usize]
    }

    /// Solves from the voltages of the solve before, or from the start. When it fails, what was there stays.
    pub fn solve(&mut self) -> Result<Convergence, GridError> {
        self.before.0.copy_from_slice(&self.vm);
        self.before.1.copy_from_slice(&self.va);
        self.before.2.copy_from_slice(&self.s);
        let solved = self.newton();
        if solved.is_err() {
            self.vm.copy_from_slice(&self.before.0);
            self.va.copy_from_slice(&self.before.1);
            self.s.copy_from_slice(&self.before.2);
        }
        solved
    }

    fn newton(&mut self) -> Result<Convergence, GridError> {
        let mut pivoted = 0;
        for iterations in 0.. {
            for ((v, &vm), &va) in self.v.iter_mut().zip(&self.vm).zip(&self.va) {
                let (sin, cos) = va.sin_cos();
                *v = c64::new(vm * cos, vm * sin);
            }
            self.network.injections(&self.v, &mut self.s);
            let mismatch = self.network.mismatch(&self.specified, &self.s, &mut self.mismatch);
            if mismatch < self.tolerance_pu {
                return Ok(Convergence { iterations, mismatch, pivoted });
            }
            if iterations == MAX_ITERATIONS || !mismatch.is_finite() {
                return Err(self.failure(iterations));
            }
            self.network.jacobian(&self.v, &self.s, &mut self.jacobian);
            if !self.factors.factor_and_solve(&self.jacobian, &self.mismatch, &mut self.correction) {
                return Err(self.failure(iterations));
            }
            pivoted += usize::from(self.factors.has_pivoted());
            for ((vm, va), d) in self.vm.iter_mut().zip(&mut self.va).zip(&self.correction) {
                *va += d[0];
                *vm += *vm * d[1];
            }
        }
        Err(self.failure(MAX_ITERATIONS))
    }

    /// Names the largest mismatch; the first that is not a number counts as the largest of all.
    fn failure(&self, iterations: usize) -> GridError {
        let (mut size, mut quantity, mut at) = (0.0, "active", 0);
        for (k, &position) in self.ordering.position.iter().enumerate() {
            let [p, q] = self.mismatch[position as usize];
            for (value, name) in [(p, "active"), (q, "reactive")] {
                if f64::is_finite(size) && (value.is_nan() || value.abs() > size) {
                    (size, quantity, at) = (value.abs(), name, k);
                }
            }
        }
        GridError::PowerFlow {
            case: self.name.clone(),
            iterations,
            mismatch_pu: size,
            quantity,
            bus: self.bus_id.get(at).copied().unwrap_or(0),
        }
    }
}

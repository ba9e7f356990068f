//! What the readings do along a direction of the inputs, or in time: the linearised droop and network. With the
//! states held only sources and loads vary; in time the states move by their own equations; at the start they
//! follow the inputs through the steady state. Changes no value.

use super::bess::{omega, voltage};
use super::dynamics::Grid;
use super::error::GridError;
use super::integrator::Dynamics;
use super::model::GridModel;
use super::network::Network;
use super::reduction::{LOAD_TOLERANCE_PU, MAX_LOAD_ITERATIONS, worse};
use super::state::Inputs;
use super::workspace::Workspace;
use faer::linalg::solvers::Solve;
use faer::{Col, Mat, c64};

/// In which direction the grid is differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// That of the inputs' tangents, the states held.
    Inputs,
    /// That of the inputs' tangents, the steady state being found anew.
    SteadyState,
    /// Time, s: the inputs move as their tangents say, the states by their equations.
    Time,
}

/// Tangents of inputs and readings; and memory to make them.
#[derive(Clone)]
pub struct Tangents {
    /// Of the inputs, to be set; the breaker has none.
    pub inputs: Inputs,
    /// Of the states, [delta | P | Q | E]; 4 n.
    states: Vec<f64>,
    /// Of the sources' voltages; n.
    pub V: Vec<f64>,
    /// Of the frequencies; n.
    pub omega: Vec<f64>,
    /// Of the voltage magnitudes; n_bus.
    pub bus_V: Vec<f64>,
    /// Of the voltage angles; n_bus.
    pub bus_angle: Vec<f64>,
    /// Of active and reactive power through the tie.
    pub tie: (f64, f64),
    /// Sources' voltages and their tangents, pu.
    e: Vec<c64>,
    de: Vec<c64>,
    /// Bus voltages and their tangents, pu.
    v: Vec<c64>,
    dv: Vec<c64>,
    /// The states themselves.
    y: Vec<f64>,
    workspace: Workspace,
}

impl Tangents {
    /// Nothing varies.
    pub fn clear(&mut self) {
        let u = &mut self.inputs;
        for values in
            [&mut u.omega_set, &mut u.V_set, &mut u.P_set, &mut u.Q_set, &mut u.dP_load, &mut u.dQ_load]
        {
            values.fill(0.0);
        }
    }

    /// Of the measured active power of BESS `i` (from 0).
    pub fn P(&self, i: usize) -> f64 {
        self.states[self.V.len() + i]
    }

    /// Of the measured reactive power of BESS `i` (from 0).
    pub fn Q(&self, i: usize) -> f64 {
        self.states[2 * self.V.len() + i]
    }

    /// Of the energy of BESS `i` (from 0).
    pub fn E(&self, i: usize) -> f64 {
        self.states[3 * self.V.len() + i]
    }
}

impl GridModel {
    /// Room for tangents, all 0.
    pub fn tangents(&self) -> Tangents {
        let (n, n_bus) = (self.n(), self.n_bus());
        let mut tangents = Tangents {
            inputs: self.state.inputs.clone(),
            states: vec![0.0; 4 * n],
            V: vec![0.0; n],
            omega: vec![0.0; n],
            bus_V: vec![0.0; n_bus],
            bus_angle: vec![0.0; n_bus],
            tie: (0.0, 0.0),
            e: vec![c64::ZERO; n],
            de: vec![c64::ZERO; n],
            v: vec![c64::ZERO; n_bus],
            dv: vec![c64::ZERO; n_bus],
            y: vec![0.0; 4 * n],
            workspace: self.network.workspace(),
        };
        tangents.clear();
        tangents
    }

    /// Makes the tangents of all readings from those of the inputs. [`Direction::SteadyState`] allocates.
    pub fn differentiate(&mut self, direction: Direction, d: &mut Tangents) -> Result<(), GridError> {
        self.refresh()?;
        let ws = &mut d.workspace;
        ws.restart();
        ws.set_sources((0..self.n()).map(|i| self.V(i)), &self.state.delta);
        for i in 0..self.n() {
            d.e[i] = c64::new(ws.e_re[i], ws.e_im[i]);
        }
        self.network.voltages(ws)?;
        d.v.copy_from_slice(&ws.v);
        d.states.fill(0.0);
        match direction {
            Direction::Inputs => {}
            Direction::Time => self.state_rates(d)?,
            Direction::SteadyState => self.steady_state_rates(d)?,
        }
        let (du, k) = (&d.inputs, &self.state.parameters);
        for i in 0..self.n() {
            // (3) is linear: its tangent is itself in tangents.
            d.omega[i] = omega(du.omega_set[i], k.K_P[i], d.P(i), du.P_set[i]);
            d.V[i] = voltage(du.V_set[i], k.K_Q[i], d.Q(i), du.Q_set[i]);
            d.de[i] = self.source_rate(d.e[i], i, d.V[i], d.states[i]);
        }
        self.network.voltage_rates(&mut d.workspace, &d.v, &d.de, &d.inputs, &mut d.dv)?;
        for (b, (v, dv)) in d.v.iter().zip(&d.dv).enumerate() {
            let square = v.norm_sqr();
            let (along, across) = (v.re * dv.re + v.im * dv.im, v.re * dv.im - v.im * dv.re);
            (d.bus_V[b], d.bus_angle[b]) =
                if square > 0.0 { (along / square.sqrt(), across / square) } else { (0.0, 0.0) };
        }
        d.tie = self.network.tie_power_rate(&d.v, &d.dv);
        Ok(())
    }

    /// d (V exp(j delta)) = (dV + j V d delta) exp(j delta).
    fn source_rate(&self, e: c64, i: usize, dV: f64, d_delta: f64) -> c64 {
        e * c64::new(dV / self.V(i), d_delta)
    }

    /// The right-hand side of the model at its present state.
    fn state_rates(&self, d: &mut Tangents) -> Result<(), GridError> {
        let state = &self.state;
        state.write_to(&mut d.y);
        d.workspace.restart();
        let mut grid = Grid {
            network: &self.network,
            workspace: &mut d.workspace,
            inputs: &state.inputs,
            parameters: &state.parameters,
            omega_b: self.omega_b,
        };
        if grid.derivative(&d.y, &mut d.states) {
            Ok(())
        } else {
            Err(GridError::Singular { what: "the network with its present loads" })
        }
    }

    /// The steady state's tangent by the implicit function theorem, from the equations of `steady_state`: a
    /// column for every angle (islanded, the first is that of the common frequency) and every voltage.
    fn steady_state_rates(&self, d: &mut Tangents) -> Result<(), GridError> {
        let (n, islanded) = (self.n(), !self.state.inputs.tie_closed);
        let k = &self.state.parameters;
        let loads = d.inputs.clone();
        let mut none = loads.clone();
        none.dP_load.fill(0.0);
        none.dQ_load.fill(0.0);
        let mut jacobian = Mat::<f64>::zeros(2 * n, 2 * n);
        for column in 0..2 * n {
            if islanded && column == 0 {
                (0..n).for_each(|row| jacobian[(row, 0)] = 1.0);
                continue;
            }
            let (j, by_angle) = (column % n, column < n);
            d.de.fill(c64::ZERO);
            d.de[j] =
                self.source_rate(d.e[j], j, f64::from(u8::from(!by_angle)), f64::from(u8::from(by_angle)));
            self.power_rates(d, &none)?;
            for i in 0..n {
                jacobian[(i, column)] = k.K_P[i] * d.P(i);
                jacobian[(n + i, column)] = k.K_Q[i] * d.Q(i) + f64::from(u8::from(column == n + i));
            }
        }
        d.de.fill(c64::ZERO);
        self.power_rates(d, &loads)?;
        let residual = Col::<f64>::from_fn(2 * n, |row| {
            let i = row % n;
            if row < n {
                -omega(loads.omega_set[i], k.K_P[i], d.P(i), loads.P_set[i])
            } else {
                -voltage(loads.V_set[i], k.K_Q[i], d.Q(i), loads.Q_set[i])
            }
        });
        let solution = jacobian.partial_piv_lu().solve(&residual);
        if solution.iter().any(|x| !x.is_finite()) {
            return Err(GridError::Singular { what: "the steady state" });
        }
        for i in 0..n {
            d.states[i] = if islanded && i == 0 { 0.0 } else { -solution[i] };
            d.de[i] = self.source_rate(d.e[i], i, -solution[n + i], d.states[i]);
        }
        self.power_rates(d, &loads)
    }

    /// d P and d Q of the sources, instantaneous, from `d.de` and the loads' tangents.
    fn power_rates(&self, d: &mut Tangents, loads: &Inputs) -> Result<(), GridError> {
        self.network.voltage_rates(&mut d.workspace, &d.v, &d.de, loads, &mut d.dv)?;
        let n = self.n();
        for i in 0..n {
            let current = self.network.source_current(i, d.e[i], &d.v);
            let rate = self.network.source_current(i, d.de[i], &d.dv);
            let dS = d.de[i] * current.conj() + d.e[i] * rate.conj();
            (d.states[n + i], d.states[2 * n + i]) = (dS.re, dS.im);
        }
        Ok(())
    }
}

impl Network {
    /// The tangents `dv` of the bus voltages `v` from those of the sources and of the load changes:
    /// Y dv = y_c de - dY v + dj(dv), dj that of the loads that are not impedances.
    fn voltage_rates(
        &self,
        ws: &mut Workspace,
        v: &[c64],
        de: &[c64],
        loads: &Inputs,
        dv: &mut [c64],
    ) -> Result<(), GridError> {
        let plant = &self.plant;
        ws.j_load.fill(c64::ZERO);
        let mut change = f64::INFINITY;
        for _ in 0..MAX_LOAD_ITERATIONS {
            for (b, dv) in dv.iter_mut().enumerate() {
                let varies = plant.live[b] && (loads.dP_load[b] != 0.0 || loads.dQ_load[b] != 0.0);
                *dv = if varies { -v[b] * c64::new(loads.dP_load[b], -loads.dQ_load[b]) } else { c64::ZERO };
            }
            for (i, &bus) in plant.bess_bus.iter().enumerate() {
                dv[bus] += self.source[i] * de[i];
            }
            for (load, dj) in plant.nonlinear.iter().zip(&ws.j_load) {
                dv[load.bus] += dj;
            }
            self.lu.solve(dv, &mut ws.scratch);
            if plant.nonlinear.is_empty() {
                return Ok(());
            }
            change = 0.0;
            let mut size = 0.0;
            for (load, dj) in plant.nonlinear.iter().zip(&mut ws.j_load) {
                let next = plant.load_current_rate(load, v[load.bus], dv[load.bus]);
                change = worse(change, (next - *dj).norm());
                size = worse(size, next.norm());
                *dj = next;
            }
            // Both are infinite when anything is not a number.
            if change.is_finite() && change <= LOAD_TOLERANCE_PU * size {
                return Ok(());
            }
        }
        Err(GridError::Loads { residual: change })
    }

    /// The tangents of [`Network::tie_power`].
    fn tie_power_rate(&self, v: &[c64], dv: &[c64]) -> (f64, f64) {
        match self.plant.tie {
            Some((bus, _)) if self.tie_closed => {
                let current = self.tie * (c64::ONE - v[bus]);
                let dS = dv[bus] * current.conj() - v[bus] * (self.tie * dv[bus]).conj();
                (dS.re, dS.im)
            }
            _ => (0.0, 0.0),
        }
    }
}

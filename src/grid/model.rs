//! The grid model: inputs in, one communication step forward, outputs out. Knows no FMI.

use super::bess::{omega, voltage};
use super::config::Config;
use super::dynamics::Grid;
use super::error::GridError;
use super::integrator::{Effort, Failure, Integrator};
use super::load::LoadModel;
use super::network::{Conditions, Network};
use super::plant::Plant;
use super::state::{FIRST_STEP_S, Inputs, Parameters, State, wrap};
use super::steady_state::{SteadyState, steady_state};
use super::trigonometry::polar;
use super::workspace::Workspace;
use faer::c64;
use pulp::{Arch, NullaryFnOnce};
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::sync::Arc;

/// The grid with its batteries.
///
/// Life: [`GridModel::new`]; set inputs and parameters; [`GridModel::initialise`]; then any number of
/// {set inputs, [`GridModel::refresh`], read, [`GridModel::step`], read}. Everything that results depend
/// on is in [`State`]; the rest is memory, or made from the state.
#[derive(Clone)]
pub struct GridModel {
    plant: Arc<Plant>,
    load_model: LoadModel,
    pub(super) omega_b: f64,
    pub(super) state: State,
    pub(super) network: Network,
    pub(super) integrator: Integrator,
    pub(super) workspace: Workspace,
    /// [delta | P | Q | E] during a step.
    y: Vec<f64>,
    pub(super) ramp: Option<Box<super::ramp::Memory>>,
    pub(super) effort: Effort,
    /// Whether the inputs were checked and the network follows them since they were last touched.
    pub(super) in_line: bool,
    pub(super) readout: RefCell<Readout>,
}

/// Bus voltages and tie flow, made when somebody reads them.
#[derive(Clone)]
pub(super) struct Readout {
    pub(super) valid: bool,
    workspace: Workspace,
    vm: Vec<f64>,
    va: Vec<f64>,
    tie: (f64, f64),
}

impl GridModel {
    /// The model of a configuration, in its start state, not initialised.
    pub fn new(config: &Config) -> Result<Self, GridError> {
        config.validate()?;
        let plant = Arc::new(Plant::new(config)?);
        let state = State::start(config, plant.n_bus());
        let network = Network::new(plant.clone(), config.network, &conditions(&state))?;
        let workspace = network.workspace();
        let n_bus = plant.n_bus();
        let readout = Readout {
            valid: false,
            workspace: network.workspace(),
            vm: vec![0.0; n_bus],
            va: vec![0.0; n_bus],
            tie: (0.0, 0.0),
        };
        Ok(Self {
            integrator: Integrator::new(
                4 * plant.n(),
                config.tolerances.relative,
                config.tolerances.absolute,
            ),
            y: vec![0.0; 4 * plant.n()],
            ramp: None,
            load_model: config.load_model,
            omega_b: TAU * config.f_nominal_hz,
            effort: Effort::default(),
            in_line: false,
            readout: RefCell::new(readout),
            plant,
            state,
            network,
            workspace,
        })
    }

    /// Number of BESS, n.
    pub fn n(&self) -> usize {
        self.plant.n()
    }

    /// Number of buses, n_bus.
    pub fn n_bus(&self) -> usize {
        self.plant.n_bus()
    }

    /// Whether there is a tie to the main grid.
    pub fn has_tie(&self) -> bool {
        self.plant.tie.is_some()
    }

    /// Positions of the BESS buses, counted from 1.
    pub fn bess_positions(&self) -> impl Iterator<Item = usize> + '_ {
        self.plant.bess_bus.iter().map(|b| b + 1)
    }

    /// Inputs as last set.
    pub fn inputs(&self) -> &Inputs {
        &self.state.inputs
    }

    /// Inputs to set; outputs follow at the next refresh or step.
    pub fn inputs_mut(&mut self) -> &mut Inputs {
        self.in_line = false;
        &mut self.state.inputs
    }

    /// Parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.state.parameters
    }

    /// Parameters to set before [`GridModel::initialise`], which the steady state depends on.
    pub fn parameters_mut(&mut self) -> &mut Parameters {
        self.in_line = false;
        &mut self.state.parameters
    }

    /// Finds the synchronous steady state of the present inputs and starts there, with E = E_start.
    /// May be called again while inputs and parameters are still being set.
    ///
    /// With the tie open the angles are counted from that of the first BESS's source.
    pub fn initialise(&mut self) -> Result<(), GridError> {
        let start = self.find_steady_state()?;
        let before = self.state.clone();
        self.state.delta.copy_from_slice(&start.delta);
        self.state.delta.iter_mut().for_each(|delta| *delta = wrap(*delta));
        self.state.P.copy_from_slice(&start.P);
        self.state.Q.copy_from_slice(&start.Q);
        self.state.E.copy_from_slice(&self.state.parameters.E_start);
        self.state.internal_step_s = FIRST_STEP_S;
        self.state.initialised = true;
        self.refresh().inspect_err(|_| {
            self.state = before;
            self.in_line = false;
        })
    }

    /// The synchronous steady state of the present inputs; changes nothing that can be read.
    pub fn find_steady_state(&self) -> Result<SteadyState, GridError> {
        self.check_inputs()?;
        self.state.parameters.validate(self.n())?;
        let (inputs, parameters) = (&self.state.inputs, &self.state.parameters);
        let now = conditions(&self.state);
        let mut network = self.network.clone();
        network.update(&now)?;
        if self.load_model.is_linear() {
            return steady_state(&network, inputs, parameters);
        }
        // Loads that are not impedances: solve with the admittances that they have at the voltages found,
        // from those of the power flow on, until these no longer move.
        let mut workspace = network.workspace();
        let mut extra = vec![c64::ZERO; self.n_bus()];
        for load in &self.plant.nonlinear {
            extra[load.bus] = self.plant.not_held(load, load.v0);
        }
        network.rebuild(&now, Some(&extra))?;
        let mut found = steady_state(&network, inputs, parameters)?;
        let mut change = f64::INFINITY;
        for _ in 0..500 {
            workspace.set_sources(found.V.iter().copied(), &found.delta);
            network.linear_voltages(&mut workspace);
            change = 0.0;
            for load in &self.plant.nonlinear {
                let y = self.plant.not_held(load, workspace.v[load.bus].norm());
                let moved = (y - extra[load.bus]).norm();
                change = if moved.is_nan() { f64::INFINITY } else { f64::max(change, moved) };
                extra[load.bus] = y;
            }
            if change < 1e-13 {
                return Ok(found);
            }
            network.rebuild(&now, Some(&extra))?;
            found = steady_state(&network, inputs, parameters)?;
        }
        Err(GridError::Loads { residual: change })
    }

    /// Brings everything that can be read in line with the inputs: V and omega follow their setpoints at
    /// once, bus voltages and tie flow the loads and the breaker too; P, Q, E are states.
    pub fn refresh(&mut self) -> Result<(), GridError> {
        self.bring_in_line()?;
        self.readout.get_mut().valid = false;
        // Voltages of impedance loads always exist; others are looked for while an error can be told.
        if self.load_model.is_linear() { Ok(()) } else { self.read(&mut self.readout.borrow_mut()) }
    }

    /// Advances by `duration_ns` with the inputs held; allocates nothing. On failure the state is as
    /// before. A duration of 0 changes nothing.
    pub fn step(&mut self, start_ns: i64, duration_ns: i64) -> Result<(), GridError> {
        self.check_step(duration_ns)?;
        if duration_ns == 0 {
            self.readout.get_mut().valid = false;
            return Ok(());
        }
        let state = &mut self.state;
        state.write_to(&mut self.y);
        self.workspace.restart();
        let mut grid = Grid {
            network: &self.network,
            workspace: &mut self.workspace,
            inputs: &state.inputs,
            parameters: &state.parameters,
            omega_b: self.omega_b,
        };
        self.effort = self
            .integrator
            .advance(&mut grid, &mut self.y, &mut state.internal_step_s, duration_ns as f64 * 1e-9)
            .map_err(|failure| failure.of_step(start_ns))?;
        state.take_from(&self.y);
        self.readout.get_mut().valid = false;
        Ok(())
    }

    /// Whether a step may be taken; brings the network in line with the inputs.
    pub(super) fn check_step(&mut self, duration_ns: i64) -> Result<(), GridError> {
        if !self.state.initialised {
            return Err(GridError::Misuse { what: "step", why: "the model is not initialised" });
        }
        if duration_ns < 0 {
            return Err(GridError::Misuse { what: "step", why: "the duration is negative" });
        }
        self.bring_in_line()
    }

    /// The present state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Takes over a state of this model; nothing changes when it does not fit.
    pub fn set_state(&mut self, state: &State) -> Result<(), GridError> {
        state.validate(self.n(), self.n_bus(), self.plant.tie.is_some())?;
        self.in_line = false;
        if let Err(refused) = self.network.update(&conditions(state)) {
            // Back to the network of the state that stays, if it had one.
            let _ = self.bring_in_line();
            return Err(refused);
        }
        self.state.clone_from(state);
        self.readout.get_mut().valid = false;
        Ok(())
    }

    /// Measured active power of BESS `i` (from 0), pu; (1).
    pub fn P(&self, i: usize) -> f64 {
        self.state.P[i]
    }

    /// Measured reactive power of BESS `i` (from 0), pu, positive inductive; (2).
    pub fn Q(&self, i: usize) -> f64 {
        self.state.Q[i]
    }

    /// Energy of BESS `i` (from 0), pu*h; (5).
    pub fn E(&self, i: usize) -> f64 {
        self.state.E[i]
    }

    /// Voltage of the source of BESS `i` (from 0), pu; (3), follows its setpoints at once.
    pub fn V(&self, i: usize) -> f64 {
        let (u, k) = (&self.state.inputs, &self.state.parameters);
        voltage(u.V_set[i], k.K_Q[i], self.state.Q[i], u.Q_set[i])
    }

    /// Frequency of BESS `i` (from 0), pu; (3), follows its setpoints at once.
    pub fn omega(&self, i: usize) -> f64 {
        let (u, k) = (&self.state.inputs, &self.state.parameters);
        omega(u.omega_set[i], k.K_P[i], self.state.P[i], u.P_set[i])
    }

    /// Voltage magnitude of the bus at position `b` (from 0), pu; 0 at an isolated bus.
    #[inline]
    pub fn bus_V(&self, b: usize) -> f64 {
        self.up_to_date(|readout| readout.vm[b])
    }

    /// Voltage angle of the bus at position `b` (from 0), rad in [-pi, pi], against a frame at nominal
    /// frequency in which the main grid stands at 0.
    #[inline]
    pub fn bus_angle(&self, b: usize) -> f64 {
        self.up_to_date(|readout| readout.va[b])
    }

    /// Active power through the tie, pu, positive from the main grid into the network.
    pub fn tie_P(&self) -> f64 {
        self.up_to_date(|readout| readout.tie.0)
    }

    /// Reactive power through the tie, pu, positive from the main grid into the network, measured at the
    /// network's bus (behind the tie's reactance).
    pub fn tie_Q(&self) -> f64 {
        self.up_to_date(|readout| readout.tie.1)
    }

    /// What the last step cost.
    pub fn effort(&self) -> Effort {
        self.effort
    }

    /// Whether the network is solved through the dense reduced matrix.
    pub fn is_dense(&self) -> bool {
        self.network.is_dense()
    }

    fn bring_in_line(&mut self) -> Result<(), GridError> {
        if !self.in_line {
            self.check_inputs()?;
            self.network.update(&conditions(&self.state))?;
            self.in_line = true;
        }
        Ok(())
    }

    fn check_inputs(&self) -> Result<(), GridError> {
        self.state.inputs.validate(self.n(), self.n_bus(), self.plant.tie.is_some())
    }

    #[inline]
    fn up_to_date<T>(&self, get: impl FnOnce(&Readout) -> T) -> T {
        if !self.readout.borrow().valid {
            self.read_late();
        }
        get(&self.readout.borrow())
    }

    #[cold]
    fn read_late(&self) {
        // After a refresh or a step that succeeded this cannot fail; the values before stay otherwise.
        let _ = self.read(&mut self.readout.borrow_mut());
    }

    fn read(&self, readout: &mut Readout) -> Result<(), GridError> {
        if readout.valid {
            return Ok(());
        }
        Arch::new().dispatch(Read { model: self, readout: &mut *readout })?;
        readout.tie = self.network.tie_power(&readout.workspace.v);
        readout.valid = true;
        Ok(())
    }
}

/// Makes the bus voltages; compiled for each kind of processor.
struct Read<'a> {
    model: &'a GridModel,
    readout: &'a mut Readout,
}

impl NullaryFnOnce for Read<'_> {
    type Output = Result<(), GridError>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Self { model, readout } = self;
        let ws = &mut readout.workspace;
        ws.restart();
        ws.set_sources((0..model.n()).map(|i| model.V(i)), &model.state.delta);
        model.network.voltages(ws)?;
        polar(&ws.v, &mut readout.vm, &mut readout.va);
        Ok(())
    }
}

pub(super) fn conditions(state: &State) -> Conditions<'_> {
    Conditions {
        dP_load: &state.inputs.dP_load,
        dQ_load: &state.inputs.dQ_load,
        X_c: &state.parameters.X_c,
        tie_closed: state.inputs.tie_closed,
    }
}

impl Failure {
    /// A failure of the step that began at `start_ns`.
    pub(super) fn of_step(self, start_ns: i64) -> GridError {
        let start_s = start_ns as f64 * 1e-9;
        GridError::Step { start_s, offset_s: self.offset_s, step_s: self.step_s, reason: self.reason }
    }
}

//! A step whose inputs move in straight lines. The integrator sees them at every stage: setpoints directly, load
//! changes through the network made anew for them. Time is one more component of the state, at rate 1.

use super::dynamics::{Grid, RUN_AWAY_PU};
use super::error::GridError;
use super::integrator::{Dynamics, Integrator};
use super::model::{GridModel, conditions};
use super::network::{Conditions, Network};
use super::state::{Inputs, Parameters};
use super::workspace::Workspace;

/// Memory for steps whose inputs move; made by the first one.
#[derive(Clone)]
pub(super) struct Memory {
    integrator: Integrator,
    /// [delta | P | Q | E | time since the step began].
    y: Vec<f64>,
    /// The inputs at some time within the step.
    now: Inputs,
}

/// The grid with its inputs moving.
struct Ramped<'a> {
    network: &'a mut Network,
    workspace: &'a mut Workspace,
    start: &'a Inputs,
    rates: &'a Inputs,
    now: &'a mut Inputs,
    parameters: &'a Parameters,
    omega_b: f64,
    /// Whether loads move.
    loads: bool,
}

impl Ramped<'_> {
    /// u(t) = u_0 + du t.
    fn move_inputs(&mut self, t_s: f64) {
        let (start, rates, now) = (self.start, self.rates, &mut *self.now);
        for (now, start, rates) in [
            (&mut now.omega_set, &start.omega_set, &rates.omega_set),
            (&mut now.V_set, &start.V_set, &rates.V_set),
            (&mut now.P_set, &start.P_set, &rates.P_set),
            (&mut now.Q_set, &start.Q_set, &rates.Q_set),
            (&mut now.dP_load, &start.dP_load, &rates.dP_load),
            (&mut now.dQ_load, &start.dQ_load, &rates.dQ_load),
        ] {
            for (now, (start, rate)) in now.iter_mut().zip(start.iter().zip(rates)) {
                *now = start + rate * t_s;
            }
        }
    }
}

impl Dynamics for Ramped<'_> {
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) -> bool {
        let (Some((&t_s, y)), Some((rate, dy))) = (y.split_last(), dy.split_last_mut()) else { return false };
        *rate = 1.0;
        self.move_inputs(t_s);
        if self.loads {
            let now = Conditions {
                dP_load: &self.now.dP_load,
                dQ_load: &self.now.dQ_load,
                X_c: &self.parameters.X_c,
                tie_closed: self.start.tie_closed,
            };
            if self.network.update(&now).is_err() {
                return false;
            }
        }
        let mut grid = Grid {
            network: self.network,
            workspace: self.workspace,
            inputs: self.now,
            parameters: self.parameters,
            omega_b: self.omega_b,
        };
        grid.derivative(y, dy)
    }

    fn scale(&self, k: usize, value: f64) -> f64 {
        // As of the grid with its inputs held; time is exact.
        if k < self.start.omega_set.len() || k == 4 * self.start.omega_set.len() { 1.0 } else { value }
    }

    fn plausible(&self, y: &[f64]) -> bool {
        let n = self.start.omega_set.len();
        y[n..3 * n].iter().all(|x| x.abs() < RUN_AWAY_PU)
    }
}

impl GridModel {
    /// [`GridModel::step`] with every input moving at its rate, per s, from where it is; the inputs themselves stay
    /// as they are. Allocates the first time.
    pub fn step_ramped(&mut self, start_ns: i64, duration_ns: i64, rates: &Inputs) -> Result<(), GridError> {
        self.check_step(duration_ns)?;
        rates.validate(self.n(), self.n_bus(), true)?;
        let n = self.n();
        let (relative, absolute) = self.integrator.tolerances();
        let memory = self.ramp.get_or_insert_with(|| {
            Box::new(Memory {
                integrator: Integrator::new(4 * n + 1, relative, absolute),
                y: vec![0.0; 4 * n + 1],
                now: self.state.inputs.clone(),
            })
        });
        let state = &mut self.state;
        state.write_to(&mut memory.y);
        memory.y[4 * n] = 0.0;
        memory.now.tie_closed = state.inputs.tie_closed;
        self.workspace.restart();
        let mut grid = Ramped {
            network: &mut self.network,
            workspace: &mut self.workspace,
            start: &state.inputs,
            rates,
            now: &mut memory.now,
            parameters: &state.parameters,
            omega_b: self.omega_b,
            loads: rates.dP_load.iter().chain(&rates.dQ_load).any(|rate| *rate != 0.0),
        };
        let duration_s = duration_ns as f64 * 1e-9;
        let outcome =
            memory.integrator.advance(&mut grid, &mut memory.y, &mut state.internal_step_s, duration_s);
        self.readout.get_mut().valid = false;
        // Back from some moment within the step, whatever came of it.
        let back = self.network.update(&conditions(state));
        self.in_line = back.is_ok();
        self.effort = outcome.map_err(|failure| failure.of_step(start_ns))?;
        back?;
        state.take_from(&memory.y);
        Ok(())
    }
}

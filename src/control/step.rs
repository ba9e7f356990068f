//! What a step does after the evaluation: integrate the setpoints, set the exchange, advance the
//! estimator, remember the sample. Allocates nothing.

use super::config::VoltagePolicy;
use super::controller::Controller;
use super::estimator;
use super::lag::Lag;
use super::state::{Clock, State};
use super::time::seconds;

impl Controller {
    /// Advances from the evaluation at `start_ns` by `duration_ns`.
    pub(super) fn advance(&mut self, start_ns: i64, duration_ns: i64) {
        self.learn();
        self.remember_before();
        // What is remembered of this sample are the transfers before the step.
        self.scratch.transfers.copy_from_slice(&self.state.transfers);
        if self.state.adopted.enable {
            self.integrate(duration_ns);
        }
        let (state, scratch) = (&mut self.state, &self.scratch);
        state.filtered.copy_from_slice(&scratch.filtered);
        state.received_ns.copy_from_slice(&scratch.received_ns);
        state.shares.copy_from_slice(&scratch.shares);
        state.followed.copy_from_slice(&scratch.followed);
        state.authority.copy_from_slice(&scratch.authority);
        for (owed, next) in state.owed.iter_mut().zip(&scratch.owed) {
            owed.copy_from_slice(next);
        }
        state.history.push(start_ns, scratch.told(), &state.transfers);
        state.transfers.copy_from_slice(&scratch.transfers);
        self.remember_told();
        self.tell_outside(true);
        self.tick(start_ns, duration_ns);
    }

    /// What is left to do after a sweep that moved the setpoints.
    pub(super) fn pass(&mut self, start_ns: i64, duration_ns: i64) {
        self.state.fades.pass(duration_ns, &self.network);
        self.tick(start_ns, duration_ns);
    }

    /// What a step begins with, where it may have to be taken back.
    pub(super) fn remember_before(&mut self) {
        if self.fixed.across.is_some() {
            let State { before, flows, transfers, held, .. } = &mut self.state;
            before.flows.clone_from(flows);
            before.transfers.clone_from(transfers);
            held.iter_mut().for_each(|link| link.before = link.flow);
        }
    }

    fn tick(&mut self, start_ns: i64, duration_ns: i64) {
        self.state.clock = Clock {
            now_ns: start_ns.saturating_add(duration_ns),
            sampled_ns: start_ns,
            step_ns: duration_ns,
            samples: self.state.clock.samples.saturating_add(1),
        };
    }

    /// How late the measurements of this step are, from the setpoints before it moves them.
    fn learn(&mut self) {
        let State { inputs, parameters, outputs, lags, clock, .. } = &mut self.state;
        let (live, compare) = (&self.topology.live, clock.samples > 0);
        lags.frequency.observe(
            (live, compare),
            (&inputs.omega, &outputs.omega_set),
            (&parameters.K_P, &inputs.P, &outputs.P_set),
        );
        lags.voltage.observe(
            (live, compare),
            (&inputs.V, &outputs.V_set),
            (&parameters.K_Q, &inputs.Q, &outputs.Q_set),
        );
    }

    /// d omega_set/dt = u_omega, dV_set/dt = u_V (5); P_set from the exchange; vbar from its flows.
    fn integrate(&mut self, h_ns: i64) {
        let h_s = seconds(h_ns);
        let average = self.flow(self.state.parameters.gain_V, &self.state.lags.voltage, h_s);
        let across = self.flow(self.state.parameters.gain_V, &Lag::new(&[]), h_s);
        let (state, scratch, live) = (&mut self.state, &self.scratch, &self.topology.live);
        let outputs = &mut state.outputs;
        for i in 0..live.len() {
            if live[i] && scratch.frozen.get(i) != Some(&true) {
                outputs.omega_set[i] += h_s * outputs.u_omega[i];
                outputs.V_set[i] += h_s * outputs.u_V[i];
            }
        }
        for i in (0..live.len()).filter(|&i| live[i] || self.fixed.lost_link_fade_s.is_some()) {
            outputs.P_set[i] = scratch.P_set[i];
        }
        state.flows.copy_from_slice(&scratch.flows);
        for k in 0..self.state.held.len() {
            self.state.held[k].flow = self.carries(&self.state.held[k], h_ns);
            if self.fades_now(&self.state.held[k]) {
                self.state.held[k].left_ns = (self.state.held[k].left_ns - h_ns).max(0);
            }
        }
        let (state, scratch) = (&mut self.state, &mut self.scratch);
        state.fades.pass(h_ns, &self.network);
        // Where a ramp is slower than the fade, some still carry something.
        state.held.retain(|link| link.left_ns > 0 || link.flow != 0.0);
        if state.parameters.voltage_policy == VoltagePolicy::Average {
            let mut after = std::mem::take(&mut scratch.transfers);
            let (history, signals, before) = (&state.history, scratch.told(), &state.transfers);
            let flows = [&average, &across];
            estimator::advance(&self.network, history, signals, flows, h_ns, before, &mut after);
            scratch.transfers = after;
        }
    }
}

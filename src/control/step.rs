//! What a step does after the evaluation: integrate the setpoints, set the exchange, advance the
//! estimator, remember the sample. Allocates nothing.

use super::config::VoltagePolicy;
use super::controller::Controller;
use super::estimator;
use super::exchange::setpoints;
use super::state::Clock;
use super::time::seconds;

impl Controller {
    /// Advances from the evaluation at `start_ns` by `duration_ns`.
    pub(super) fn advance(&mut self, start_ns: i64, duration_ns: i64) {
        let h_s = seconds(duration_ns);
        if self.state.adopted.enable {
            self.integrate(h_s);
        }
        let (state, scratch) = (&mut self.state, &self.scratch);
        state.filtered.copy_from_slice(&scratch.filtered);
        state.received_ns.copy_from_slice(&scratch.received_ns);
        state.history.push(start_ns, &scratch.signals);
        state.clock = Clock {
            now_ns: start_ns.saturating_add(duration_ns),
            sampled_ns: start_ns,
            step_ns: duration_ns,
            samples: state.clock.samples + 1,
        };
    }

    /// d omega_set/dt = u_omega, dV_set/dt = u_V (5); P_set from the exchange; vbar from its flows.
    fn integrate(&mut self, h_s: f64) {
        let average = self.flow(self.state.parameters.gain_V, h_s);
        let (state, scratch, live) = (&mut self.state, &self.scratch, &self.topology.live);
        let outputs = &mut state.outputs;
        for i in 0..live.len() {
            if live[i] {
                outputs.omega_set[i] += h_s * outputs.u_omega[i];
                outputs.V_set[i] += h_s * outputs.u_V[i];
            }
        }
        state.flows.copy_from_slice(&scratch.flows);
        match self.fixed.lost_link_fade_s {
            None => setpoints(&self.network, &state.flows, &state.held, |i| live[i], &mut outputs.P_set),
            Some(fade_s) => {
                let share = (-h_s / fade_s).exp();
                state.held.iter_mut().for_each(|link| link.flow *= share);
                setpoints(&self.network, &state.flows, &state.held, |_| true, &mut outputs.P_set);
            }
        }
        if state.parameters.voltage_policy == VoltagePolicy::Average {
            let (history, signals) = (&state.history, &scratch.signals);
            estimator::advance(&self.network, history, signals, &average, h_s, &mut state.transfers);
        }
    }
}

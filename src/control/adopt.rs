//! What a change of availability, topology or parameters does to the graph in force, the state per edge
//! and the eigenvalues. Runs between steps; this is where memory is allocated.

use super::certificates::{FixedTime, settling_time, weight_exponents};
use super::config::{Law, VoltagePolicy};
use super::controller::Controller;
use super::event::Event;
use super::exchange::{carry_over, carry_over_or, hand_over};
use super::network::Network;
use super::spectrum::{Eigenvalue, Method, smallest};
use super::state::Before;
use super::time::nanoseconds;
use super::topology::Topology;
use super::wave::Wave;

/// The eigenvalues of the graph in force, and what they were computed for.
#[derive(Clone, Debug, Default)]
pub struct Spectrum {
    /// Of the law of u_P: lambda_2, or with dispatch the smallest eigenvalue with pins.
    pub P: Tie,
    /// Of the law of u_omega: the smallest eigenvalue with pins.
    pub omega: Tie,
    /// lambda_2 of the weights (g_P w_ij)^(2/(1+eta)).
    pub lambda_2: f64,
    tuning: Option<Tuning>,
}

/// How strongly a graph ties its agents together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tie {
    /// Eigenvalue of the weights (g w)^(2/(1+eta)), 1/s^(2/(1+eta)).
    pub lambda: Eigenvalue,
    /// What the fixed-time law needs besides.
    pub fixed_time: Option<FixedTime>,
}

impl Default for Tie {
    fn default() -> Self {
        Self { lambda: Eigenvalue { value: 0.0, method: Method::Dense }, fixed_time: None }
    }
}

impl Tie {
    /// Certified time to go from an error of this norm, s.
    pub fn settling_time(&self, error_norm: f64, eta: f64) -> f64 {
        match &self.fixed_time {
            None => settling_time(error_norm, self.lambda.value, eta),
            Some(fixed) => fixed.settling_time(error_norm, eta),
        }
    }
}

/// The parameters and inputs that eigenvalues and delays follow.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Tuning {
    eta: f64,
    gain_P: f64,
    gain_omega: f64,
    delay: f64,
    dispatch: bool,
}

impl Controller {
    /// Takes over discrete inputs and parameters where they have changed.
    /// `changed` says that the graph has for another reason.
    pub(super) fn adopt(&mut self, mut changed: bool, events: &mut dyn FnMut(Event)) {
        let (inputs, adopted) = (&self.state.inputs, &mut self.state.adopted);
        if adopted.enable != inputs.enable {
            adopted.enable = inputs.enable;
            self.state.fades.begin(nanoseconds(self.fixed.exchange_fade_s));
            events(if inputs.enable { Event::Enabled } else { Event::Disabled });
        }
        if adopted.asked != inputs.topology {
            adopted.asked = inputs.topology;
            let count = self.topologies.count();
            match usize::try_from(i64::from(inputs.topology) - 1) {
                Ok(k) if k < count => {
                    let switched = adopted.topology != k;
                    changed |= switched;
                    adopted.topology = k;
                    if switched {
                        events(Event::TopologySwitched { topology: inputs.topology });
                    }
                }
                _ => {
                    let kept = adopted.topology as i32 + 1;
                    events(Event::TopologyUnknown { asked: inputs.topology, count, kept });
                }
            }
        }
        // Of many agents mostly none has come or gone.
        if adopted.available != inputs.available {
            for (i, (was, &is)) in adopted.available.iter_mut().zip(&inputs.available).enumerate() {
                if *was != is {
                    *was = is;
                    changed = true;
                    events(if is {
                        Event::AgentJoined { agent: i + 1 }
                    } else {
                        Event::AgentLeft { agent: i + 1 }
                    });
                }
            }
        }
        if changed {
            let before = std::mem::take(&mut self.network);
            let topology = self.rebuild();
            self.carry(&before);
            self.announce(&topology, events);
        }
        if self.spectrum.tuning != Some(self.tuning()) {
            self.tune();
        }
    }

    /// Makes network and scratch for the adopted inputs; returns the topology that was in force. What the
    /// state holds per edge is not touched.
    pub(super) fn rebuild(&mut self) -> Topology {
        let adopted = &self.state.adopted;
        let built = self.fixed.across.as_ref().and_then(|across| self.part_topology(across));
        let (mut topology, hops) = built
            .unwrap_or_else(|| (self.topologies.build(adopted.topology, &adopted.available), Vec::new()));
        self.scratch.hops = hops;
        let graph = std::mem::take(&mut topology.graph);
        self.network = Network::new(graph).sorting_out(self.fixed.outlier_filter);
        self.surround();
        self.scratch.wave = Wave::new(&self.network);
        self.scratch.roster.expire();
        let edges = self.network.graph.edges().len();
        self.scratch.flows = vec![0.0; edges];
        self.scratch.transfers = vec![0.0; edges];
        let keeps_times = self.fixed.channel.keeps_times(self.fixed.silence_ns);
        self.scratch.received_ns = vec![i64::MIN; if keeps_times { 2 * edges } else { 0 }];
        self.state.outputs.cluster.copy_from_slice(&topology.cluster);
        self.spectrum.tuning = None;
        std::mem::replace(&mut self.topology, topology)
    }

    fn carry(&mut self, before: &Network) {
        self.carry_fades(before);
        let state = &mut self.state;
        let (both, fade_ns) = ((before, &self.network), nanoseconds(self.fixed.exchange_fade_s));
        let began = std::mem::take(&mut state.before.flows);
        state.flows = hand_over(&mut state.held, both, (&state.flows, &began), fade_ns);
        if self.fixed.across.is_some() {
            let began = (&began, &state.before.transfers);
            state.before = Before {
                flows: carry_over_or(before, &self.network, began.0, &state.flows),
                transfers: carry_over(before, &self.network, 1, began.1, 0.0),
            };
        }
        state.transfers = if state.transfers.is_empty() {
            vec![0.0; self.network.graph.edges().len()]
        } else {
            carry_over(before, &self.network, 1, &state.transfers, 0.0)
        };
        state
            .history
            .carry_transfers(|per_edge, past| carry_over(before, &self.network, per_edge, past, 0.0));
        state.received_ns = match carry_over(before, &self.network, 2, &state.received_ns, i64::MIN) {
            kept if kept.is_empty() => self.scratch.received_ns.clone(),
            kept => kept,
        };
    }

    fn announce(&self, before: &Topology, events: &mut dyn FnMut(Event)) {
        let now = &self.topology;
        for &leader in now.leaders.iter().filter(|leader| !before.leaders.contains(leader)) {
            events(Event::LeaderElected { agent: leader + 1, cluster: now.cluster[leader] });
        }
        if now.parts == before.parts {
            return;
        }
        let parts = now.parts.count();
        if parts > 1 {
            events(Event::GraphInParts { parts });
        } else if before.parts.count() > 1 {
            events(Event::GraphWhole);
        }
        for number in (0..parts).filter(|&p| !now.parts.pinned[p]) {
            events(Event::PartHolds { agent: now.parts.first(number).unwrap_or(0) + 1 });
        }
    }

    fn tuning(&self) -> Tuning {
        let (parameters, inputs) = (&self.state.parameters, &self.state.inputs);
        Tuning {
            eta: parameters.eta,
            gain_P: parameters.gain_P,
            gain_omega: parameters.gain_omega,
            delay: parameters.delay,
            dispatch: inputs.dispatch,
        }
    }

    /// Brings delays, eigenvalues and the room for the past in line with parameters and graph.
    fn tune(&mut self) {
        self.tune_network();
        let (horizon_ns, edges) = self.past_needed();
        self.state.history.reach(horizon_ns);
        self.state.history.keep_transfers(edges);
    }

    /// After a state was taken over: the same without a change of that state. Where it was saved between a new
    /// parameter and the refresh that makes room for it, the next refresh tunes again.
    pub(super) fn tune_to_state(&mut self) {
        self.tune_network();
        let (horizon_ns, edges) = self.past_needed();
        if !self.state.history.has_room(horizon_ns, edges) {
            self.spectrum.tuning = None;
        }
    }

    /// How far back values are looked up, ns, and of how many edges the past transfers are.
    fn past_needed(&self) -> (i64, usize) {
        let across_ns = self.part().map_or(0, |part| nanoseconds(part.step_s));
        let longest_ns = self.network.longest_delay_ns().max(across_ns);
        let horizon_ns = longest_ns.saturating_add(self.fixed.channel.horizon_ns());
        let averages = self.state.parameters.voltage_policy == VoltagePolicy::Average;
        (horizon_ns, if averages { self.network.graph.edges().len() } else { 0 })
    }

    fn tune_network(&mut self) {
        let tuning = self.tuning();
        self.network.set_delay(nanoseconds(tuning.delay), &self.fixed.channel, self.fixed.silence_ns);
        if self.spectrum.tuning == Some(tuning) {
            return;
        }
        self.spectrum = Spectrum {
            P: self.tie(tuning.gain_P, tuning.eta, tuning.dispatch),
            omega: self.tie(tuning.gain_omega, tuning.eta, true),
            lambda_2: 0.0,
            tuning: Some(tuning),
        };
        self.spectrum.lambda_2 = if tuning.dispatch {
            self.tie(tuning.gain_P, tuning.eta, false).lambda.value
        } else {
            self.spectrum.P.lambda.value
        };
    }

    fn tie(&self, gain: f64, eta: f64, pinned: bool) -> Tie {
        if self.fixed.across.is_some() {
            // Eigenvalues are those of the whole graph, which nobody here knows.
            return Tie::default();
        }
        let (graph, live) = (&self.network.graph, &self.topology.live);
        let (low, high) = weight_exponents(self.fixed.law, eta);
        let lambda = smallest(graph, live, gain, low, pinned);
        let fixed_time = match (self.fixed.law, high) {
            (Law::FixedTime { alpha, beta }, Some(high)) => Some(FixedTime {
                factors: (alpha, beta),
                lambda_low: lambda.value,
                lambda_high: smallest(graph, live, gain, high, pinned).value,
                links: (graph.edges().len() + if pinned { self.network.pins.len() } else { 0 }) as f64,
            }),
            _ => None,
        };
        Tie { lambda, fixed_time }
    }
}

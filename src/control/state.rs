//! Everything that inputs, parameters and steps change: what a rollback must bring back. Checked before it
//! is taken over, because it may come from another process.

use super::authority::Authority;
use super::controller::Scratch;
use super::delay::{History, QUANTITIES};
use super::error::{ConfigError, Problems};
use super::exchange::HeldLink;
use super::fade::Left;
use super::io::{Inputs, Outputs, Parameters};
use super::lag::Lag;
use super::messages::Standing;
use serde::{Deserialize, Serialize};

/// The state of a controller; made and read by [`super::Controller`] only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    pub(super) inputs: Inputs,
    pub(super) parameters: Parameters,
    pub(super) outputs: Outputs,
    /// The inputs that the graph in force was built for.
    pub(super) adopted: Adopted,
    pub(super) clock: Clock,
    pub(super) history: History,
    /// Filtered omega, p, V, q, SoC of the last sample; empty without filters.
    pub(super) filtered: Vec<f64>,
    /// f_ij of the last step, by edge.
    pub(super) flows: Vec<f64>,
    /// z_ij of the estimator, by edge.
    pub(super) transfers: Vec<f64>,
    /// Times of the last messages, two per edge; empty while no message is late or lost.
    pub(super) received_ns: Vec<i64>,
    pub(super) held: Vec<HeldLink>,
    pub(super) lags: Lags,
    /// Time left of the fades of the exchange.
    pub(super) fades: Left,
    /// What the last step began with.
    pub(super) before: Before,
    /// Share of the load, and P_set as the power follows it, by agent, pu; empty where no limit asks for them.
    pub(super) shares: Vec<f64>,
    pub(super) followed: Vec<f64>,
    /// x_i of p and of q, by agent, pu; empty without limits on power.
    pub(super) owed: [Vec<f64>; 2],
    /// Of V_set over Q, by agent; empty without limits on power.
    pub(super) authority: Vec<Authority>,
    /// What was told last, quantity by quantity and agent by agent; empty without faults of messages.
    pub(super) told: Vec<f64>,
}

/// Flows and transfers that a step began with, by edge, to take it back; empty where nobody would.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Before {
    pub flows: Vec<f64>,
    pub transfers: Vec<f64>,
}

/// How late the measurements are, by droop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Lags {
    pub frequency: Lag,
    pub voltage: Lag,
}

impl Lags {
    /// Before the first step, from outputs without power references.
    pub fn start(outputs: &Outputs) -> Self {
        Self { frequency: Lag::new(&outputs.omega_set), voltage: Lag::new(&outputs.V_set) }
    }
}

/// The discrete inputs that are in force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Adopted {
    pub enable: bool,
    pub available: Vec<bool>,
    /// From 0.
    pub topology: usize,
    /// The number asked for when it was last looked at.
    pub asked: i32,
    /// How one's own agents with neighbours in other parts, and those, told that they stand; empty without.
    pub own: Standing,
    pub remote: Standing,
}

impl Adopted {
    /// What the graph in force was built for: the topology, from 0, and who is available.
    pub fn graph(&self) -> (usize, &[bool], &Standing, &Standing) {
        (self.topology, &self.available, &self.own, &self.remote)
    }
}

/// Where the controller is in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Clock {
    /// End of the last step, ns.
    pub now_ns: i64,
    /// Time of the last sample, the beginning of the last step, ns.
    pub sampled_ns: i64,
    /// Length of the last step, ns; 0 before the first.
    pub step_ns: i64,
    /// Number of samples taken.
    pub samples: u64,
}

impl State {
    /// Whether this state fits a controller of `n` agents with `topologies` topologies and the working arrays
    /// of `scratch`, all finite. The numbers per edge are checked against the graph by the controller.
    pub(super) fn check(&self, n: usize, topologies: usize, scratch: &Scratch) -> Result<(), ConfigError> {
        let mut problems = Problems::default();
        self.parameters.check(n, &mut problems);
        let (inputs, outputs) = (&self.inputs, &self.outputs);
        for (path, values) in [
            ("inputs.P", &inputs.P),
            ("inputs.Q", &inputs.Q),
            ("inputs.V", &inputs.V),
            ("inputs.omega", &inputs.omega),
            ("inputs.E", &inputs.E),
            ("outputs.omega_set", &outputs.omega_set),
            ("outputs.V_set", &outputs.V_set),
            ("outputs.P_set", &outputs.P_set),
            ("outputs.Q_set", &outputs.Q_set),
            ("outputs.u_omega", &outputs.u_omega),
            ("outputs.u_P", &outputs.u_P),
            ("outputs.u_E", &outputs.u_E),
            ("outputs.u_V", &outputs.u_V),
            ("outputs.u_Q", &outputs.u_Q),
        ] {
            finite(&mut problems, path, values, n);
        }
        let diagnostics =
            [outputs.spread_P, outputs.spread_Q, outputs.spread_E, outputs.error_omega, outputs.error_V];
        finite(&mut problems, "outputs.spread_P, spread_Q, spread_E, error_omega, error_V", &diagnostics, 5);
        for (path, x) in [("lambda_2", outputs.lambda_2), ("T_P", outputs.T_P), ("T_omega", outputs.T_omega)]
        {
            if x.is_nan() {
                problems.add(format!("outputs.{path}"), x, "a number");
            }
        }
        let scalars = [inputs.omega_ref, inputs.V_ref, inputs.P_ref];
        finite(&mut problems, "inputs.omega_ref, V_ref, P_ref", &scalars, 3);
        for (path, found) in [
            ("inputs.available", inputs.available.len()),
            ("adopted.available", self.adopted.available.len()),
            ("outputs.cluster", outputs.cluster.len()),
            ("outputs.saturated", outputs.saturated.len()),
        ] {
            length(&mut problems, path, found, n);
        }
        finite(&mut problems, "filtered", &self.filtered, scratch.filtered.len());
        finite(&mut problems, "shares", &self.shares, scratch.shares.len());
        finite(&mut problems, "followed", &self.followed, scratch.followed.len());
        for ((path, owed), working) in
            ["owed of p", "owed of q"].into_iter().zip(&self.owed).zip(&scratch.owed)
        {
            finite(&mut problems, path, owed, working.len());
        }
        finite(&mut problems, "told", &self.told, QUANTITIES * scratch.mute.len());
        length(&mut problems, "authority", self.authority.len(), scratch.authority.len());
        if let Some(i) = self.authority.iter().position(|a| !a.is_sound()) {
            problems.add(
                format!("authority[{i}]"),
                format!("{:?}", self.authority[i]),
                "a share in [0.01, 1]",
            );
        }
        finite(&mut problems, "flows", &self.flows, self.flows.len());
        finite(&mut problems, "transfers", &self.transfers, self.transfers.len());
        if self.adopted.topology >= topologies {
            problems.add("adopted.topology", self.adopted.topology, format!("below {topologies}"));
        }
        inputs.remote.check("inputs.remote", scratch.slots, &mut problems);
        outputs.local.check("outputs.local", scratch.tellers, &mut problems);
        for (standing, count) in [(&self.adopted.own, scratch.tellers), (&self.adopted.remote, scratch.slots)]
        {
            standing.check("adopted", count, &mut problems);
        }
        if self.clock.step_ns < 0 {
            problems.add("clock.step_ns", self.clock.step_ns, "not negative");
        }
        if !self.history.fits(n) {
            problems.add("history", "arrays that do not fit", format!("finite samples of {n} agents"));
        }
        for (k, link) in self.held.iter().enumerate() {
            let numbers = link.flow.is_finite() && link.before.is_finite() && link.left_ns >= 0;
            let fits = link.a < link.b && (link.b as usize) < n && numbers;
            if !fits {
                problems.add(format!("held[{k}]"), format!("{link:?}"), format!("a link among {n} agents"));
            }
        }
        self.lags.frequency.check(n, "lags.frequency", &mut problems);
        self.lags.voltage.check(n, "lags.voltage", &mut problems);
        problems.into_result()
    }

    /// Whether the numbers per edge fit a graph with `edges` edges.
    pub(super) fn check_edges(
        &self,
        (edges, received): (usize, usize),
        parts: bool,
    ) -> Result<(), ConfigError> {
        let mut problems = Problems::default();
        length(&mut problems, "flows", self.flows.len(), edges);
        length(&mut problems, "transfers", self.transfers.len(), edges);
        if !self.fades.fits(edges) {
            problems.add("fades", format!("{:?}", self.fades), format!("times of {edges} edges"));
        }
        if parts {
            finite(&mut problems, "before.flows", &self.before.flows, edges);
            finite(&mut problems, "before.transfers", &self.before.transfers, edges);
        }
        length(&mut problems, "received_ns", self.received_ns.len(), received);
        if !self.history.transfers_fit(edges) {
            problems.add("history", "transfers that do not fit", format!("finite ones of {edges} edges"));
        }
        problems.into_result()
    }
}

pub(super) fn length(problems: &mut Problems, path: &str, found: usize, expected: usize) {
    if found != expected {
        problems.add(
            path,
            format!("{found} values"),
            format!("{expected}: the state of the same controller"),
        );
    }
}

pub(super) fn finite(problems: &mut Problems, path: &str, values: &[f64], expected: usize) {
    length(problems, path, values.len(), expected);
    if let Some((i, x)) = values.iter().enumerate().find(|(_, x)| !x.is_finite()) {
        problems.add(format!("{path}[{i}]"), x, "a finite number");
    }
}

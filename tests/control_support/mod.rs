//! The agent model (5)-(6) as a plant, random graphs, a small generator and reference data, for the tests
//! of the control room.
#![allow(dead_code, non_snake_case, clippy::unwrap_used, clippy::panic)]

use bess_consensus::control::communication::{
    Communication, Explicit, ExplicitEdge, ExplicitPin, ExplicitTopology, Inside, StepByStep,
    StepByStepTopology, Weights,
};
use bess_consensus::control::{Config, Controller};
use serde::Deserialize;

/// The generator of the tests: xorshift64* (Vigna 2016).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// Uniform in [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in low..=high.
    pub fn integer(&mut self, low: usize, high: usize) -> usize {
        low + (self.next() % (high - low + 1) as u64) as usize
    }

    pub fn values(&mut self, n: usize, low: f64, high: f64) -> Vec<f64> {
        (0..n).map(|_| self.within(low, high)).collect()
    }
}

pub fn explicit(edges: Vec<ExplicitEdge>, pins: Vec<ExplicitPin>) -> Communication {
    Communication::Explicit(Explicit {
        topologies: vec![ExplicitTopology {
            name: "test".into(),
            edges,
            pins,
            clusters: None,
            leaders: None,
        }],
    })
}

/// An edge between agents counted from 0.
pub fn edge(a: usize, b: usize, weight: f64) -> ExplicitEdge {
    ExplicitEdge { a: a as u32 + 1, b: b as u32 + 1, weight, delay_s: None }
}

/// A pin of an agent counted from 0.
pub fn pin(agent: usize, weight: f64) -> ExplicitPin {
    ExplicitPin { agent: agent as u32 + 1, weight }
}

/// Two groups of agents on a line, {1, 2, 3} and {4, 5, 6, 7}, as a tree and as rings.
pub fn two_groups() -> Communication {
    let x = [0.0, 1.0, 2.5, 10.0, 11.0, 12.0, 13.5];
    let topology = |name: &str, inside| StepByStepTopology { name: name.into(), inside };
    Communication::StepByStep(StepByStep {
        distances: x.iter().map(|a| x.iter().map(|b| f64::abs(a - b)).collect()).collect(),
        weights: Weights::InverseDistance,
        topologies: vec![topology("a3", Inside::Tree), topology("b3", Inside::Ring)],
    })
}

/// A random spanning tree and some more edges, weights in [0.3, 1), one to three pins.
pub fn random_graph(random: &mut Random, n: usize) -> (Vec<ExplicitEdge>, Vec<ExplicitPin>) {
    let mut edges: Vec<ExplicitEdge> = Vec::new();
    for i in 1..n {
        edges.push(edge(random.integer(0, i - 1), i, random.within(0.3, 1.0)));
    }
    for _ in 0..random.integer(0, n) {
        let (a, b) = (random.integer(0, n - 1), random.integer(0, n - 1));
        let (low, high) = (a.min(b), a.max(b));
        let there = |e: &ExplicitEdge| (e.a as usize, e.b as usize) == (low + 1, high + 1);
        if low != high && !edges.iter().any(there) {
            edges.push(edge(low, high, random.within(0.3, 1.0)));
        }
    }
    let mut pins: Vec<ExplicitPin> = Vec::new();
    for _ in 0..random.integer(1, 3) {
        let agent = random.integer(0, n - 1);
        if !pins.iter().any(|p| p.agent as usize == agent + 1) {
            pins.push(pin(agent, 1.0));
        }
    }
    (edges, pins)
}

#[derive(Clone, Debug, Deserialize)]
pub struct Sample {
    #[serde(default)]
    pub t: f64,
    pub omega: Vec<f64>,
    pub P: Vec<f64>,
    pub E: Vec<f64>,
    pub V: Vec<f64>,
    pub Q: Vec<f64>,
}

impl Sample {
    pub fn random(random: &mut Random, n: usize) -> Self {
        Self {
            t: 0.0,
            omega: random.values(n, 0.95, 1.05),
            P: random.values(n, 0.5, 1.5),
            E: random.values(n, 0.4, 0.9),
            V: random.values(n, 0.95, 1.05),
            Q: random.values(n, 0.2, 0.8),
        }
    }

    pub fn quantities(&self) -> [&Vec<f64>; 5] {
        [&self.omega, &self.P, &self.E, &self.V, &self.Q]
    }
}

#[derive(Deserialize)]
pub struct Reference {
    pub n: usize,
    pub eta: f64,
    pub edges: Vec<ExplicitEdge>,
    pub pinned: Vec<u32>,
    pub start: Sample,
    pub lambda2: f64,
    pub lambda_omega: f64,
    pub T_P: f64,
    pub T_omega: f64,
    pub T_Q: f64,
    pub T_V: f64,
    pub samples: Vec<Sample>,
}

impl Reference {
    pub fn read(name: &str) -> Self {
        let path = format!("{}/../shared/reference/{name}", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
        serde_json::from_str(&text).unwrap()
    }

    pub fn config(&self) -> Config {
        let pins = self.pinned.iter().map(|&agent| ExplicitPin { agent, weight: 1.0 }).collect();
        agent_model(self.n, self.eta, explicit(self.edges.clone(), pins), &self.start)
    }
}

/// The paper's literal laws for the agent model: unit droop, gains and capacities, (11) without limits.
pub fn agent_model(n: usize, eta: f64, communication: Communication, start: &Sample) -> Config {
    let mut config = Config::unit(n, communication);
    config.eta = eta;
    config.gains.E = 1.0;
    config.theta_E_s = 0.0;
    config.P_exchange_max = vec![1e9; n];
    config.omega_set_start = start.omega.iter().zip(&start.P).map(|(omega, P)| omega + P).collect();
    config.V_set_start = start.V.iter().zip(&start.Q).map(|(V, Q)| V + Q).collect();
    config
}

/// A controller that acts from its first step.
pub fn enabled(config: Config) -> Controller {
    let mut controller = Controller::new(config).unwrap();
    controller.inputs_mut().enable = true;
    controller
}

/// The agent model coupled with a controller: P, Q, E are integrators of the five inputs, omega and V
/// follow the setpoints through unit droops. The power measured is P + P_set.
#[derive(Clone)]
pub struct Loop {
    pub controller: Controller,
    pub plant: Sample,
    pub now_ns: i64,
    /// Whether P empties the batteries, as it does.
    pub discharging: bool,
    /// What rounding took from E: thousands of equal steps round the same way.
    pub lost_E: Vec<f64>,
}

impl Loop {
    pub fn new(config: Config, start: &Sample) -> Self {
        let controller = enabled(config);
        let mut coupled = Self {
            controller,
            plant: start.clone(),
            now_ns: 0,
            discharging: true,
            lost_E: vec![0.0; start.E.len()],
        };
        coupled.tell();
        coupled.controller.refresh(&mut |_| {});
        coupled
    }

    pub fn tell(&mut self) {
        let P_set = self.controller.outputs().P_set.clone();
        let inputs = self.controller.inputs_mut();
        for (i, P_set) in P_set.iter().enumerate() {
            inputs.P[i] = self.plant.P[i] + P_set;
        }
        inputs.Q.copy_from_slice(&self.plant.Q);
        inputs.V.copy_from_slice(&self.plant.V);
        inputs.omega.copy_from_slice(&self.plant.omega);
        inputs.E.copy_from_slice(&self.plant.E);
    }

    pub fn step(&mut self, h_ns: i64) {
        self.tell();
        self.controller.step(self.now_ns, h_ns, &mut |_| {});
        assert_eq!(self.controller.lags(), [0; 2], "what is measured here is never late");
        self.now_ns += h_ns;
        let h = h_ns as f64 * 1e-9;
        let out = self.controller.outputs();
        let plant = &mut self.plant;
        for i in 0..plant.P.len() {
            let drain = if self.discharging { plant.P[i] / 3600.0 } else { 0.0 };
            let step = h * (out.u_E[i] - drain) + self.lost_E[i];
            let E = plant.E[i] + step;
            self.lost_E[i] = step - (E - plant.E[i]);
            plant.E[i] = E;
            plant.P[i] += h * out.u_P[i];
            plant.Q[i] += h * out.u_Q[i];
            plant.omega[i] = out.omega_set[i] - plant.P[i];
            plant.V[i] = out.V_set[i] - plant.Q[i];
        }
        plant.t = self.now_ns as f64 * 1e-9;
    }
}

pub fn spread(x: &[f64]) -> f64 {
    x.iter().copied().fold(f64::MIN, f64::max) - x.iter().copied().fold(f64::MAX, f64::min)
}

pub fn largest_gap(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).fold(0.0, |e, (x, y)| e.max((x - y).abs()))
}

/// How much longer than by default: `BESS_TEST_SCALE`.
pub fn scale() -> f64 {
    std::env::var("BESS_TEST_SCALE").ok().and_then(|s| s.parse().ok()).unwrap_or(1.0)
}

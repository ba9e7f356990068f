//! A fleet in parts beside the same fleet whole, each with a small plant: the parts exchange messages over their
//! links only, the whole one has one communication step of delay on those links.
#![allow(dead_code, non_snake_case, clippy::unwrap_used, clippy::panic)]

use bess_consensus::control::communication::{Communication, Explicit};
use bess_consensus::control::partition::{split, written};
use bess_consensus::control::{Config, Controller, Inputs};

/// Voltage sources on a ring of lines: power by angle, reactive power by voltage, both filtered; droop (3), (6).
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    K_P: Vec<f64>,
    K_Q: Vec<f64>,
    delta: Vec<f64>,
    /// Local loads, pu.
    pub P_load: Vec<f64>,
    pub Q_load: Vec<f64>,
    pub P: Vec<f64>,
    pub Q: Vec<f64>,
    pub V: Vec<f64>,
    pub omega: Vec<f64>,
    pub E: Vec<f64>,
}

impl Plant {
    /// For these batteries, at unequal states of charge.
    pub fn new(config: &Config) -> Self {
        let n = config.agents();
        let spread = |i: usize| ((7 * i + 3) % 11) as f64 / 11.0;
        let mut plant = Self {
            K_P: config.K_P.clone(),
            K_Q: config.K_Q.clone(),
            delta: vec![0.0; n],
            P_load: (0..n).map(|i| 0.5 + spread(i)).collect(),
            Q_load: (0..n).map(|i| 0.1 + 0.3 * spread(i)).collect(),
            P: vec![0.5; n],
            Q: vec![0.2; n],
            V: vec![1.0; n],
            omega: vec![1.0; n],
            E: (0..n).map(|i| config.capacity[i] * (0.65 + 0.05 * spread(i))).collect(),
        };
        let zeros = vec![0.0; n];
        plant.follow(&config.omega_set_start, &config.V_set_start, &zeros);
        plant
    }

    fn follow(&mut self, omega_set: &[f64], V_set: &[f64], P_set: &[f64]) {
        for i in 0..self.P.len() {
            self.omega[i] = omega_set[i] - self.K_P[i] * (self.P[i] - P_set[i]);
            self.V[i] = V_set[i] - self.K_Q[i] * self.Q[i];
        }
    }

    /// A step in ten, after which frequency and voltage show these setpoints.
    fn step(&mut self, h_s: f64, omega_set: &[f64], V_set: &[f64], P_set: &[f64]) {
        let n = self.P.len();
        let h = h_s / 10.0;
        for _ in 0..10 {
            self.follow(omega_set, V_set, P_set);
            let next = |i: usize| (i + 1) % n;
            for i in 0..n {
                let last = (i + n - 1) % n;
                let [angle, level] = [&self.delta, &self.V].map(|x| 2.0 * x[i] - x[next(i)] - x[last]);
                let (p, q) = (self.P_load[i] + 4.0 * angle, self.Q_load[i] + 4.0 * level);
                self.E[i] -= h * p / 3600.0;
                self.P[i] += (1.0 - (-20.0 * h).exp()) * (p - self.P[i]);
                self.Q[i] += (1.0 - (-20.0 * h).exp()) * (q - self.Q[i]);
            }
            for i in 0..n {
                self.delta[i] += h * 377.0 * (self.omega[i] - 1.0);
            }
        }
        self.follow(omega_set, V_set, P_set);
    }
}

/// What a master sets.
#[derive(Clone, Debug)]
pub struct Switches {
    pub enable: bool,
    pub dispatch: bool,
    pub P_ref: f64,
    pub topology: i32,
    pub available: Vec<bool>,
}

/// Parts with the plant that they drive.
#[derive(Clone)]
pub struct Fleet {
    pub parts: Vec<Controller>,
    pub plant: Plant,
    pub now_ns: i64,
    /// All that agents answered before the last step, in one row.
    pub answered: Vec<f64>,
    /// Whether no message arrives.
    pub is_deaf: bool,
    /// Since when each part has stopped, if it has.
    pub stopped_ns: Vec<Option<i64>>,
    numbers: Vec<Vec<u32>>,
    n: usize,
}

impl Fleet {
    /// The whole fleet as one controller, with a delay of at least `step_s` on the links that are cut.
    pub fn whole(config: &Config, part_of: &[u32], step_s: f64) -> Self {
        let mut topologies = written(config);
        for edge in topologies.iter_mut().flat_map(|topology| &mut topology.edges) {
            if part_of[edge.a as usize - 1] != part_of[edge.b as usize - 1] {
                edge.delay_s = Some(edge.delay_s.unwrap_or(config.delay_s).max(step_s));
            }
        }
        let communication = Communication::Explicit(Explicit { topologies });
        Self::of(vec![Config { communication, ..config.clone() }], config)
    }

    /// The fleet in parts.
    pub fn apart(config: &Config, part_of: &[u32], step_s: f64) -> Self {
        Self::of(split(config, part_of, step_s).unwrap(), config)
    }

    fn of(configs: Vec<Config>, whole: &Config) -> Self {
        let n = whole.agents();
        let numbers = configs.iter().map(|c| match &c.part {
            Some(part) => part.agents.clone(),
            None => (1..=n as u32).collect(),
        });
        let numbers = numbers.collect();
        // As the FMU reads it.
        let reread = |c: &Config| serde_json::from_str(&serde_json::to_string(c).unwrap()).unwrap();
        let parts = configs.iter().map(|c| Controller::new(reread(c)).unwrap()).collect();
        let parts: Vec<Controller> = parts;
        let stopped_ns = vec![None; parts.len()];
        Self {
            stopped_ns,
            parts,
            plant: Plant::new(whole),
            now_ns: 0,
            answered: Vec::new(),
            is_deaf: false,
            numbers,
            n,
        }
    }

    /// Which agent of the fleet, from 0, is at each own place of part `p`.
    pub fn own(&self, p: usize) -> Vec<(usize, usize)> {
        let places = self.parts[p].own_agents();
        places.into_iter().map(|place| (place, self.numbers[p][place] as usize - 1)).collect()
    }

    fn gathered(&self, value: impl Fn(&Controller, usize) -> f64) -> Vec<f64> {
        let mut all = vec![f64::NAN; self.n];
        for p in 0..self.parts.len() {
            for (place, agent) in self.own(p) {
                all[agent] = value(&self.parts[p], place);
            }
        }
        all
    }

    pub fn omega_set(&self) -> Vec<f64> {
        self.gathered(|c, i| c.outputs().omega_set[i])
    }

    pub fn V_set(&self) -> Vec<f64> {
        self.gathered(|c, i| c.outputs().V_set[i])
    }

    pub fn P_set(&self) -> Vec<f64> {
        self.gathered(|c, i| c.outputs().P_set[i])
    }

    fn answers(&self) -> Vec<f64> {
        let u = [
            self.gathered(|c, i| c.outputs().u_omega[i]),
            self.gathered(|c, i| c.outputs().u_P[i]),
            self.gathered(|c, i| c.outputs().u_E[i]),
            self.gathered(|c, i| c.outputs().u_V[i]),
            self.gathered(|c, i| c.outputs().u_Q[i]),
        ];
        let set = [self.omega_set(), self.V_set(), self.P_set()];
        set.into_iter().chain(u).flatten().collect()
    }

    /// Measurements and switches to all, messages between parts.
    pub fn tell(&mut self, switches: &Switches) {
        for p in 0..self.parts.len() {
            let own = self.own(p);
            let inputs = self.parts[p].inputs_mut();
            for (place, agent) in own {
                inputs.P[place] = self.plant.P[agent];
                inputs.Q[place] = self.plant.Q[agent];
                inputs.V[place] = self.plant.V[agent];
                inputs.omega[place] = self.plant.omega[agent];
                inputs.E[place] = self.plant.E[agent];
                inputs.available[place] = switches.available[agent];
            }
            inputs.enable = switches.enable;
            inputs.dispatch = switches.dispatch;
            inputs.P_ref = switches.P_ref;
            inputs.topology = switches.topology;
        }
        if self.now_ns == 0 {
            // Initialisation mode: what is told follows what is measured.
            self.parts.iter_mut().for_each(Controller::initialise);
        }
        self.exchange();
        if self.now_ns == 0 {
            self.parts.iter_mut().for_each(Controller::initialise);
        }
    }

    /// A part that has stopped goes on where it stopped: with one step over what it missed, in which it took no part.
    pub fn resume(&mut self, p: usize) {
        let Some(since_ns) = self.stopped_ns[p].take() else { return };
        let part = &mut self.parts[p];
        let inputs = part.inputs_mut();
        let available = inputs.available.clone();
        inputs.available.fill(false);
        inputs.remote.standing.available.fill(false);
        part.step(since_ns, self.now_ns - since_ns, &mut |_| {});
        part.inputs_mut().available = available;
    }

    fn exchange(&mut self) {
        if self.is_deaf {
            return;
        }
        let told: Vec<_> = self.parts.iter().map(|part| part.outputs().local.clone()).collect();
        let teller = |number: u32| {
            self.parts.iter().enumerate().find_map(|(p, part)| {
                let tellers = part.slots_and_tellers().1;
                let k = tellers.iter().position(|&place| self.numbers[p][place] == number)?;
                Some((p, k))
            })
        };
        let mut links = Vec::new();
        for (p, part) in self.parts.iter().enumerate() {
            for (slot, &place) in part.slots_and_tellers().0.iter().enumerate() {
                let (from, k) = teller(self.numbers[p][place]).unwrap();
                links.push((p, slot, from, k));
            }
        }
        for (p, slot, from, k) in links {
            let remote = &mut self.parts[p].inputs_mut().remote;
            for (values, told) in remote.values.iter_mut().zip(&told[from].values) {
                values[slot] = told[k];
            }
            let (standing, told) = (&mut remote.standing, &told[from].standing);
            // Who passes messages on says so where the first one is missing.
            let is_there = self.stopped_ns[from].is_none_or(|since_ns| since_ns == self.now_ns);
            standing.available[slot] = told.available[k] && is_there;
            standing.enabled[slot] = told.enabled[k];
            standing.hops[slot] = told.hops[k];
            standing.links[slot] = told.links[k];
            standing.ended[slot] = told.ended[k];
        }
    }

    /// One communication step.
    pub fn step(&mut self, h_ns: i64, switches: &Switches) {
        self.step_with(h_ns, switches, |_, _| {});
    }

    /// The same where some parts are told something else.
    pub fn step_with(&mut self, h_ns: i64, switches: &Switches, tell: impl Fn(usize, &mut Inputs)) {
        self.tell(switches);
        for (p, part) in self.parts.iter_mut().enumerate() {
            tell(p, part.inputs_mut());
        }
        self.parts.iter_mut().for_each(|part| part.refresh(&mut |_| {}));
        self.answered = self.answers();
        for (part, _) in self.parts.iter_mut().zip(&self.stopped_ns).filter(|(_, stopped)| stopped.is_none())
        {
            part.step(self.now_ns, h_ns, &mut |_| {});
            // A master reads when it likes.
            part.refresh(&mut |_| {});
        }
        self.now_ns += h_ns;
        let (omega_set, V_set, P_set) = (self.omega_set(), self.V_set(), self.P_set());
        self.plant.step(h_ns as f64 * 1e-9, &omega_set, &V_set, &P_set);
    }
}

/// Everybody there, on, first topology.
pub fn on(n: usize) -> Switches {
    Switches { enable: true, dispatch: false, P_ref: 0.0, topology: 1, available: vec![true; n] }
}

pub fn same_bits(x: &[f64], y: &[f64]) -> bool {
    x.len() == y.len() && x.iter().zip(y).all(|(x, y)| x.to_bits() == y.to_bits())
}

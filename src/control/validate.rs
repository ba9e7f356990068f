//! Looks a configuration through once, at the edge: every problem with its path, what was found and
//! what was expected. Changes nothing.

use super::communication::{Communication, ExplicitTopology, StepByStep};
use super::config::{Config, Law};
use super::error::{ConfigError, Problems};
use super::graph::{Edge, Graph};
use super::{part, told};

impl Config {
    /// All problems of this configuration, or `Ok`.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let mut problems = Problems::default();
        let n = self.agents();
        if n == 0 {
            problems.add("K_P", "no values", "one value per agent, at least one agent");
        }
        for (path, values) in [
            ("K_P", &self.K_P),
            ("K_Q", &self.K_Q),
            ("capacity", &self.capacity),
            ("omega_set_start", &self.omega_set_start),
            ("V_set_start", &self.V_set_start),
        ] {
            agents(&mut problems, path, values, n, Bound::Positive);
        }
        agents(&mut problems, "P_exchange_max", &self.P_exchange_max, n, Bound::NotNegative);
        scalars(&mut problems, self);
        limits(&mut problems, self, n);
        match &self.communication {
            Communication::StepByStep(s) => step_by_step(&mut problems, s, n),
            Communication::Explicit(e) => {
                if e.topologies.is_empty() {
                    problems.add("communication.explicit.topologies", "none", "at least one topology");
                }
                for (k, topology) in e.topologies.iter().enumerate() {
                    let path = format!("communication.explicit.topologies[{k}]");
                    let fleet = self.part.as_ref().map(|part| part.fleet as usize);
                    explicit(&mut problems, topology, &path, (n, fleet));
                }
            }
        }
        if let Some(part) = &self.part {
            part::check(&mut problems, self, part, n);
        }
        problems.into_result()
    }
}

#[derive(Clone, Copy)]
pub(super) enum Bound {
    Positive,
    NotNegative,
}

impl Bound {
    fn holds(self, x: f64) -> bool {
        x.is_finite()
            && match self {
                Self::Positive => x > 0.0,
                Self::NotNegative => x >= 0.0,
            }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Positive => "a finite number > 0",
            Self::NotNegative => "a finite number >= 0",
        }
    }
}

pub(super) fn agents(problems: &mut Problems, path: &str, values: &[f64], n: usize, bound: Bound) {
    if values.len() != n {
        problems.add(
            path,
            format!("{} values", values.len()),
            format!("{n} values, one per agent as in K_P"),
        );
    }
    for (i, &x) in values.iter().enumerate() {
        if !bound.holds(x) {
            problems.add(format!("{path}[{i}]"), x, format!("{} (agent {})", bound.words(), i + 1));
        }
    }
}

pub(super) fn scalar(problems: &mut Problems, path: &str, x: f64, bound: Bound) {
    if !bound.holds(x) {
        problems.add(path, x, bound.words());
    }
}

pub(super) fn eta(problems: &mut Problems, path: &str, x: f64) {
    if !(x > 0.0 && x <= 1.0) {
        problems.add(
            path,
            x,
            "0 < eta <= 1 (eta is the exponent itself; the homogeneity degree eta - 1 is negative)",
        );
    }
}

fn scalars(problems: &mut Problems, config: &Config) {
    use Bound::{NotNegative, Positive};
    eta(problems, "eta", config.eta);
    let (gains, filter) = (&config.gains, &config.measurement_filter);
    for (path, x) in [
        ("gains.omega", gains.omega),
        ("gains.P", gains.P),
        ("gains.E", gains.E),
        ("gains.V", gains.V),
        ("gains.Q", gains.Q),
        ("delay_s", config.delay_s),
        ("theta_min_s", config.theta_min_s),
        ("theta_E_s", config.theta_E_s),
        ("measurement_filter.omega_s", filter.omega_s),
        ("measurement_filter.P_s", filter.P_s),
        ("measurement_filter.E_s", filter.E_s),
        ("measurement_filter.V_s", filter.V_s),
        ("measurement_filter.Q_s", filter.Q_s),
        ("channel.jitter_s", config.channel.jitter_s),
        ("exchange_fade_s", config.exchange_fade_s),
    ] {
        scalar(problems, path, x, NotNegative);
    }
    if let Law::FixedTime { alpha, beta } = config.law {
        scalar(problems, "law.fixed_time.alpha", alpha, Positive);
        scalar(problems, "law.fixed_time.beta", beta, Positive);
    }
    if let Some(silence) = config.silence_s {
        let late = config.delay_s + config.channel.jitter_s;
        if !(silence > late && silence.is_finite()) {
            problems.add("silence_s", silence, "a time longer than delay_s and channel.jitter_s together, s");
        }
    }
    told::check(problems, &config.message_faults, config.agents());
    if let Some(fade) = config.lost_link_fade_s {
        scalar(problems, "lost_link_fade_s", fade, Positive);
    }
    if !(0.0..1.0).contains(&config.channel.loss) {
        problems.add("channel.loss", config.channel.loss, "a probability in [0, 1)");
    }
}

fn limits(problems: &mut Problems, config: &Config, n: usize) {
    let limits = &config.limits;
    for (path, values) in [
        ("limits.P_max", &limits.P_max),
        ("limits.Q_max", &limits.Q_max),
        ("limits.S_max", &limits.S_max),
        ("limits.omega_set_rate", &limits.omega_set_rate),
        ("limits.V_set_rate", &limits.V_set_rate),
        ("limits.P_set_rate", &limits.P_set_rate),
    ] {
        if let Some(values) = values {
            agents(problems, path, values, n, Bound::Positive);
        }
    }
    for (path, range, starts, key) in [
        ("limits.omega_set_range", limits.omega_set_range, &config.omega_set_start, "omega_set_start"),
        ("limits.V_set_range", limits.V_set_range, &config.V_set_start, "V_set_start"),
    ] {
        let Some([low, high]) = range else { continue };
        if !(low.is_finite() && high.is_finite() && low < high) {
            problems.add(path, format!("[{low}, {high}]"), "two finite numbers, the lower first");
            continue;
        }
        for (i, &start) in starts.iter().enumerate() {
            if !(low..=high).contains(&start) {
                problems.add(
                    format!("{key}[{i}]"),
                    start,
                    format!("a value inside {path} = [{low}, {high}]"),
                );
            }
        }
    }
    if let Some(soc) = limits.SoC {
        if !(soc.min >= 0.0 && soc.min < soc.max && soc.max <= 1.0) {
            problems.add("limits.SoC", format!("min {}, max {}", soc.min, soc.max), "0 <= min < max <= 1");
        }
        scalar(problems, "limits.SoC.taper", soc.taper, Bound::Positive);
        if limits.P_max.is_none() && limits.S_max.is_none() {
            problems.add(
                "limits.SoC",
                "no limits.P_max and no limits.S_max",
                "a power limit for SoC to taper",
            );
        }
    }
}

pub(super) fn step_by_step(problems: &mut Problems, config: &StepByStep, n: usize) {
    let path = "communication.step_by_step";
    if config.topologies.is_empty() {
        problems.add(format!("{path}.topologies"), "none", "at least one topology");
    }
    let d = &config.distances;
    if d.len() != n {
        problems.add(
            format!("{path}.distances"),
            format!("{} rows", d.len()),
            format!("{n} rows, one per agent"),
        );
        return;
    }
    for (i, row) in d.iter().enumerate() {
        if row.len() != n {
            let found = format!("{} values", row.len());
            problems.add(format!("{path}.distances[{i}]"), found, format!("{n} values, one per agent"));
            continue;
        }
        for (j, &x) in row.iter().enumerate() {
            let here = || format!("{path}.distances[{i}][{j}]");
            if i == j && x != 0.0 {
                problems.add(here(), x, "0, the distance of an agent from itself");
            } else if i != j && !(x.is_finite() && x > 0.0) {
                problems.add(here(), x, "a finite distance > 0; agents at one place need a small distance");
            } else if j < i && d[j].get(i).is_some_and(|&mirror| mirror != x) {
                problems.add(here(), x, format!("{}, as at [{j}][{i}]: distances are symmetric", d[j][i]));
            }
        }
    }
}

/// `fleet` is the number of agents of the fleet where these are a part of it, whose graph need not hang together.
fn explicit(
    problems: &mut Problems,
    topology: &ExplicitTopology,
    path: &str,
    (n, fleet): (usize, Option<usize>),
) {
    let clusters_most = fleet.unwrap_or(n);
    let exists = |agent: u32| agent >= 1 && agent as usize <= n;
    let known = format!("an agent number from 1 to {n}");
    let mut edges = Vec::with_capacity(topology.edges.len());
    for (k, edge) in topology.edges.iter().enumerate() {
        let here = format!("{path}.edges[{k}]");
        for (end, agent) in [("a", edge.a), ("b", edge.b)] {
            if !exists(agent) {
                problems.add(format!("{here}.{end}"), agent, known.clone());
            }
        }
        scalar(problems, &format!("{here}.weight"), edge.weight, Bound::Positive);
        if let Some(delay) = edge.delay_s {
            scalar(problems, &format!("{here}.delay_s"), delay, Bound::NotNegative);
        }
        if edge.a == edge.b {
            problems.add(
                here,
                format!("an edge from agent {0} to agent {0}", edge.a),
                "two different agents",
            );
        } else if exists(edge.a) && exists(edge.b) {
            edges.push((Edge::new(edge.a as usize - 1, edge.b as usize - 1, edge.weight), k));
        }
    }
    edges.sort_by_key(|(e, k)| (e.a, e.b, *k));
    for pair in edges.windows(2) {
        let ((first, at), (second, again)) = (pair[0], pair[1]);
        if (first.a, first.b) == (second.a, second.b) {
            let found = format!("agents {} and {} again, as in edges[{at}]", first.a + 1, first.b + 1);
            problems.add(format!("{path}.edges[{again}]"), found, "each pair of agents once");
        }
    }
    let mut pins = vec![0.0; n];
    for (k, pin) in topology.pins.iter().enumerate() {
        if !exists(pin.agent) {
            problems.add(format!("{path}.pins[{k}].agent"), pin.agent, known.clone());
        } else if pins[pin.agent as usize - 1] != 0.0 {
            problems.add(
                format!("{path}.pins[{k}].agent"),
                format!("agent {} again", pin.agent),
                "each agent once",
            );
        } else {
            pins[pin.agent as usize - 1] = 1.0;
        }
        scalar(problems, &format!("{path}.pins[{k}].weight"), pin.weight, Bound::Positive);
    }
    if let Some(clusters) = &topology.clusters {
        if clusters.len() != n {
            problems.add(
                format!("{path}.clusters"),
                format!("{} values", clusters.len()),
                format!("{n} values"),
            );
        }
        for (i, &c) in clusters.iter().enumerate() {
            if c < 1 || c as usize > clusters_most {
                let expected = format!("a cluster number from 1 to {clusters_most}");
                problems.add(format!("{path}.clusters[{i}]"), c, expected);
            }
        }
    }
    for (k, &leader) in topology.leaders.iter().flatten().enumerate() {
        if !exists(leader) {
            problems.add(format!("{path}.leaders[{k}]"), leader, known.clone());
        }
    }
    if fleet.is_none() {
        connected(problems, path, Graph::new(n, edges.into_iter().map(|(e, _)| e).collect(), pins));
    }
}

fn connected(problems: &mut Problems, path: &str, graph: Graph) {
    let parts = graph.components(&vec![true; graph.agents()]);
    if parts.count() > 1 {
        let second = parts.first(1).unwrap_or(0) + 1;
        let found = format!("{} parts; no path from agent 1 to agent {second}", parts.count());
        problems.add(format!("{path}.edges"), found, "a connected graph; add an edge between the parts");
    }
    for number in (0..parts.count()).filter(|&p| !parts.pinned[p]) {
        let agent = parts.first(number).unwrap_or(0) + 1;
        let found = format!("no pin in the part of agent {agent}");
        problems.add(format!("{path}.pins"), found, "a pinned agent in every connected part");
    }
}

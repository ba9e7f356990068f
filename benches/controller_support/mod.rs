//! Many agents, stepped, beside the floor of the machine.

mod floor;

use crate::options::{Options, option};
use bess_consensus::control::communication::{
    Communication, Explicit, ExplicitEdge, ExplicitPin, ExplicitTopology,
};
use bess_consensus::control::order::Order;
use bess_consensus::control::{Config, Controller};
use bess_consensus::fmi::Interface;
use bess_consensus::harness::Fmu;
use bess_consensus::models::ControllerResource;
use bess_consensus::package::{Libraries, write_controller_of};
use floor::Floor;
use serde_json::json;
use std::time::Instant;

/// Length of a step, ns.
const STEP_NS: i64 = 10_000_000;

/// xorshift64* (Vigna 2016).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A ring in which every agent talks to the two on either side. Numbers from 1: folded, so that the ends of the
/// ring meet and neighbours are close in number, or shuffled.
fn edges(n: usize, shuffled: bool, random: &mut Random) -> Vec<ExplicitEdge> {
    let folded = |p: usize| if 2 * p < n { 2 * p + 1 } else { 2 * (n - p) };
    let mut number: Vec<u32> = (0..n).map(|p| folded(p) as u32).collect();
    if shuffled {
        for i in (1..n).rev() {
            number.swap(i, (random.next() % (i as u64 + 1)) as usize);
        }
    }
    (0..n)
        .flat_map(|i| [(i, (i + 1) % n), (i, (i + 2) % n)])
        .map(|(a, b)| ExplicitEdge {
            a: number[a],
            b: number[b],
            weight: random.within(0.5, 1.0),
            delay_s: None,
        })
        .collect()
}

fn config(n: usize, options: &Options) -> Result<Config, String> {
    let mut random = Random(7);
    let order: String = option(options, "order", "local".to_owned())?;
    let topology = ExplicitTopology {
        name: "ring".into(),
        edges: edges(n, order == "random", &mut random),
        pins: (0..n as u32)
            .step_by(n.div_ceil(10))
            .map(|i| ExplicitPin { agent: i + 1, weight: 1.0 })
            .collect(),
        clusters: None,
        leaders: None,
    };
    let mut values = |low, high| (0..n).map(|_| random.within(low, high)).collect::<Vec<f64>>();
    Ok(Config {
        K_P: values(0.002, 0.006),
        K_Q: values(0.01, 0.03),
        capacity: values(10.0, 20.0),
        P_exchange_max: values(0.5, 1.0),
        omega_set_start: values(0.998, 1.002),
        V_set_start: values(1.0, 1.04),
        eta: option(options, "eta", 0.5)?,
        delay_s: option(options, "delay-s", 0.0)?,
        ..Config::unit(n, Communication::Explicit(Explicit { topologies: vec![topology] }))
    })
}

/// The bytes that a step must move, each array once: per agent five measurements, four parameters, four
/// setpoints of which three are written, five rates written, the number of its peers, whether it takes part, is
/// available and saturated, and for each of two droops what was set, written for later; per edge its weight, and the
/// exchange's flow, written. Not the ends of edges, which follow from a few distances in this graph; nor what tells how
/// late the measurements are, for which some thousand agents are asked.
fn bytes(agents: usize, edges: usize) -> f64 {
    let per_agent = 8 * (5 + 4 + 4 + 3 + 5 + 2) + 4 + 3;
    let per_edge = 8 + 8;
    (per_agent * agents + per_edge * edges) as f64
}

/// Steps and prints times.
pub fn step(options: &Options) -> Result<String, String> {
    let n: usize = option(options, "agents", 1_000_000)?;
    let steps: usize = option(options, "steps", 9)?;
    let config = config(n, options)?;
    let eta = config.eta;
    let begin = Instant::now();
    // As the FMU does when it loads.
    let config = Order::local(&config).renumbered(config);
    let mut controller = Controller::new(config).map_err(|e| e.to_string())?;
    let new_s = begin.elapsed().as_secs_f64();
    let mut random = Random(11);
    let inputs = controller.inputs_mut();
    for i in 0..n {
        inputs.P[i] = random.within(0.0, 1.0);
        inputs.Q[i] = random.within(-0.5, 0.5);
        inputs.V[i] = random.within(0.98, 1.04);
        inputs.omega[i] = random.within(0.998, 1.002);
        inputs.E[i] *= random.within(0.9, 1.1);
    }
    inputs.enable = true;
    let edges = controller.network().graph.edges().len();
    let wants_floor = option(options, "floor", "yes".to_owned())? == "yes";
    let mut floor = wants_floor.then(|| Floor::new(eta));
    let (mut step_s, mut roots, mut triads, mut powers) = (vec![], vec![], vec![], vec![]);
    let mut checksum = 0.0;
    // Two steps warm up.
    for k in 0..steps as i64 + 2 {
        // A measurement that stands still tells nothing about its lag.
        controller.inputs_mut().omega[k as usize % n] += 1e-5;
        let begin = Instant::now();
        controller.step(k * STEP_NS, STEP_NS, &mut |_| {});
        let elapsed_s = begin.elapsed().as_secs_f64();
        checksum += controller.outputs().omega_set[n / 2];
        if k < 2 {
            continue;
        }
        step_s.push(elapsed_s);
        if let Some(floor) = &mut floor {
            roots.push(floor.root_s());
            powers.push(floor.power_s());
            triads.push(floor.triad_bytes_per_s());
        }
    }
    let result = json!({
        "agents": n, "edges": edges, "eta": eta, "new_s": new_s, "step_s": step_s, "checksum": checksum,
        "bytes": bytes(n, edges), "root_s": roots, "power_s": powers, "triad_bytes_per_s": triads,
        "peak_memory_bytes": peak_memory(),
    });
    Ok(result.to_string())
}

/// Writes the FMU and prints the time.
pub fn export(options: &Options) -> Result<String, String> {
    let n: usize = option(options, "agents", 10_000)?;
    let folder = options.get("folder").ok_or("--folder is missing")?;
    let file = options.get("to").ok_or("--to is missing")?;
    let resource = ControllerResource { stop_s: 120.0, step_s: 0.01, config: config(n, options)? };
    let libraries = Libraries::Folder(folder.into());
    let begin = Instant::now();
    write_controller_of(file.as_ref(), resource, Interface::Structured, &libraries)
        .map_err(|e| e.to_string())?;
    Ok(json!({ "agents": n, "s": begin.elapsed().as_secs_f64() }).to_string())
}

/// Opens an FMU, makes an instance and prints the time.
pub fn load(file: &str) -> Result<String, String> {
    let begin = Instant::now();
    let fmu = Fmu::open(file.as_ref()).map_err(|e| e.to_string())?;
    let instance = fmu.instantiate("load").map_err(|e| e.to_string())?;
    let s = begin.elapsed().as_secs_f64();
    drop(instance);
    Ok(json!({ "variables": fmu.description().variables.len(), "s": s }).to_string())
}

/// The most memory that this process had, bytes; Linux says it.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(1024 * line.split_whitespace().nth(1)?.parse::<u64>().ok()?)
}

//! Instances of both models at some point of a run, and central differences to compare derivatives with.
#![allow(dead_code, clippy::unwrap_used, clippy::panic, reason = "a test may fail")]

use bess_consensus::fmi::{
    Access, Causality, Instance, Interface, Logger, Model, Variability, model_description,
};
use bess_consensus::models::{Controller, Grid};
use bess_consensus::scenario::Resolved;
use serde_json::{Map, Value};
use std::collections::BTreeSet;

/// Keys of a scenario and their values, written as JSON.
pub fn keys(set: &[(&str, &str)]) -> Map<String, Value> {
    set.iter().map(|(path, json)| ((*path).to_owned(), serde_json::from_str(json).unwrap())).collect()
}

pub fn controller(name: &str, set: &[(&str, &str)], interface: Interface) -> Instance<Controller> {
    let resolved = Resolved::load(name, &keys(set)).unwrap();
    let model = Controller::new(Controller::resource(&resolved)).unwrap();
    Instance::from_model("controller", model, interface, Logger::silent()).unwrap()
}

pub fn grid(name: &str, set: &[(&str, &str)], interface: Interface) -> Instance<Grid> {
    let resolved = Resolved::load(name, &keys(set)).unwrap();
    let model = Grid::new(Grid::resource(&resolved).unwrap()).unwrap();
    Instance::from_model("grid", model, interface, Logger::silent()).unwrap()
}

/// Numbers that scatter evenly over [-1, 1): a linear congruential generator (Knuth's MMIX).
pub struct Scatter(pub u64);

impl Scatter {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Value references of the variables of these groups, in order.
pub fn references<M: Model>(instance: &Instance<M>, groups: &[&str]) -> Vec<u32> {
    let of = |name: &&str| {
        let (first, group) = instance.registry().group(name).unwrap_or_else(|| panic!("{name}"));
        first..first + group.len() as u32
    };
    groups.iter().flat_map(of).collect()
}

fn continuous<M: Model>(instance: &Instance<M>, causality: Causality, variability: Variability) -> Vec<u32> {
    let fits = |access: &Access<M>| matches!(access, Access::Real(..));
    let groups = instance.registry().groups();
    let groups =
        groups.filter(|(_, g)| g.causality == causality && g.variability == variability && fits(&g.access));
    groups.flat_map(|(first, group)| first..first + group.len() as u32).collect()
}

pub fn inputs<M: Model>(instance: &Instance<M>) -> Vec<u32> {
    continuous(instance, Causality::Input, Variability::Continuous)
}

pub fn tunables<M: Model>(instance: &Instance<M>) -> Vec<u32> {
    continuous(instance, Causality::Parameter, Variability::Tunable)
}

pub fn outputs<M: Model>(instance: &Instance<M>) -> Vec<u32> {
    continuous(instance, Causality::Output, Variability::Continuous)
}

pub fn read<M: Model>(instance: &mut Instance<M>, references: &[u32]) -> Vec<f64> {
    let mut values = vec![f64::NAN; references.len()];
    instance.get_real(references, &mut values).unwrap();
    values
}

/// All bytes of its state.
pub fn bytes<M: Model>(instance: &Instance<M>) -> Vec<u8> {
    instance.serialize(&instance.snapshot().unwrap()).unwrap()
}

/// d outputs along `seeds` of `knowns`.
pub fn derivative<M: Model>(
    instance: &mut Instance<M>,
    unknowns: &[u32],
    knowns: &[u32],
    seeds: &[f64],
) -> Vec<f64> {
    let mut rates = vec![f64::NAN; unknowns.len()];
    instance.get_directional_derivative(unknowns, knowns, seeds, &mut rates).unwrap();
    rates
}

/// What central differences say of each output: a rate, or nothing where no step size gives a steady one (a kink
/// nearby).
pub fn differences<M: Model>(
    instance: &mut Instance<M>,
    unknowns: &[u32],
    knowns: &[u32],
    seeds: &[f64],
) -> Vec<Option<f64>> {
    let centre = read(instance, knowns);
    let size = read(instance, unknowns);
    let mut at = |s: f64| {
        let moved: Vec<f64> = centre.iter().zip(seeds).map(|(x, d)| x + s * d).collect();
        instance.set_real(knowns, &moved).unwrap();
        let values = read(instance, unknowns);
        instance.set_real(knowns, &centre).unwrap();
        values
    };
    // Fourth order each; two sizes that agree vouch for each other.
    let mut central = |h: f64| {
        let [far_left, left, right, far_right] = [-2.0 * h, -h, h, 2.0 * h].map(&mut at);
        (0..unknowns.len())
            .map(|k| (8.0 * (right[k] - left[k]) - (far_right[k] - far_left[k])) / (12.0 * h))
            .collect::<Vec<f64>>()
    };
    let mut found = vec![None; unknowns.len()];
    let mut last: Option<Vec<f64>> = None;
    let mut h = 0.02;
    while h > 1e-6 {
        let now = central(h);
        if let Some(last) = &last {
            for k in 0..now.len() {
                let rounding = 1e-15 * size[k].abs() / h;
                let agree = (now[k] - last[k]).abs() <= 1e-7 * now[k].abs() + rounding;
                // A difference of 0 next to a kink that the stencil jumps over is no witness: go on.
                if found[k].is_none() && agree && rounding <= 3e-7 * now[k].abs().max(1e-6) {
                    found[k] = Some(now[k]);
                }
            }
        }
        last = Some(now);
        h /= 2.0;
    }
    found
}

/// (output, input) pairs of value references that `element` of ModelStructure declares.
pub fn declared<M: Model>(instance: &Instance<M>, model: &M, element: &str) -> BTreeSet<(u32, u32)> {
    let xml = model_description::write(model, instance.registry().interface).unwrap();
    let list = xml.split_once(&format!("<{element}>")).unwrap().1;
    let list = list.split_once(&format!("</{element}>")).unwrap().0;
    let attribute = |line: &str, name: &str| {
        let value = line.split_once(&format!("{name}=\"")).unwrap_or_else(|| panic!("{line}")).1;
        value.split_once('"').unwrap().0.to_owned()
    };
    let mut pairs = BTreeSet::new();
    for line in list.lines().filter(|line| line.contains("<Unknown")) {
        let index: u32 = attribute(line, "index").parse().unwrap();
        for cause in attribute(line, "dependencies").split_whitespace() {
            pairs.insert((index, cause.parse().unwrap()));
        }
    }
    pairs
}

/// Compares all derivatives with central differences to 1e-6; returns how many of them a difference could be found
/// for, and how many there are.
pub fn compare<M: Model>(
    instance: &mut Instance<M>,
    knowns: &[u32],
    scales: &[f64],
    what: &str,
) -> (usize, usize) {
    let unknowns = outputs(instance);
    let pairs = declared(instance, &instance.model().clone(), "Outputs");
    let input: BTreeSet<u32> = inputs(instance).into_iter().collect();
    let (mut judged, mut all) = (0, 0);
    for (known, scale) in knowns.iter().zip(scales) {
        read(instance, &unknowns);
        let before = bytes(instance);
        let exact = derivative(instance, &unknowns, &[*known], &[*scale]);
        assert!(bytes(instance) == before, "{what}: a derivative changes nothing");
        let central = differences(instance, &unknowns, &[*known], &[*scale]);
        for (k, unknown) in unknowns.iter().enumerate() {
            let name = |r: u32| instance.registry().name(r).unwrap();
            let label = || format!("{what}: d {} / d {}", name(*unknown), name(*known));
            assert!(exact[k].is_finite(), "{}", label());
            if exact[k] != 0.0 && input.contains(known) {
                assert!(pairs.contains(&(*unknown, *known)), "{} is not declared", label());
            }
            all += 1;
            if let Some(central) = central[k] {
                judged += 1;
                let error = (exact[k] - central).abs();
                // Relative; below a millionth of the known's scale, absolute.
                let tolerance = 1e-6 * exact[k].abs().max(central.abs()).max(1e-6);
                assert!(error <= tolerance, "{}: {} against {central}", label(), exact[k]);
            }
        }
    }
    (judged, all)
}

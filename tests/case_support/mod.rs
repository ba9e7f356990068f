//! A built-in scenario run in process, and what the tests of the cases read off it.
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic, dead_code)]

use bess_consensus::harness::{CONTROLLER, Cast, GRID, Memory, Participant, run, stage};
use bess_consensus::scenario::Resolved;
use serde_json::{Map, Value};

/// Number of batteries of the built-in scenarios.
pub const N: usize = 7;

/// A finished run; every series has one value per recorded instant.
pub struct Run {
    pub t: Vec<f64>,
    pub K_P: Vec<f64>,
    pub K_Q: Vec<f64>,
    pub C: Vec<f64>,
    memory: Memory,
}

/// Keys of a scenario and their values, written as JSON.
pub fn keys(set: &[(&str, &str)]) -> Map<String, Value> {
    set.iter().map(|(path, json)| ((*path).to_owned(), serde_json::from_str(json).unwrap())).collect()
}

/// Runs a built-in scenario with changed keys, every communication point recorded.
pub fn scenario(name: &str, set: &[(&str, &str)]) -> Run {
    with(name, set, |_| {})
}

/// The same with a hand on the participants before they start.
pub fn with(name: &str, set: &[(&str, &str)], change: impl FnOnce(&mut Vec<Box<dyn Participant>>)) -> Run {
    let resolved = Resolved::load(name, &keys(set)).unwrap();
    let (mut participants, plan) = stage(&resolved, &Cast::default()).unwrap();
    change(&mut participants);
    let mut memory =
        Memory::new(1, |column| !column.variable.starts_with("bus_") && !column.variable.contains("_load["));
    run(&mut participants, &plan, &mut memory).unwrap();
    Run {
        t: memory.times_ns().iter().map(|t| *t as f64 * 1e-9).collect(),
        K_P: resolved.control.K_P.clone(),
        K_Q: resolved.control.K_Q.clone(),
        C: resolved.control.capacity.clone(),
        memory,
    }
}

impl Run {
    /// A series of the controller.
    pub fn controller(&self, name: &str) -> &[f64] {
        self.memory.values(CONTROLLER, name).unwrap_or_else(|| panic!("no controller.{name}"))
    }

    /// A series of the grid.
    pub fn grid(&self, name: &str) -> &[f64] {
        self.memory.values(GRID, name).unwrap_or_else(|| panic!("no grid.{name}"))
    }

    /// K_P_i (P_i - P_set_i), battery by battery.
    pub fn p(&self) -> Vec<Vec<f64>> {
        self.scaled("P", &self.K_P)
    }

    /// K_Q_i (Q_i - Q_set_i), battery by battery.
    pub fn q(&self) -> Vec<Vec<f64>> {
        self.scaled("Q", &self.K_Q)
    }

    fn scaled(&self, quantity: &str, gains: &[f64]) -> Vec<Vec<f64>> {
        let of = |i: usize| {
            let power = self.grid(&format!("{quantity}[{}]", i + 1));
            let reference = self.controller(&format!("{quantity}_set[{}]", i + 1));
            power.iter().zip(reference).map(|(p, set)| gains[i] * (p - set)).collect()
        };
        (0..gains.len()).map(of).collect()
    }

    /// A quantity of the grid, battery by battery.
    pub fn of_grid(&self, quantity: &str) -> Vec<Vec<f64>> {
        (1..=self.K_P.len()).map(|i| self.grid(&format!("{quantity}[{i}]")).to_vec()).collect()
    }

    /// A quantity of the controller, battery by battery.
    pub fn of_controller(&self, quantity: &str) -> Vec<Vec<f64>> {
        (1..=self.K_P.len()).map(|i| self.controller(&format!("{quantity}[{i}]")).to_vec()).collect()
    }

    /// E_i / C_i, battery by battery.
    pub fn soc(&self) -> Vec<Vec<f64>> {
        let E = self.of_grid("E");
        E.iter().zip(&self.C).map(|(e, c)| e.iter().map(|e| e / c).collect()).collect()
    }

    /// Indices of the instants in [from, to).
    pub fn between(&self, from_s: f64, to_s: f64) -> std::ops::Range<usize> {
        self.t.partition_point(|t| *t < from_s - 1e-9)..self.t.partition_point(|t| *t < to_s - 1e-9)
    }

    /// Index of the last instant before `t_s`.
    pub fn before(&self, t_s: f64) -> usize {
        self.between(0.0, t_s).end - 1
    }

    /// Largest abs(omega_i - 1) in [from, to).
    pub fn omega_error(&self, from_s: f64, to_s: f64) -> f64 {
        self.worst(from_s, to_s, |k| self.of_at("omega", k).fold(0.0, |w, x| w.max((x - 1.0).abs())))
    }

    fn of_at<'a>(&'a self, quantity: &'a str, k: usize) -> impl Iterator<Item = f64> + 'a {
        (1..=self.K_P.len()).map(move |i| self.grid(&format!("{quantity}[{i}]"))[k])
    }

    /// Largest value of `figure` over the instants in [from, to).
    pub fn worst(&self, from_s: f64, to_s: f64, figure: impl Fn(usize) -> f64) -> f64 {
        let all = self.between(from_s, to_s);
        assert!(!all.is_empty(), "no instant between {from_s} s and {to_s} s");
        // NaN must not pass for a small figure.
        all.map(figure).fold(0.0, |w: f64, x| if x.is_nan() { f64::INFINITY } else { w.max(x) })
    }

    /// Largest spread (largest minus smallest battery) in [from, to).
    pub fn spread(&self, series: &[Vec<f64>], from_s: f64, to_s: f64) -> f64 {
        self.worst(from_s, to_s, |k| spread(series.iter().map(|s| s[k])))
    }

    /// Largest abs(mean over the batteries - reference) in [from, to).
    pub fn mean_error(&self, series: &[Vec<f64>], reference: f64, from_s: f64, to_s: f64) -> f64 {
        let mean = |k: usize| series.iter().map(|s| s[k]).sum::<f64>() / series.len() as f64;
        self.worst(from_s, to_s, |k| (mean(k) - reference).abs())
    }

    /// Largest abs(sum of P_set) at any instant.
    pub fn worst_sum_of_P_set(&self) -> f64 {
        let P_set = self.of_controller("P_set");
        self.worst(0.0, f64::INFINITY, |k| P_set.iter().map(|p| p[k]).sum::<f64>().abs())
    }

    /// Time after `from_s` from which `figure` stays within `tolerance` until `to_s`; none if it does not.
    pub fn settled(
        &self,
        from_s: f64,
        to_s: f64,
        tolerance: f64,
        figure: impl Fn(usize) -> f64,
    ) -> Option<f64> {
        let all = self.between(from_s, to_s);
        let end = all.end;
        let first = all.clone().rev().find(|&k| figure(k) > tolerance).map_or(all.start, |k| k + 1);
        (first < end).then(|| self.t[first] - from_s)
    }

    /// The worst of abs(omega_i - 1) and abs(p_i - mean(p)) at one instant.
    pub fn consensus_error(&self, p: &[Vec<f64>], k: usize) -> f64 {
        let mean = p.iter().map(|p| p[k]).sum::<f64>() / p.len() as f64;
        let sharing = p.iter().fold(0.0, |w: f64, p| w.max((p[k] - mean).abs()));
        self.of_at("omega", k).fold(sharing, |w, x| w.max((x - 1.0).abs()))
    }
}

/// Largest minus smallest.
pub fn spread(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (x.min(low), x.max(high)));
    high - low
}

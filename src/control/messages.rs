//! What agents of one part of a fleet tell their neighbours in another part, once a step: their signals as they were
//! sampled, and how they stand. Plain data; `across` says when it is told and what becomes of it.

use super::delay::{QUANTITIES, Quantity, Signals};
use super::error::Problems;
use super::state::{finite, length};
use serde::{Deserialize, Serialize};

/// Messages of some agents, each about one sample.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Messages {
    /// The signals, by [`Quantity`] and agent: omega, p, V, q, SoC, the estimate of the mean voltage, the share of the
    /// load; pu, SoC a number.
    pub values: [Vec<f64>; QUANTITIES],
    /// How the agents stand.
    pub standing: Standing,
}

/// How agents stand, each field by agent. Both ends of a link act on what both told of the same sample, so that what
/// is exchanged over it is equal and opposite.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Standing {
    /// Takes part: available, and it hears the virtual leader.
    pub available: Vec<bool>,
    /// Its controller acts.
    pub enabled: Vec<bool>,
    /// Links on the shortest way to a pinned agent; 0 for one that is pinned itself.
    pub hops: Vec<i32>,
    /// Links it has more (less) than with everybody available.
    pub links: Vec<i32>,
    /// Ended links that it still carries an exchange of.
    pub ended: Vec<i32>,
}

impl Messages {
    /// Of `n` agents of which nothing was told yet: at rest, and not available. `hops` are those to be expected.
    pub fn unheard(n: usize, hops: Vec<i32>) -> Self {
        let mut values: [Vec<f64>; QUANTITIES] = std::array::from_fn(|_| vec![0.0; n]);
        for quantity in [Quantity::Omega, Quantity::V, Quantity::MeanV] {
            values[quantity as usize].fill(1.0);
        }
        values[Quantity::Soc as usize].fill(0.7);
        let (available, enabled) = (vec![false; n], vec![false; n]);
        Self { values, standing: Standing { available, enabled, hops, links: vec![0; n], ended: vec![0; n] } }
    }

    /// The values of one quantity.
    pub fn of(&self, quantity: Quantity) -> &[f64] {
        &self.values[quantity as usize]
    }

    /// The values of one quantity, to be set.
    pub fn of_mut(&mut self, quantity: Quantity) -> &mut [f64] {
        &mut self.values[quantity as usize]
    }

    /// Takes the signals of these agents over.
    pub(super) fn tell(&mut self, agents: &[usize], signals: &Signals) {
        for (told, all) in self.values.iter_mut().zip(&signals.0) {
            for (told, &i) in told.iter_mut().zip(agents) {
                *told = all[i];
            }
        }
    }

    /// Whether these are messages of `n` agents.
    pub(super) fn check(&self, path: &str, n: usize, problems: &mut Problems) {
        for values in &self.values {
            finite(problems, &format!("{path}.values"), values, n);
        }
        self.standing.check(path, n, problems);
    }
}

impl Standing {
    /// Whether it is that of `n` agents.
    pub(super) fn check(&self, path: &str, n: usize, problems: &mut Problems) {
        let lengths = [self.available.len(), self.enabled.len(), self.hops.len(), self.links.len()];
        for found in lengths.into_iter().chain([self.ended.len()]) {
            length(problems, &format!("{path}.standing"), found, n);
        }
    }
}

//! The communication part of a configuration: distances for the step-by-step graph, or graphs written
//! out. Plain data; `topology` makes graphs of it.

use serde::{Deserialize, Serialize};

/// Where the communication graphs come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Communication {
    /// Clusters, active leaders and edges from the distances between the agents.
    StepByStep(StepByStep),
    /// Graphs written out.
    Explicit(Explicit),
}

impl Communication {
    /// Number of topologies that the input `topology` chooses from.
    pub fn topology_count(&self) -> usize {
        match self {
            Self::StepByStep(s) => s.topologies.len(),
            Self::Explicit(e) => e.topologies.len(),
        }
    }

    /// Name of topology number `k`, from 0.
    pub fn topology_name(&self, k: usize) -> Option<&str> {
        match self {
            Self::StepByStep(s) => s.topologies.get(k).map(|t| t.name.as_str()),
            Self::Explicit(e) => e.topologies.get(k).map(|t| t.name.as_str()),
        }
    }
}

/// The paper's construction: CAK clusters, one active leader each, a virtual leader above them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepByStep {
    /// Symmetric distances, n x n, any unit, zero on the diagonal and positive elsewhere.
    pub distances: Vec<Vec<f64>>,
    /// How a distance becomes a weight.
    #[serde(default)]
    pub weights: Weights,
    /// The topologies to choose from, at least one.
    pub topologies: Vec<StepByStepTopology>,
}

/// How a distance becomes a weight; both lie in (0, 1] and are symmetric.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Weights {
    /// w_ij = d_min / d_ij, d_min the least distance between two agents.
    #[default]
    InverseDistance,
    /// w_ij = d_ij / d_max, the paper's words taken literally.
    Distance,
}

/// One step-by-step topology.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StepByStepTopology {
    /// For people: `a3`.
    pub name: String,
    /// Edges inside each cluster.
    pub inside: Inside,
}

/// Edges inside a cluster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Inside {
    /// The minimum spanning tree of its agents: the paper's a3.
    Tree,
    /// A ring through its agents: the paper's b3. A ring of two is one edge.
    Ring,
}

/// Graphs written out; agent numbers from 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Explicit {
    /// The topologies to choose from, at least one.
    pub topologies: Vec<ExplicitTopology>,
}

/// One graph written out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ExplicitTopology {
    /// For people.
    pub name: String,
    /// Undirected edges, each pair once.
    pub edges: Vec<ExplicitEdge>,
    /// Agents that hear the virtual leader.
    pub pins: Vec<ExplicitPin>,
    /// Cluster number of each agent, n values from 1; shown, not used. Default: all in cluster 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clusters: Option<Vec<u32>>,
    /// Active leaders; shown, not used. Default: the pinned agents.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leaders: Option<Vec<u32>>,
}

/// An undirected edge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ExplicitEdge {
    /// One end, from 1.
    pub a: u32,
    /// The other end, from 1.
    pub b: u32,
    /// w_ij = w_ji > 0.
    pub weight: f64,
    /// tau_ij of this edge, s, >= 0; without it the common `delay_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<f64>,
}

/// A pin to the virtual leader.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ExplicitPin {
    /// The agent, from 1.
    pub agent: u32,
    /// a_0i > 0.
    #[serde(default = "one")]
    pub weight: f64,
}

fn one() -> f64 {
    1.0
}

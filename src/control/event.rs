//! What a user should hear of while the controller runs. Plain data that formats itself; agents, clusters
//! and topologies count from 1 here.

/// Something happened to the graph or to the controller's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The controller began to act.
    Enabled,
    /// The controller holds its setpoints from here on.
    Disabled,
    /// Another topology is in force.
    TopologySwitched {
        /// Its number.
        topology: i32,
    },
    /// A topology was asked for that does not exist.
    TopologyUnknown {
        /// The number asked for.
        asked: i32,
        /// How many there are.
        count: usize,
        /// The one that stays in force.
        kept: i32,
    },
    /// An agent was cut from the graph.
    AgentLeft {
        /// The agent.
        agent: usize,
    },
    /// An agent is back in the graph.
    AgentJoined {
        /// The agent.
        agent: usize,
    },
    /// An agent became an active leader.
    LeaderElected {
        /// The agent.
        agent: usize,
        /// Its cluster.
        cluster: i32,
    },
    /// The available agents are not connected any more.
    GraphInParts {
        /// Number of parts.
        parts: usize,
    },
    /// A part without a pin holds its setpoints.
    PartHolds {
        /// Its lowest agent.
        agent: usize,
    },
    /// The available agents are connected again.
    GraphWhole,
}

impl Event {
    /// The same with the numbers of agents, from 1, changed by a function from places, from 0, to agents.
    pub fn renumbered(mut self, agent_at: impl Fn(usize) -> usize) -> Self {
        match &mut self {
            Self::AgentLeft { agent }
            | Self::AgentJoined { agent }
            | Self::LeaderElected { agent, .. }
            | Self::PartHolds { agent } => *agent = agent_at(agent.saturating_sub(1)) + 1,
            _ => {}
        }
        self
    }

    /// Whether it needs attention, rather than being news.
    pub fn is_warning(self) -> bool {
        matches!(self, Self::TopologyUnknown { .. } | Self::GraphInParts { .. } | Self::PartHolds { .. })
    }
}

impl std::fmt::Display for Event {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Enabled => write!(f, "controller enabled"),
            Self::Disabled => write!(f, "controller disabled: setpoints held"),
            Self::TopologySwitched { topology } => write!(f, "topology {topology} in force"),
            Self::TopologyUnknown { asked, count, kept } => {
                write!(f, "topology: found {asked}, expected 1 to {count}; topology {kept} stays in force")
            }
            Self::AgentLeft { agent } => write!(f, "agent {agent} left: cut from the graph, setpoints held"),
            Self::AgentJoined { agent } => write!(f, "agent {agent} joined"),
            Self::LeaderElected { agent, cluster } => write!(f, "agent {agent} leads cluster {cluster}"),
            Self::GraphInParts { parts } => write!(f, "the communication graph fell into {parts} parts"),
            Self::PartHolds { agent } => {
                write!(f, "the part of agent {agent} hears no virtual leader: it holds its setpoints")
            }
            Self::GraphWhole => write!(f, "the communication graph is connected again"),
        }
    }
}

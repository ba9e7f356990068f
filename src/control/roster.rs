//! What a step of few agents needs of graph and parameters, as it needs it: made once for as long as neither changes.
//! Knows no measurement, no setpoint and no law.

use super::exchange::SECONDS_PER_HOUR;
use super::io::Parameters;
use super::lanes::{LANES, Lanes, lane, load_few};
use super::network::Network;

/// Agents, at most [`LANES`], and their links.
#[derive(Clone, Debug, Default)]
pub(super) struct Roster {
    pub K_P: Lanes,
    pub K_Q: Lanes,
    /// C_i, pu*h; 1 of nobody. And 3600 C_i, pu*s.
    pub capacity: Lanes,
    pub capacity_s: Lanes,
    /// Who takes part, each once, as 0 and 1; and as bits to be kept.
    pub live: Lanes,
    pub kept: [u64; LANES],
    pub links: Vec<Link>,
    pub pulls: Vec<Pull>,
    is_made: bool,
}

/// An edge, and what the exchange along it has to know of its ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    /// The two ends: their lanes, and the agents.
    pub lanes: [usize; 2],
    pub ends: [usize; 2],
    /// w_ab.
    pub weight: f64,
    /// 1 / (1 + max(deg_a, deg_b)).
    pub share: f64,
    /// 3600 min(C_a, C_b), pu*s.
    pub least_s: f64,
    /// 1 + max(peers_a, peers_b).
    pub crowd: f64,
    /// P_exchange_max / peers of the two ends, pu, and the lesser.
    pub limits: [f64; 2],
    pub limit: f64,
}

/// A pin to the virtual leader.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    /// Of the agent.
    pub lane: usize,
    /// a_0i.
    pub weight: f64,
    /// 1 / (1 + deg_i).
    pub share: f64,
}

impl Roster {
    /// Something may have changed.
    pub fn expire(&mut self) {
        self.is_made = false;
    }

    /// Makes it where something may have changed. Allocates nothing while there are no more links than ever before.
    #[inline]
    pub fn renew(&mut self, network: &Network, live: &[bool], parameters: &Parameters) {
        if !self.is_made {
            self.make(network, live, parameters);
        }
    }

    #[cold]
    fn make(&mut self, network: &Network, live: &[bool], parameters: &Parameters) {
        let n = live.len();
        let Parameters { K_P, K_Q, capacity, P_exchange_max, .. } = parameters;
        (self.K_P, self.K_Q) = (load_few(K_P), load_few(K_Q));
        self.capacity = load_few(capacity).map(|capacity| if capacity == 0.0 { 1.0 } else { capacity });
        self.capacity_s = self.capacity.map(|capacity| SECONDS_PER_HOUR * capacity);
        self.live = [0.0; LANES];
        for i in (0..n.min(LANES)).filter(|&i| live[i]) {
            self.live[lane(i, n)] = 1.0;
        }
        self.kept = self.live.map(|live| if live > 0.0 { u64::MAX } else { 0 });
        let peers = |i: usize| f64::from(network.graph.peers(i));
        let limit = |i: usize| P_exchange_max[i] / peers(i);
        self.links.clear();
        self.links.extend(network.graph.edges().iter().zip(&network.shares).map(|(edge, &share)| {
            let (a, b) = edge.ends();
            let limits = [limit(a), limit(b)];
            Link {
                lanes: [lane(a, n), lane(b, n)],
                ends: [a, b],
                weight: edge.weight,
                share,
                least_s: SECONDS_PER_HOUR * capacity[a].min(capacity[b]),
                crowd: (1.0 + peers(a)).max(1.0 + peers(b)),
                limits,
                limit: limits[0].min(limits[1]),
            }
        }));
        self.pulls.clear();
        self.pulls.extend(network.pins.iter().map(|pin| Pull {
            lane: lane(pin.agent, n),
            weight: pin.weight,
            share: pin.share,
        }));
        self.is_made = true;
    }
}

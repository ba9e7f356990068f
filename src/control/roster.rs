//! What a step of few agents needs of graph and parameters, as it needs it: made once for as long as neither changes.
//! Knows no measurement, no setpoint and no law.

use super::exchange::SECONDS_PER_HOUR;
use super::io::Parameters;
use super::lanes::{LANES, Lanes, load_few};
use super::network::Network;

/// Agents and links, at most [`LANES`] of the former.
#[derive(Clone, Debug, Default)]
pub(super) struct Roster {
    pub K_P: Lanes,
    pub K_Q: Lanes,
    /// C_i, pu*h; 1 of nobody. And 3600 C_i, pu*s.
    pub capacity: Lanes,
    pub capacity_s: Lanes,
    /// Who takes part.
    pub live: [bool; LANES],
    pub links: Vec<Link>,
    is_made: bool,
}

/// An edge, and what the exchange along it has to know of its ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    pub a: usize,
    pub b: usize,
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

impl Roster {
    /// Something may have changed.
    pub fn expire(&mut self) {
        self.is_made = false;
    }

    /// Makes it where something may have changed. Allocates nothing while there are no more edges than ever before.
    #[inline]
    pub fn renew(&mut self, network: &Network, live: &[bool], parameters: &Parameters) {
        if !self.is_made {
            self.make(network, live, parameters);
        }
    }

    #[cold]
    fn make(&mut self, network: &Network, live: &[bool], parameters: &Parameters) {
        (self.K_P, self.K_Q) = (load_few(&parameters.K_P), load_few(&parameters.K_Q));
        (self.capacity, self.live) = ([1.0; LANES], [false; LANES]);
        for (to, from) in self.capacity.iter_mut().zip(&parameters.capacity) {
            *to = *from;
        }
        for (to, from) in self.live.iter_mut().zip(live) {
            *to = *from;
        }
        self.capacity_s = self.capacity.map(|capacity| SECONDS_PER_HOUR * capacity);
        let peers = |i: usize| f64::from(network.graph.peers(i));
        let limit = |i: usize| parameters.P_exchange_max[i] / peers(i);
        self.links.clear();
        self.links.extend(network.graph.edges().iter().zip(&network.shares).map(|(edge, &share)| {
            let (a, b) = edge.ends();
            let limits = [limit(a), limit(b)];
            Link {
                a,
                b,
                weight: edge.weight,
                share,
                least_s: SECONDS_PER_HOUR * parameters.capacity[a].min(parameters.capacity[b]),
                crowd: (1.0 + peers(a)).max(1.0 + peers(b)),
                limits,
                limit: limits[0].min(limits[1]),
            }
        }));
        self.is_made = true;
    }
}

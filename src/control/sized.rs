//! The same controller for another number of agents: what a user gets who asks for n agents and says nothing
//! else. Only configurations; what comes out is validated like any other.

use super::communication::{Communication, Explicit, ExplicitEdge, ExplicitPin, ExplicitTopology};
use super::config::Config;

impl Config {
    /// The same options for `n` agents. Values of the agents repeat in turn (of seven, agent 8 has those of agent 1); the
    /// graph is a ring, agent 1 pinned; faults of messages of agents beyond n are left out. For as many agents as there
    /// are, the configuration itself.
    pub fn sized(&self, n: usize) -> Self {
        let mut sized = self.clone();
        if n == self.agents() {
            return sized;
        }
        sized.by_agent().for_each(|values| repeat(values, n));
        sized.message_faults.retain(|fault| fault.agent as usize <= n);
        sized.with_graph("ring".to_owned(), ring(n), vec![ExplicitPin { agent: 1, weight: 1.0 }])
    }

    /// The same with this one graph.
    pub fn with_graph(mut self, name: String, edges: Vec<ExplicitEdge>, pins: Vec<ExplicitPin>) -> Self {
        let topology = ExplicitTopology { name, edges, pins, clusters: None, leaders: None };
        self.communication = Communication::Explicit(Explicit { topologies: vec![topology] });
        self
    }
}

/// As many values as asked for, from the beginning again at the end.
fn repeat(values: &mut Vec<f64>, n: usize) {
    let known = values.len();
    values.truncate(n);
    for i in known..n {
        // None only where there is none at all, which the validation finds.
        values.extend(values.get(i - known).copied());
    }
}

/// 1 - 2 - ... - n - 1, of weight 1. A ring of two is one edge.
pub fn ring(n: usize) -> Vec<ExplicitEdge> {
    let edge = |a: usize, b: usize| ExplicitEdge { a: a as u32, b: b as u32, weight: 1.0, delay_s: None };
    let closing = (n > 2).then(|| edge(n, 1));
    (1..n).map(|i| edge(i, i + 1)).chain(closing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_three() -> Config {
        let graph = Explicit { topologies: Vec::new() };
        let config = Config::unit(3, Communication::Explicit(graph));
        let pins = vec![ExplicitPin { agent: 1, weight: 1.0 }];
        Config { K_P: vec![1.0, 2.0, 3.0], ..config }.with_graph("path".to_owned(), ring(3), pins)
    }

    #[test]
    fn values_repeat_in_turn_and_the_graph_is_a_ring() {
        let mut config = of_three();
        config.limits.P_max = Some(vec![4.0, 5.0, 6.0]);
        for (n, K_P) in [(1, vec![1.0]), (2, vec![1.0, 2.0]), (5, vec![1.0, 2.0, 3.0, 1.0, 2.0])] {
            let sized = config.sized(n);
            assert_eq!(sized.validate(), Ok(()), "{n}");
            assert_eq!(sized.K_P, K_P);
            assert_eq!(sized.limits.P_max.unwrap().len(), n);
        }
        let sevenfold = config.sized(21);
        assert!((0..21).all(|i| sevenfold.K_P[i] == f64::from(i as u32 % 3 + 1)));
    }

    #[test]
    fn as_many_agents_change_nothing() {
        assert_eq!(of_three().sized(3), of_three());
    }

    #[test]
    fn rings_have_as_many_edges_as_agents() {
        let ends = |n| ring(n).iter().map(|e| (e.a, e.b)).collect::<Vec<_>>();
        assert_eq!(ends(1), []);
        assert_eq!(ends(2), [(1, 2)]);
        assert_eq!(ends(4), [(1, 2), (2, 3), (3, 4), (4, 1)]);
    }
}

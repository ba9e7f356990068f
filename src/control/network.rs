//! A graph made ready for the hot path: the shares of the caps, the pins as a list, and for every link
//! the time of what its ends know of each other. The kernel of all protocols sums flows over it.

use super::config::Channel;
use super::delay::{Bracket, History, Quantity};
use super::discretisation::Flow;
use super::graph::{Edge, Graph};
use super::outer::Outer;
use super::outlier::{Link, Trimming};
use super::scalar::Scalar;

/// A pin to the virtual leader.
#[derive(Clone, Copy, Debug)]
pub struct Pin {
    /// The agent, from 0.
    pub agent: usize,
    /// a_0i.
    pub weight: f64,
    /// 1 / (1 + deg_i).
    pub share: f64,
    /// The longest delay of the agent's own links, ns.
    pub delay_ns: i64,
    /// Whether that link has no delay of its own.
    pub follows_common: bool,
}

/// The graph in force, prepared.
#[derive(Clone, Debug, Default)]
pub struct Network {
    /// The graph itself.
    pub graph: Graph,
    /// The pins.
    pub pins: Vec<Pin>,
    /// 1 / (1 + max(deg_i, deg_j)) of each edge.
    pub shares: Vec<f64>,
    /// 1 / (1/2 + max(peers_i, peers_j)) of each edge: the shares of `estimator` where messages take time.
    pub round_shares: Vec<f64>,
    /// tau of each edge, ns.
    pub delays_ns: Vec<i64>,
    longest_delay_ns: i64,
    longest_follows_common: bool,
    /// For each edge, when what `a` knows of `b`, and `b` of `a`, was true. Empty while all is present.
    known: Vec<[Bracket; 2]>,
    /// The same at both ends: the older of the two.
    agreed: Vec<Agreed>,
    /// Whose end of each edge has heard nothing for too long; empty where that does not count.
    deaf: Vec<[bool; 2]>,
    trimming: Option<Trimming>,
    pub(super) outer: Option<Outer>,
}

/// What the two ends of an edge both know of each other.
#[derive(Clone, Copy, Debug)]
struct Agreed {
    at: Bracket,
    /// Age of it, ns.
    age_ns: i64,
}

impl Agreed {
    const NOW: Self = Self { at: Bracket::NOW, age_ns: 0 };
}

/// Which end of an edge listens.
const ENDS: [usize; 2] = [0, 1];

impl Network {
    /// Prepares a graph.
    pub fn new(graph: Graph) -> Self {
        let share = |degree: u32| 1.0 / (1.0 + f64::from(degree));
        let shares =
            graph.edges().iter().map(|e| share(graph.degree(e.a as usize).max(graph.degree(e.b as usize))));
        let pins = graph.pins().iter().enumerate().filter(|&(_, &weight)| weight > 0.0);
        let pins = pins.map(|(agent, &weight)| Pin {
            agent,
            weight,
            share: share(graph.degree(agent)),
            delay_ns: 0,
            follows_common: false,
        });
        let peers = |e: &Edge| f64::from(graph.peers(e.a as usize).max(graph.peers(e.b as usize)));
        let round_shares = graph.edges().iter().map(|e| 1.0 / (0.5 + peers(e))).collect();
        let (shares, pins) = (shares.collect(), pins.collect());
        let delays_ns = vec![0; graph.edges().len()];
        Self {
            graph,
            pins,
            shares,
            round_shares,
            delays_ns,
            longest_delay_ns: 0,
            longest_follows_common: false,
            known: Vec::new(),
            agreed: Vec::new(),
            deaf: Vec::new(),
            trimming: None,
            outer: None,
        }
    }

    /// The same with the `f` largest and smallest values sorted out at each agent, see `outlier`.
    pub fn sorting_out(self, f: u32) -> Self {
        Self { trimming: Trimming::new(&self.graph, f), ..self }
    }

    /// Sets the delay of the edges that have none of their own, and makes room for what they need.
    pub fn set_delay(&mut self, common_ns: i64, channel: &Channel, silence_ns: Option<i64>) {
        for (delay, edge) in self.delays_ns.iter_mut().zip(self.graph.edges()) {
            *delay = edge.delay_ns.unwrap_or(common_ns);
            if let Some(outer) = self.outer.as_ref().filter(|outer| outer.crosses_edge(edge)) {
                *delay = (*delay).max(outer.step_ns);
            }
        }
        let delays = self.delays_ns.iter().zip(self.graph.edges());
        let longest = delays.max_by_key(|(delay, _)| **delay);
        self.longest_delay_ns = longest.map_or(0, |(&delay, _)| delay);
        self.longest_follows_common = longest.is_some_and(|(_, edge)| edge.delay_ns.is_none());
        if let Some(outer) = &self.outer {
            let elsewhere = outer.longest_delay_ns.max(if outer.has_common_delay { common_ns } else { 0 });
            if elsewhere > self.longest_delay_ns {
                self.longest_delay_ns = elsewhere;
                self.longest_follows_common = outer.has_common_delay && elsewhere == common_ns;
            }
        }
        for pin in &mut self.pins {
            (pin.delay_ns, pin.follows_common) = (0, false);
        }
        for (&delay, edge) in self.delays_ns.iter().zip(self.graph.edges()) {
            for end in [edge.a, edge.b] {
                if let Ok(k) = self.pins.binary_search_by_key(&(end as usize), |pin| pin.agent)
                    && delay >= self.pins[k].delay_ns
                {
                    (self.pins[k].delay_ns, self.pins[k].follows_common) = (delay, edge.delay_ns.is_none());
                }
            }
        }
        let keeps_times = channel.keeps_times(silence_ns);
        let edges = if self.longest_delay_ns() > 0 || keeps_times { self.delays_ns.len() } else { 0 };
        self.deaf = vec![[false; 2]; if silence_ns.is_some() { edges } else { 0 }];
        self.known = vec![[Bracket::NOW; 2]; edges];
        self.agreed = vec![Agreed::NOW; edges];
    }

    /// Whether agents know each other's present: nothing is delayed, nothing lost.
    pub fn is_present(&self) -> bool {
        self.known.is_empty()
    }

    /// The longest delay, ns.
    pub fn longest_delay_ns(&self) -> i64 {
        self.longest_delay_ns
    }

    /// Whether that is an edge without a delay of its own.
    pub fn longest_follows_common(&self) -> bool {
        self.longest_follows_common
    }

    /// Finds out what the agents know of each other at `now_ns`, sample number `sample`. Where the times of the
    /// last messages count, `last_ns` are those, two per edge, and `next_ns` becomes theirs now.
    pub fn listen(
        &mut self,
        history: &History,
        (now_ns, sample): (i64, u64),
        hearing: Hearing<'_>,
        last_ns: &[i64],
        next_ns: &mut [i64],
    ) {
        let Hearing { channel, silence_ns, mute } = hearing;
        let keeps_times = channel.keeps_times(silence_ns);
        for e in 0..self.known.len() {
            let mut punctual = now_ns.saturating_sub(self.delays_ns[e]);
            let edge = self.graph.edges()[e];
            if let (true, Some(newest_ns)) = (self.crosses(edge.a, edge.b), history.newest_ns()) {
                // Of another part nothing younger can have arrived.
                punctual = punctual.min(newest_ns);
            }
            let mut times = [punctual; 2];
            if keeps_times {
                for (end, (from, to)) in ENDS.into_iter().zip([(edge.b, edge.a), (edge.a, edge.b)]) {
                    let last = last_ns[2 * e + end];
                    let is_mute = mute.get(from as usize) == Some(&true);
                    let [sender, receiver] = [from, to].map(|i| self.number(i));
                    times[end] = if is_mute {
                        last
                    } else {
                        channel.received(sender, receiver, sample, punctual, last)
                    };
                    next_ns[2 * e + end] = times[end];
                    if let (Some(silence_ns), Some(deaf)) = (silence_ns, self.deaf.get_mut(e)) {
                        deaf[end] = now_ns.saturating_sub(times[end]) > silence_ns;
                    }
                }
            }
            self.known[e] = times.map(|t| history.bracket(now_ns, t));
            for end in ENDS {
                // A message that was not overtaken stays what it was, however long the delay.
                if keeps_times && times[end] == last_ns[2 * e + end] {
                    self.known[e][end] = self.known[e][end].fixed();
                }
            }
            let older = usize::from(times[1] < times[0]);
            let age_ns = now_ns.saturating_sub(times[older]).max(0);
            self.agreed[e] = Agreed { at: self.known[e][older], age_ns };
        }
    }

    /// out_i -= sum_j f(x_i - x_j): the sum of all protocols. The neighbour's value is what it told, and delayed;
    /// one's own is neither (34). An edge on which nothing is delayed and nothing wrong is told is visited once:
    /// f_ij = -f_ji to the last bit.
    pub fn diffuse<S: Scalar>(
        &self,
        (history, late): (&History, Lateness<S>),
        (quantity, x, told): (Quantity, &[S], &[S]),
        flow: &Flow<S>,
        out: &mut [S],
    ) {
        if let Some(trimming) = &self.trimming {
            return self.diffuse_trimmed(trimming, (history, late), (quantity, x, told), flow, out);
        }
        let is_true = std::ptr::eq(x, told);
        for (e, edge) in self.graph.edges().iter().enumerate() {
            let (a, b) = edge.ends();
            let known = self.known.get(e).copied().unwrap_or([Bracket::NOW; 2]);
            let deaf = self.deaf.get(e).copied().unwrap_or([false; 2]);
            if self.is_closed(a, b) {
                continue;
            }
            let late = late.of(edge.delay_ns);
            let along = |d: S| flow.along(edge.weight, d, self.shares[e]);
            if known == [Bracket::NOW; 2] && is_true && deaf == [false; 2] {
                let f = along(x[a] - x[b]);
                out[a] = out[a] - f;
                out[b] = out[b] + f;
            } else {
                let of = |end: usize, i: usize| self.value(history, known[end], (quantity, i), told, late);
                if !deaf[0] {
                    out[a] = out[a] - along(x[a] - of(0, b));
                }
                if !deaf[1] {
                    out[b] = out[b] + along(of(1, a) - x[b]);
                }
            }
        }
    }

    /// The same, each agent leaving out what `trimming` says. Whom it has not heard for too long does not count
    /// among its neighbours; then it may have too few to leave any out.
    fn diffuse_trimmed<S: Scalar>(
        &self,
        trimming: &Trimming,
        (history, late): (&History, Lateness<S>),
        (quantity, x, told): (Quantity, &[S], &[S]),
        flow: &Flow<S>,
        out: &mut [S],
    ) {
        for i in 0..out.len() {
            let links = trimming.links(i);
            let hears = |link: &Link| {
                self.deaf.get(link.edge as usize).is_none_or(|deaf| !deaf[usize::from(link.end)])
                    && !self.is_closed(i, link.neighbour as usize)
            };
            let value = |link: &Link| {
                let e = link.edge as usize;
                let known = self.known.get(e).map_or(Bracket::NOW, |known| known[usize::from(link.end)]);
                let late = late.of(self.graph.edges()[e].delay_ns);
                self.value(history, known, (quantity, link.neighbour as usize), told, late)
            };
            for link in links.iter().filter(|link| hears(link)) {
                if trimming.keeps(link, links, hears, |link| value(link).value()) {
                    let e = link.edge as usize;
                    out[i] =
                        out[i] - flow.along(self.graph.edges()[e].weight, x[i] - value(link), self.shares[e]);
                }
            }
        }
    }

    /// out_i -= a_0i s(x_i - reference) at the pinned agents, capped alike.
    pub fn pull<S: Scalar>(&self, x: &[S], reference: S, flow: &Flow<S>, out: &mut [S]) {
        for pin in &self.pins {
            let f = flow.along(pin.weight, x[pin.agent] - reference, pin.share);
            out[pin.agent] = out[pin.agent] - f;
        }
    }

    /// The same with no pull faster than one gap in the time of the agent's slowest link.
    pub fn pull_by_rounds<S: Scalar>(
        &self,
        x: &[S],
        (reference, late): (S, Lateness<S>),
        flow: &Flow<S>,
        out: &mut [S],
    ) {
        let c = S::constant;
        for pin in &self.pins {
            let longer = if pin.follows_common { c(1e9) * late.delay } else { c(0.0) };
            // At no delay this is infinite and leaves theta alone.
            let round = c(1e9) / (c(pin.share) * (c(pin.delay_ns as f64) + longer));
            let flow = Flow { inverse_theta: flow.inverse_theta.min(round), ..*flow };
            let f = flow.along(pin.weight, x[pin.agent] - reference, pin.share);
            out[pin.agent] = out[pin.agent] - f;
        }
    }

    /// The values at the two ends of edge `e` at the time that both know of: the differences of a
    /// physical exchange must be the same at both ends.
    pub fn agreed(&self, e: usize, history: &History, quantity: Quantity, x: &[f64]) -> (f64, f64) {
        self.agreed_late(e, (history, Lateness::default()), quantity, x)
    }

    /// The same a little later or earlier.
    pub fn agreed_late<S: Scalar>(
        &self,
        e: usize,
        (history, late): (&History, Lateness<S>),
        quantity: Quantity,
        x: &[S],
    ) -> (S, S) {
        let edge = self.graph.edges()[e];
        let (a, b) = edge.ends();
        let late = late.of(edge.delay_ns);
        let of = |at: Bracket, i: usize| self.value(history, at, (quantity, i), x, late);
        match self.agreed.get(e) {
            None => (x[a], x[b]),
            Some(&Agreed { at, .. }) => (of(at, a), of(at, b)),
        }
    }

    /// The transfer of edge `e` at that time, and the age of it, ns.
    pub fn agreed_transfer(&self, e: usize, history: &History, present: &[f64]) -> (f64, i64) {
        match self.agreed.get(e) {
            None => (present[e], 0),
            Some(&Agreed { at, age_ns }) => (history.transfer(at, e, present), age_ns),
        }
    }
}

/// How messages reach their receivers.
#[derive(Clone, Copy)]
pub struct Hearing<'a> {
    /// What may happen to them on their way.
    pub channel: &'a Channel,
    /// After how long without one a neighbour does not count any more, ns.
    pub silence_ns: Option<i64>,
    /// Agents that send none; empty where all do.
    pub mute: &'a [bool],
}

/// By how much messages are later than the network knows, s: 0, but in a derivative along a delay or time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lateness<S = f64> {
    /// By which all points in the past are earlier.
    pub past: S,
    /// By which the delay of edges without one of their own is longer.
    pub delay: S,
}

impl<S: Scalar> Lateness<S> {
    /// On an edge with this delay of its own.
    fn of(&self, delay_ns: Option<i64>) -> S {
        if delay_ns.is_some() { self.past } else { self.past + self.delay }
    }
}

//! The step of many agents in one sweep over memory: the laws of `protocol` and `exchange` where nothing is
//! delayed, limited, filtered or averaged, in vector code picked for the processor at run time. Gives the bits
//! of `evaluate` and `step`, which do everything else; a test compares them.

use super::ahead::Ahead;
use super::blocks::{Block, Layout, Shape};
use super::config::VoltagePolicy;
use super::controller::Controller;
use super::diagnosis::{Diagnosis, Seen};
use super::diagonals::{self, place, places};
use super::discretisation::Flow;
use super::exchange::SECONDS_PER_HOUR;
use super::kernels::{self, Ends, Stores};
use super::lag::{Tally, reveal};
use super::network::Pin;
use super::plain::Pass;
use super::state::State;
use super::time::seconds;
use super::wave::{BATCH, Stages, Wave, Window, Work, at};
use pulp::{Arch, NullaryFnOnce};
use std::ops::Range;

/// Rows of a block that are taken together: between them the memory is asked for what comes next. Fewer or more
/// were slower.
const PIECE: usize = 64;

/// Everything that the stages read and write.
struct Sweep<'a> {
    state: &'a mut State,
    live: &'a [bool],
    peers: &'a [u32],
    pins: &'a [Pin],
    /// The first pin whose agent is not measured, and not finished.
    next_pin: [usize; 2],
    /// Of omega, p, V, q.
    laws: [Flow; at::LAWS],
    /// With 3600 g_E, and theta_E in place of 1 / theta.
    exchange: Flow,
    fade: f64,
    h_s: f64,
    /// Whether setpoints move, or only what follows the inputs at once.
    moves: bool,
    looks: bool,
    adds_unseen: [bool; 2],
    tallies: [Tally; 2],
    diagnosis: Diagnosis,
}

impl Controller {
    /// Whether a sweep can do what a step has to.
    pub(super) fn is_plain(&self) -> bool {
        let (state, fixed) = (&self.state, &self.fixed);
        state.adopted.enable
            && fixed.is_plain
            && state.parameters.voltage_policy == VoltagePolicy::Paper
            && self.network.is_present()
            && !state.history.is_kept()
            && state.held.is_empty()
            && state.fades.alike().is_some()
    }

    /// As `evaluate`; with `moves` also as `advance`, but for what time and exchange leave behind.
    pub(super) fn sweep(&mut self, h_ns: i64, pass: Pass) {
        let h_s = seconds(h_ns);
        let lags = &self.state.lags;
        let parameters = &self.state.parameters;
        let laws = [
            self.flow(parameters.gain_omega, &lags.frequency, h_s),
            self.flow(parameters.gain_P, &lags.frequency, h_s),
            self.flow(parameters.gain_V, &lags.voltage, h_s),
            self.flow(parameters.gain_Q, &lags.voltage, h_s),
        ];
        let up_to_date = self.is_up_to_date();
        let inputs = &self.state.inputs;
        let diagnosis =
            Diagnosis::new(inputs.omega_ref, inputs.V_ref, inputs.dispatch.then_some(inputs.P_ref));
        let exchange = Flow {
            power: laws[0].power,
            gain: SECONDS_PER_HOUR * parameters.gain_E,
            inverse_theta: self.exchange_layer(h_s).max(0.0),
        };
        let mut sweep = Sweep {
            laws,
            exchange,
            fade: self.fade(h_ns),
            h_s,
            moves: pass.moves(),
            looks: pass.looks(),
            adds_unseen: [
                lags.frequency.adds_unseen() && up_to_date,
                lags.voltage.adds_unseen() && up_to_date,
            ],
            tallies: Default::default(),
            diagnosis,
            live: &self.topology.live,
            peers: self.network.graph.all_peers(),
            pins: &self.network.pins,
            next_pin: [0; 2],
            state: &mut self.state,
        };
        let (wave, n) = (&mut self.scratch.wave, self.topology.live.len());
        Arch::new().dispatch(Run { wave, n, sweep: &mut sweep });
        let (diagnosis, tallies) = (sweep.diagnosis, sweep.tallies);
        if pass.moves() {
            let [frequency, voltage] = tallies;
            self.state.lags.frequency.conclude(frequency);
            self.state.lags.voltage.conclude(voltage);
        }
        self.tell(pass.looks().then_some(&diagnosis));
    }
}

/// A function that is compiled for each kind of processor.
struct Run<'a, 'b> {
    wave: &'a mut Wave,
    n: usize,
    sweep: &'a mut Sweep<'b>,
}

impl NullaryFnOnce for Run<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.wave.run(self.n, self.sweep);
    }
}

impl Stages for Sweep<'_> {
    #[inline(always)]
    fn measure(&mut self, from: usize, to: usize, window: &mut Window) {
        let State { inputs, parameters, outputs, lags, .. } = &*self.state;
        let r = from..to;
        let own = window.of(from, to);
        let [omega, p, V, q, soc, capacity, limit, share, crowd] =
            window.signals.each_mut().map(|values| &mut values[own.clone()]);
        omega.copy_from_slice(&inputs.omega[r.clone()]);
        V.copy_from_slice(&inputs.V[r.clone()]);
        capacity.copy_from_slice(&parameters.capacity[r.clone()]);
        kernels::droop(p, &parameters.K_P[r.clone()], &inputs.P[r.clone()], &outputs.P_set[r.clone()]);
        kernels::droop(q, &parameters.K_Q[r.clone()], &inputs.Q[r.clone()], &outputs.Q_set[r.clone()]);
        kernels::quotient(soc, &inputs.E[r.clone()], capacity);
        kernels::crowd((share, crowd), limit, &self.peers[r.clone()], &parameters.P_exchange_max[r.clone()]);
        while let Some(pin) = self.pins.get(self.next_pin[0]).filter(|pin| pin.agent < to) {
            share[pin.agent - from] = pin.share;
            self.next_pin[0] += 1;
        }
        if let Some(shown) = lags.frequency.shown().filter(|_| self.adds_unseen[0]) {
            let set = &outputs.omega_set[r.clone()];
            reveal(omega, &shown[r.clone()], (set, &parameters.K_P[r.clone()], &outputs.P_set[r.clone()]));
        }
        if let Some(shown) = lags.voltage.shown().filter(|_| self.adds_unseen[1]) {
            let set = &outputs.V_set[r.clone()];
            reveal(V, &shown[r.clone()], (set, &parameters.K_Q[r.clone()], &outputs.Q_set[r]));
        }
    }

    #[inline(always)]
    fn flow(&mut self, block: &Block, layout: &Layout, window: &mut Window, work: &mut Work) {
        match &block.shape {
            Shape::Diagonals { offsets, places } => {
                let offsets = &layout.offsets[offsets.clone()];
                let places = places.map(|from| &layout.places[from..from + block.edges.len()]);
                self.along_diagonals(block, (offsets, places), &layout.weights, window, work);
            }
            Shape::Scattered { ends } => {
                let mut edges = block.edges.clone();
                let (mut ends, mut weights) = (*ends, block.weights);
                while !edges.is_empty() {
                    let count = edges.len().min(BATCH);
                    let batch = (&layout.ends[ends..ends + count], &layout.weights[weights..weights + count]);
                    self.one_by_one(edges.start, batch, window, work);
                    (edges.start, ends, weights) = (edges.start + count, ends + count, weights + count);
                }
            }
        }
    }

    #[inline(always)]
    fn finish(&mut self, from: usize, to: usize, window: &mut Window) {
        let State { inputs, parameters, outputs, lags, adopted, clock, .. } = &mut *self.state;
        let own = window.of(from, to);
        let signals = window.signals.each_ref().map(|values| &values[own.clone()]);
        let sums = window.sums.each_mut().map(|values| &mut values[own.clone()]);
        while let Some(pin) = self.pins.get(self.next_pin[1]).filter(|pin| pin.agent < to) {
            let i = pin.agent - from;
            let [omega, P, V, _] = &self.laws;
            sums[0][i] -= omega.along(pin.weight, signals[0][i] - inputs.omega_ref, pin.share);
            if inputs.dispatch {
                sums[1][i] -= P.along(pin.weight, signals[1][i] - inputs.P_ref, pin.share);
            }
            sums[2][i] -= V.along(pin.weight, signals[2][i] - inputs.V_ref, pin.share);
            self.next_pin[1] += 1;
        }
        let sums = sums.map(|values| &*values);
        if self.moves {
            let compare = clock.samples > 0;
            let [frequency, voltage] = &mut self.tallies;
            lags.frequency.note(
                frequency,
                (from, to),
                (self.live, compare),
                (&inputs.omega, &outputs.omega_set),
                (&parameters.K_P, &inputs.P, &outputs.P_set),
            );
            lags.voltage.note(
                voltage,
                (from, to),
                (self.live, compare),
                (&inputs.V, &outputs.V_set),
                (&parameters.K_Q, &inputs.Q, &outputs.Q_set),
            );
        }
        let (h_s, live, r) = (self.h_s, &self.live[from..to], from..to);
        kernels::sum(&mut outputs.u_omega[r.clone()], sums[0], sums[1]);
        outputs.u_P[r.clone()].copy_from_slice(sums[1]);
        kernels::sum(&mut outputs.u_V[r.clone()], sums[2], sums[3]);
        outputs.u_Q[r.clone()].copy_from_slice(sums[3]);
        kernels::energy_rate(&mut outputs.u_E[r.clone()], sums[at::SOC], signals[at::CAPACITY], live);
        kernels::exceeds(&mut outputs.saturated[r.clone()], sums[at::WANTED], signals[at::LIMIT]);
        if self.moves {
            kernels::advance(&mut outputs.omega_set[r.clone()], h_s, &outputs.u_omega[r.clone()], live);
            kernels::advance(&mut outputs.V_set[r.clone()], h_s, &outputs.u_V[r.clone()], live);
            kernels::take(&mut outputs.P_set[r.clone()], sums[at::SOC], live);
        }
        if !self.looks {
            return;
        }
        let [omega, p, V, q, soc, ..] = signals;
        self.diagnosis.take(Seen {
            available: &adopted.available[r],
            live,
            told_p: p,
            own: [omega, p, V, q, soc],
        });
    }
}

impl Sweep<'_> {
    /// The flows of a block along its diagonals.
    #[inline(always)]
    fn along_diagonals(
        &mut self,
        block: &Block,
        (offsets, gaps): (&[u32], Option<&[u32]>),
        weights: &[f64],
        window: &mut Window,
        work: &mut Work,
    ) {
        if offsets.is_empty() {
            return;
        }
        let rows = block.rows;
        let own = window.of(block.first, block.first + rows);
        let ahead = Ahead::of(block, offsets, self.live.len());
        let of = |k: usize| k * rows..(k + 1) * rows;
        let ends = |quantity: usize, offset: u32| {
            let (values, offset) = (&window.signals[quantity], offset as usize);
            (&values[own.clone()], &values[own.start + offset..own.end + offset])
        };
        let sums = &mut window.sums;
        for (k, &offset) in offsets.iter().enumerate() {
            kernels::smaller(&mut work.shares[of(k)], ends(at::SHARE, offset));
        }
        let pieces = || (0..rows).step_by(PIECE).map(|from| from..rows.min(from + PIECE));
        let along = |k: usize, piece: &Range<usize>| {
            block.weights + k * rows + piece.start..block.weights + k * rows + piece.end
        };
        for (quantity, law) in self.laws.iter().enumerate() {
            for piece in pieces() {
                for (k, &offset) in offsets.iter().enumerate() {
                    let x = part(ends(quantity, offset), &piece);
                    let (weights, shares) = (&weights[along(k, &piece)], &work.shares[of(k)][piece.clone()]);
                    let flows = &mut work.flows[places(k, rows)][piece.clone()];
                    kernels::flows(flows, x, weights, shares, law);
                }
                ahead.ask(quantity, &piece, &*self.state, (self.live, self.peers));
            }
            diagonals::give(&work.flows, offsets, rows, &mut sums[quantity][own.start..]);
        }
        for piece in pieces() {
            for (k, &offset) in offsets.iter().enumerate() {
                let of_piece = |quantity: usize| part(ends(quantity, offset), &piece);
                let stores = Stores {
                    soc: of_piece(at::SOC),
                    capacity: of_piece(at::CAPACITY),
                    crowd: of_piece(at::CROWD),
                    limit: of_piece(at::LIMIT),
                };
                let flows = &mut work.flows[places(k, rows)][piece.clone()];
                let wanted = &mut work.wanted[places(k, rows)][piece.clone()];
                kernels::exchange(flows, wanted, stores, &weights[along(k, &piece)], &self.exchange);
            }
            ahead.ask_edges(block, &piece, weights, &self.state.flows);
        }
        diagonals::raise(&work.wanted, offsets, rows, &mut sums[at::WANTED][own.start..]);
        let last = &mut self.state.flows[block.edges.clone()];
        let how = (self.fade, self.moves);
        match gaps {
            Some(places) => {
                for (last, &place) in last.iter_mut().zip(places) {
                    settle(&mut work.flows[place as usize], last, how);
                }
            }
            None if self.fade < 1.0 => {
                for (row, last) in last.chunks_exact_mut(offsets.len()).enumerate() {
                    for (k, last) in last.iter_mut().enumerate() {
                        settle(&mut work.flows[place(k, row)], last, how);
                    }
                }
            }
            None if self.moves => diagonals::remember(&work.flows, offsets.len(), last),
            None => {}
        }
        diagonals::give(&work.flows, offsets, rows, &mut sums[at::SOC][own.start..]);
    }

    /// The flows of edges wherever their ends are; `first` is the first of them.
    #[inline(always)]
    fn one_by_one(
        &mut self,
        first: usize,
        (edges, weights): (&[[u32; 2]], &[f64]),
        window: &mut Window,
        work: &mut Work,
    ) {
        let count = edges.len();
        let origin = window.origin();
        let Window { signals, sums, .. } = window;
        let Work { lower, higher, batch, .. } = work;
        for (k, edge) in edges.iter().enumerate() {
            let [a, b] = edge.map(|end| end as usize - origin);
            for (values, (lower, higher)) in signals.iter().zip(lower.iter_mut().zip(higher.iter_mut())) {
                (lower[k], higher[k]) = (values[a], values[b]);
            }
        }
        let ends = |quantity: usize| (&lower[quantity][..count], &higher[quantity][..count]);
        let [flows @ .., exchange, wanted, shares] = batch;
        kernels::smaller(&mut shares[..count], ends(at::SHARE));
        for (quantity, (law, flows)) in self.laws.iter().zip(flows.iter_mut()).enumerate() {
            kernels::flows(&mut flows[..count], ends(quantity), weights, &shares[..count], law);
        }
        let stores = Stores {
            soc: ends(at::SOC),
            capacity: ends(at::CAPACITY),
            crowd: ends(at::CROWD),
            limit: ends(at::LIMIT),
        };
        kernels::exchange(&mut exchange[..count], &mut wanted[..count], stores, weights, &self.exchange);
        let last = &mut self.state.flows[first..first + count];
        for (flow, last) in exchange.iter_mut().zip(last) {
            settle(flow, last, (self.fade, self.moves));
        }
        for (k, edge) in edges.iter().enumerate() {
            let [a, b] = edge.map(|end| end as usize - origin);
            for (sums, flows) in sums.iter_mut().zip(batch.iter()).take(at::SOC + 1) {
                sums[a] -= flows[k];
                sums[b] += flows[k];
            }
            let most = &mut sums[at::WANTED];
            for end in [a, b] {
                let wanted = &batch[at::WANTED][k..=k];
                kernels::raise(&mut most[end..=end], (wanted, wanted));
            }
        }
    }
}

/// The same of some rows.
#[inline(always)]
fn part<'a>((lower, higher): Ends<'a>, rows: &Range<usize>) -> Ends<'a> {
    (&lower[rows.clone()], &higher[rows.clone()])
}

/// Lets the exchange fade in from what it was, and remembers it, positive from the lower end, where it `moves`.
#[inline(always)]
fn settle(flow: &mut f64, last: &mut f64, (fade, moves): (f64, bool)) {
    if fade < 1.0 {
        *flow = -(*last + fade * (-*flow - *last));
    }
    if moves {
        *last = -*flow;
    }
}

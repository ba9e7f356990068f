//! The controller: inputs in, setpoints out, one step at a time. Holds the state and what is derived from
//! it; the laws are in `protocol`, what a step does in `step`, what a changed graph does in `adopt`.

use super::across::Across;
use super::authority::Authority;
use super::config::{Config, Law, MeasurementFilter};
use super::delay::{History, QUANTITIES, Signals};
use super::error::ConfigError;
use super::event::Event;
use super::exchange::Exchange;
use super::fade::{self, Fades, Left};
use super::few::FEW;
use super::io::{Inputs, Outputs, Parameters};
use super::lag::Lag;
use super::limits::LimitTable;
use super::messages::{Messages, Standing};
use super::network::{Lateness, Network};
use super::plain::{Pass, is_plain};
use super::roster::Roster;
use super::state::{Adopted, Before, Clock, Lags, State};
use super::time::{nanoseconds, seconds};
use super::told::MessageFault;
use super::topology::{Topologies, Topology};
use super::wave::Wave;
use super::{adopt::Spectrum, config::Channel, discretisation::SignPower};

/// A distributed finite-time consensus controller of n BESS.
///
/// A master sets [`inputs_mut`](Self::inputs_mut), calls [`refresh`](Self::refresh) to read what follows
/// them at once, and [`step`](Self::step) to advance the setpoints. A clone, or a [`State`] put back,
/// goes on bit-identically.
#[derive(Clone, Debug)]
pub struct Controller {
    pub(super) state: State,
    pub(super) fixed: Fixed,
    pub(super) topologies: Topologies,
    /// The topology in force, without its graph, which is in `network`.
    pub(super) topology: Topology,
    pub(super) network: Network,
    pub(super) spectrum: Spectrum,
    pub(super) scratch: Scratch,
}

/// What the configuration fixes and no parameter changes.
#[derive(Clone, Debug)]
pub(super) struct Fixed {
    pub law: Law,
    pub limits: LimitTable,
    pub filter: MeasurementFilter,
    pub channel: Channel,
    pub no_circulation: bool,
    pub lost_link_fade_s: Option<f64>,
    pub exchange_fade_s: f64,
    pub silence_ns: Option<i64>,
    pub outlier_filter: u32,
    pub message_faults: Vec<MessageFault>,
    pub across: Option<Across>,
    /// Whether no option asks for more than `sweep` does.
    pub is_plain: bool,
}

/// Working arrays: written anew in every evaluation, so that a step allocates nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    pub signals: Signals,
    pub filtered: Vec<f64>,
    pub flows: Vec<f64>,
    /// z_ij after the step.
    pub transfers: Vec<f64>,
    pub received_ns: Vec<i64>,
    pub P_set: Vec<f64>,
    /// Room to rise and to fall in P, then in Q.
    pub room: [Vec<f64>; 4],
    /// What the step makes of the same of the state.
    pub shares: Vec<f64>,
    pub followed: Vec<f64>,
    pub owed: [Vec<f64>; 2],
    pub authority: Vec<Authority>,
    pub wave: Wave,
    pub roster: Roster,
    /// Ended links by agent.
    pub ended: Vec<u32>,
    /// What agents tell, who tells nothing and who has stopped; empty without faults of messages.
    pub told: Signals,
    pub mute: Vec<bool>,
    pub frozen: Vec<bool>,
    /// Links to the nearest pinned agent, by agent; of a part only.
    pub hops: Vec<i32>,
    /// Neighbours in other parts, and agents that have some.
    pub slots: usize,
    pub tellers: usize,
}

impl Controller {
    /// A controller in its start state.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        config.validate()?;
        let n = config.agents();
        let topologies = Topologies::new(n, &config.communication);
        let inputs = Inputs::start(&config);
        let adopted = Adopted {
            enable: inputs.enable,
            available: inputs.available.clone(),
            topology: 0,
            asked: inputs.topology,
            own: Standing::default(),
            remote: Standing::default(),
        };
        let state = State {
            parameters: Parameters::start(&config),
            outputs: Outputs::new(n),
            adopted,
            clock: Clock::default(),
            history: History::new(n, 0),
            filtered: Vec::new(),
            flows: Vec::new(),
            transfers: Vec::new(),
            received_ns: Vec::new(),
            held: Vec::new(),
            lags: Lags { frequency: Lag::new(&[]), voltage: Lag::new(&[]) },
            fades: Left::default(),
            before: Before::default(),
            shares: Vec::new(),
            followed: Vec::new(),
            owed: Default::default(),
            authority: Vec::new(),
            told: Vec::new(),
            inputs,
        };
        let topology = topologies.build(0, &state.adopted.available);
        let fixed = Fixed {
            law: config.law,
            limits: LimitTable::new(n, &config.limits),
            filter: config.measurement_filter,
            channel: config.channel,
            no_circulation: config.no_circulation,
            lost_link_fade_s: config.lost_link_fade_s,
            exchange_fade_s: config.exchange_fade_s,
            silence_ns: config.silence_s.map(nanoseconds),
            outlier_filter: config.outlier_filter,
            message_faults: config.message_faults.clone(),
            across: config.part.as_ref().map(|part| Across::new(part, &config.communication)),
            is_plain: is_plain(&config),
        };
        let bounded = fixed.limits.power || fixed.no_circulation;
        let mut state = state;
        if let Some(across) = &fixed.across {
            let unheard = |agents: &[usize]| Messages::unheard(agents.len(), across.hops(0, agents));
            (state.inputs.remote, state.outputs.local) = (unheard(&across.slots), unheard(&across.tellers));
            across.slots.iter().for_each(|&slot| state.inputs.available[slot] = false);
        }
        let faulty = if fixed.message_faults.is_empty() { 0 } else { n };
        let scratch = Scratch {
            signals: Signals::new(n),
            filtered: vec![0.0; if fixed.filter == MeasurementFilter::default() { 0 } else { 5 * n }],
            P_set: vec![0.0; n],
            room: std::array::from_fn(|_| vec![1.0; n]),
            shares: vec![0.0; if bounded { n } else { 0 }],
            followed: vec![0.0; if bounded { n } else { 0 }],
            owed: std::array::from_fn(|_| vec![0.0; if fixed.limits.power { n } else { 0 }]),
            authority: vec![Authority::default(); if fixed.limits.power { n } else { 0 }],
            ended: vec![0; n],
            told: Signals::new(faulty),
            mute: vec![false; faulty],
            frozen: vec![false; faulty],
            slots: fixed.across.as_ref().map_or(0, |across| across.slots.len()),
            tellers: fixed.across.as_ref().map_or(0, |across| across.tellers.len()),
            ..Scratch::default()
        };
        let mut controller = Self {
            state,
            fixed,
            topologies,
            topology,
            network: Network::default(),
            spectrum: Spectrum::default(),
            scratch,
        };
        controller.initialise();
        Ok(controller)
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.topology.live.len()
    }

    /// The inputs as set last.
    pub fn inputs(&self) -> &Inputs {
        &self.state.inputs
    }

    /// The inputs, to be set; the vectors keep their lengths, the values must be finite.
    pub fn inputs_mut(&mut self) -> &mut Inputs {
        &mut self.state.inputs
    }

    /// The parameters in force.
    pub fn parameters(&self) -> &Parameters {
        &self.state.parameters
    }

    /// The parameters, to be set within the ranges that [`Parameters::validate`] checks.
    pub fn parameters_mut(&mut self) -> &mut Parameters {
        self.scratch.roster.expire();
        &mut self.state.parameters
    }

    /// The outputs: setpoints of the last step, the rest as of the last refresh or step.
    pub fn outputs(&self) -> &Outputs {
        &self.state.outputs
    }

    /// The active leaders in force, from 0.
    pub fn leaders(&self) -> &[usize] {
        &self.topology.leaders
    }

    /// The agents that take part: available, and in a part of the graph that hears the virtual leader.
    pub fn live(&self) -> &[bool] {
        &self.topology.live
    }

    /// The graph in force, prepared.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// All topologies, and how CAK found the clusters.
    pub fn topologies(&self) -> &Topologies {
        &self.topologies
    }

    /// The eigenvalues behind the certificates, as of the last refresh or step.
    pub fn spectrum(&self) -> &Spectrum {
        &self.spectrum
    }

    /// How many steps late the frequencies, and the voltages, are measured, as far as found; see [`super::lag`].
    pub fn lags(&self) -> [usize; 2] {
        [self.state.lags.frequency.steps(), self.state.lags.voltage.steps()]
    }

    /// Takes over parameters and discrete inputs as they are and sets the setpoints to their starts; the
    /// past is forgotten. Called when initialisation ends, followed by a [`Self::refresh`].
    pub fn initialise(&mut self) {
        let n = self.agents();
        let State { inputs, parameters, outputs, adopted, .. } = &mut self.state;
        outputs.omega_set.copy_from_slice(&parameters.omega_set_start);
        outputs.V_set.copy_from_slice(&parameters.V_set_start);
        outputs.P_set.fill(0.0);
        outputs.Q_set.fill(0.0);
        adopted.enable = inputs.enable;
        adopted.asked = inputs.topology;
        let chosen = usize::try_from(i64::from(inputs.topology) - 1);
        adopted.topology = chosen.ok().filter(|&k| k < self.topologies.count()).unwrap_or(0);
        self.state.clock = Clock::default();
        // What evaluations before have left there must not reach the state.
        let scratch = &mut self.scratch;
        for values in [&mut scratch.filtered, &mut scratch.shares, &mut scratch.followed] {
            values.fill(0.0);
        }
        self.state.filtered.clone_from(&self.scratch.filtered);
        self.state.shares.clone_from(&self.scratch.shares);
        self.state.followed.clone_from(&self.scratch.followed);
        self.scratch.owed.iter_mut().for_each(|owed| owed.fill(0.0));
        self.scratch.authority.fill(Authority::default());
        self.state.owed.clone_from(&self.scratch.owed);
        self.state.authority.clone_from(&self.scratch.authority);
        self.state.told = vec![0.0; QUANTITIES * self.scratch.mute.len()];
        self.state.held.clear();
        self.state.history = History::new(n, 0);
        self.state.lags = Lags::start(&self.state.outputs);
        self.state.before = Before::default();
        self.introduce();
        self.state.adopted.available.clone_from(&self.state.inputs.available);
        self.rebuild();
        let edges = self.network.graph.edges().len();
        self.state.flows = vec![0.0; edges];
        self.state.fades = Left::all(nanoseconds(self.fixed.exchange_fade_s), edges);
        self.state.transfers = self.state.flows.clone();
        self.remember_before();
        self.state.received_ns = vec![i64::MIN; self.scratch.received_ns.len()];
        self.refresh(&mut |_| {});
        self.tell_outside(false);
    }

    /// Brings the five inputs of the paper and the diagnostics in line with the inputs and parameters
    /// set so far, with the step size of the last step. The setpoints stay. Where availability, topology
    /// or parameters have changed, the graph and the eigenvalues are made anew here, and said so.
    pub fn refresh(&mut self, events: &mut dyn FnMut(Event)) {
        self.adopt(false, events);
        let clock = self.state.clock;
        if self.is_plain() {
            self.look_around(clock.step_ns, Pass::Look);
        } else {
            self.evaluate(clock.now_ns, clock.step_ns);
        }
    }

    /// Advances the setpoints by one step that begins at `start_ns` and lasts `duration_ns`, the inputs
    /// being the measurements of its beginning. A step of no length changes nothing. Allocates nothing,
    /// unless a graph or parameters changed that no refresh has seen.
    pub fn step(&mut self, start_ns: i64, duration_ns: i64, events: &mut dyn FnMut(Event)) {
        self.step_by(Pass::LookAndMove, start_ns, duration_ns, events);
    }

    /// The same for whoever calls [`Self::refresh`] before reading a diagnostic: those of this step may be left at 0.
    pub fn step_unseen(&mut self, start_ns: i64, duration_ns: i64, events: &mut dyn FnMut(Event)) {
        self.step_by(Pass::Move, start_ns, duration_ns, events);
    }

    fn step_by(&mut self, pass: Pass, start_ns: i64, duration_ns: i64, events: &mut dyn FnMut(Event)) {
        if duration_ns <= 0 {
            return;
        }
        let changes = self.take_standings();
        self.adopt(changes, events);
        if self.is_plain() {
            self.look_around(duration_ns, pass);
            self.pass(start_ns, duration_ns);
        } else {
            self.fade_in_who_is_back(start_ns);
            self.evaluate(start_ns, duration_ns);
            self.advance(start_ns, duration_ns);
        }
    }

    /// The plain way, for few or for many.
    fn look_around(&mut self, h_ns: i64, pass: Pass) {
        if self.agents() <= FEW { self.visit_few(h_ns, pass) } else { self.sweep(h_ns, pass) }
    }

    /// The state, to be kept for a rollback.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Takes over a state of a controller made from the same configuration; on an error nothing changes.
    pub fn set_state(&mut self, state: &State) -> Result<(), ConfigError> {
        state.check(self.agents(), self.topologies.count(), &self.scratch)?;
        if self.state.adopted.graph() == state.adopted.graph() {
            // The usual rollback: the graph is there already, and perhaps its eigenvalues.
            let edges = (self.network.graph.edges().len(), self.scratch.received_ns.len());
            state.check_edges(edges, self.fixed.across.is_some())?;
            self.state.clone_from(state);
            self.state.outputs.cluster.copy_from_slice(&self.topology.cluster);
        } else {
            let before = self.clone();
            self.state.clone_from(state);
            self.rebuild();
            let edges = (self.network.graph.edges().len(), self.scratch.received_ns.len());
            if let Err(error) = self.state.check_edges(edges, self.fixed.across.is_some()) {
                *self = before;
                return Err(error);
            }
        }
        self.scratch.roster.expire();
        self.tune_to_state();
        Ok(())
    }

    pub(super) fn exchange_of<'a>(&'a self, power: SignPower, theta_s: [f64; 2], h_ns: i64) -> Exchange<'a> {
        let parameters = &self.state.parameters;
        Exchange {
            power,
            gain: parameters.gain_E,
            theta_s,
            h_s: seconds(h_ns),
            fades: self.fades(h_ns),
            capacity: &parameters.capacity,
            P_max: &parameters.P_exchange_max,
            ended: &self.scratch.ended,
            limits: &self.fixed.limits,
            no_circulation: self.fixed.no_circulation,
            late: Lateness::default(),
            mute: &self.scratch.mute,
        }
    }

    /// Share of a step of `h_ns` in what is left of the fade: a straight line from what the exchange was.
    pub(super) fn fade(&self, h_ns: i64) -> f64 {
        fade::share(h_ns, self.state.fades.alike().unwrap_or_default())
    }

    /// The same edge by edge.
    pub(super) fn fades(&self, h_ns: i64) -> Fades<'_> {
        Fades { h_ns, left: &self.state.fades }
    }
}

//! Faults of what agents tell their neighbours: what is told in the place of the truth, and who has stopped. An
//! agent knows its own values rightly whatever it tells; faults of measurements are not the controller's business.

use super::controller::{Controller, Scratch};
use super::delay::{QUANTITIES, Quantity, Signals};
use super::error::Problems;
use super::scalar::Scalar;
use super::time::{nanoseconds, seconds};
use serde::{Deserialize, Serialize};

/// Something that agents tell each other, by the name of the measurement behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Told {
    /// omega_i, pu.
    #[serde(rename = "omega")]
    Omega,
    /// p_i = K_P_i (P_i - P_set_i), pu.
    P,
    /// V_i, pu.
    V,
    /// q_i = K_Q_i (Q_i - Q_set_i), pu.
    Q,
    /// E_i / C_i, for the energy exchange.
    SoC,
}

impl Told {
    /// All, with their names.
    pub const ALL: [(&str, Self); 5] =
        [("omega", Self::Omega), ("P", Self::P), ("V", Self::V), ("Q", Self::Q), ("SoC", Self::SoC)];

    fn quantity(self) -> Quantity {
        match self {
            Self::Omega => Quantity::Omega,
            Self::P => Quantity::P,
            Self::V => Quantity::V,
            Self::Q => Quantity::Q,
            Self::SoC => Quantity::Soc,
        }
    }
}

/// What is wrong with messages.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum MessageFaultKind {
    /// Always this value, in the unit of the quantity; without one the last before the fault.
    Stuck {
        /// The value.
        #[serde(default)]
        value: Option<f64>,
    },
    /// The truth and what has come together at this rate, unit of the quantity per s, since the fault began.
    Drift {
        /// Rate.
        rate_per_s: f64,
    },
    /// NaN: the receiver recognises that, discards the message whole and keeps the last that made sense.
    Nan,
    /// The agent has stopped: it sends nothing, and its setpoints hold.
    Freeze,
}

/// A fault of what one agent tells its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MessageFault {
    /// The agent, from 1.
    pub agent: u32,
    /// What is wrong of what it tells; without one, everything.
    #[serde(default)]
    pub told: Option<Told>,
    /// What is wrong with it.
    pub kind: MessageFaultKind,
    /// From when, s; the first sample at or after it has the fault.
    pub from_s: f64,
    /// Until when, s; without one, for good.
    #[serde(default)]
    pub until_s: Option<f64>,
}

impl MessageFault {
    /// Whether it is there at this time.
    fn is_active(&self, now_ns: i64) -> bool {
        now_ns >= nanoseconds(self.from_s) && self.until_s.is_none_or(|t| now_ns < nanoseconds(t))
    }

    /// Whether neighbours get nothing that they could use.
    pub(super) fn is_mute(&self) -> bool {
        matches!(self.kind, MessageFaultKind::Nan | MessageFaultKind::Freeze)
    }

    fn agent(&self) -> usize {
        (self.agent as usize).wrapping_sub(1)
    }

    fn touches(&self, quantity: usize) -> bool {
        self.is_mute() || self.told.is_none_or(|told| told.quantity() as usize == quantity)
    }
}

/// Looks the faults of a configuration for `n` agents through.
pub(super) fn check(problems: &mut Problems, faults: &[MessageFault], n: usize) {
    for (k, fault) in faults.iter().enumerate() {
        let path = |key: &str| format!("message_faults[{k}].{key}");
        if fault.agent == 0 || fault.agent as usize > n {
            problems.add(path("agent"), fault.agent, format!("1 to {n}"));
        }
        let until_s = fault.until_s.unwrap_or(f64::MAX);
        if !(fault.from_s >= 0.0 && fault.from_s < until_s) {
            problems.add(path("from_s"), fault.from_s, "a time from 0 and before until_s, s");
        }
        let value = match fault.kind {
            MessageFaultKind::Stuck { value } => value.unwrap_or(0.0),
            MessageFaultKind::Drift { rate_per_s } => rate_per_s,
            MessageFaultKind::Nan | MessageFaultKind::Freeze => 0.0,
        };
        if !value.is_finite() {
            problems.add(path("kind"), value, "a finite number");
        }
        let always = matches!(fault.kind, MessageFaultKind::Stuck { value: Some(_) });
        if fault.told.is_none() && (always || matches!(fault.kind, MessageFaultKind::Drift { .. })) {
            problems.add(path("told"), "nothing", "the quantity that the number belongs to");
        }
    }
}

impl Scratch {
    /// What agents tell of the present: the signals themselves, but for faults.
    pub fn told(&self) -> &Signals {
        if self.mute.is_empty() { &self.signals } else { &self.told }
    }
}

impl Controller {
    /// What is told at `now_ns` instead of `signals`, where anything is; `passing` is 0, but in a derivative in
    /// time, where it moves with the time.
    pub(super) fn tell_instead<S: Scalar>(
        &self,
        (now_ns, passing): (i64, S),
        signals: &Signals<S>,
        told: &mut Signals<S>,
    ) {
        if self.fixed.message_faults.is_empty() {
            return;
        }
        for (told, own) in told.0.iter_mut().zip(&signals.0) {
            told.copy_from_slice(own);
        }
        let n = self.agents();
        for fault in self.fixed.message_faults.iter().filter(|fault| fault.is_active(now_ns)) {
            let i = fault.agent();
            if self.is_outside(i) {
                continue;
            }
            for q in (0..QUANTITIES).filter(|&q| fault.touches(q)) {
                // Before the first sample there is nothing to go back to.
                let last = if self.state.clock.samples == 0 {
                    signals.0[q][i]
                } else {
                    S::constant(self.state.told[q * n + i])
                };
                told.0[q][i] = match fault.kind {
                    MessageFaultKind::Stuck { value: Some(value) } => S::constant(value),
                    MessageFaultKind::Drift { rate_per_s } => {
                        let elapsed = S::constant(seconds(now_ns - nanoseconds(fault.from_s))) + passing;
                        signals.0[q][i] + S::constant(rate_per_s) * elapsed
                    }
                    _ => last,
                };
            }
        }
    }

    /// Finds out who tells nothing, and who does nothing, at `now_ns`.
    pub(super) fn find_faulty(&mut self, now_ns: i64) {
        if self.fixed.message_faults.is_empty() {
            return;
        }
        self.scratch.mute.fill(false);
        self.scratch.frozen.fill(false);
        for fault in self.fixed.message_faults.iter().filter(|fault| fault.is_active(now_ns)) {
            self.scratch.mute[fault.agent()] |= fault.is_mute();
            self.scratch.frozen[fault.agent()] |= fault.kind == MessageFaultKind::Freeze;
        }
    }

    /// The exchange with those who can be heard again fades in, as over any link that is back.
    pub(super) fn fade_in_who_is_back(&mut self, now_ns: i64) {
        let clock = self.state.clock;
        let is_back = |fault: &MessageFault| {
            fault.is_mute() && fault.is_active(clock.sampled_ns) && !fault.is_active(now_ns)
        };
        if clock.samples == 0 || !self.fixed.message_faults.iter().any(is_back) {
            return;
        }
        let back = |i: u32| self.fixed.message_faults.iter().any(|f| is_back(f) && f.agent() == i as usize);
        let (edges, fade_ns) = (self.network.graph.edges(), nanoseconds(self.fixed.exchange_fade_s));
        self.state.fades.set(|e| (back(edges[e].a) || back(edges[e].b)).then_some(fade_ns));
    }

    /// Who has stopped moves no setpoint.
    pub(super) fn hold_frozen(&mut self) {
        let outputs = &mut self.state.outputs;
        for (i, _) in self.scratch.frozen.iter().enumerate().filter(|(_, frozen)| **frozen) {
            for u in
                [&mut outputs.u_omega, &mut outputs.u_P, &mut outputs.u_E, &mut outputs.u_V, &mut outputs.u_Q]
            {
                u[i] = 0.0;
            }
        }
    }

    /// What was told at this sample is what receivers go back to.
    pub(super) fn remember_told(&mut self) {
        let n = self.agents();
        for (kept, told) in self.state.told.chunks_exact_mut(n).zip(&self.scratch.told.0) {
            kept.copy_from_slice(told);
        }
    }
}

//! Faults as the user writes them: what goes wrong with a signal, from when until when. Resolved into faults of
//! wires, which the harness brings about, and faults of messages between agents, which the controller does.

use super::connection::Batteries;
use super::document::Scenario;
use super::error::ScenarioError;
use super::resolve::nanoseconds;
use crate::control::told::{MessageFault, MessageFaultKind, Told};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Something that goes wrong for a while.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// What is wrong.
    pub kind: FaultKind,
    /// What it happens to. A measurement on its way to the controller: `P[3]`, or `controller.P[3]`. Any other
    /// Real input: `grid.omega_set[3]`. What an agent tells its neighbours, while it knows the truth itself:
    /// `messages.omega[3]` (also P, V, Q, SoC), all of it `messages[3]`. A whole agent: `agent[3]`. `{i}` stands
    /// for every battery's number.
    pub signal: String,
    /// From the first communication point at or after this time, s.
    #[serde(default)]
    pub from_s: f64,
    /// Right again from the first communication point at or after this time, s; never when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// Of `stuck`: the value, in the unit of the signal; the last right one when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Of `drift`: how fast the signal leaves the truth, its unit per s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_per_s: Option<f64>,
    /// Of `noise`: standard deviation, in the unit of the signal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation: Option<f64>,
    /// Of `noise`: seed of the generator, 0 when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Of `quantisation`: distance of two values, in the unit of the signal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
}

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// The signal stays where it is.
    Stuck,
    /// The signal leaves the truth at a constant rate.
    Drift,
    /// The signal is not a number. Of a measurement the harness recognises it and takes the agent out
    /// (`available[i]` = false) while it lasts; neighbours discard such messages.
    Nan,
    /// Normal noise on a measurement, drawn anew at every communication point.
    Noise,
    /// A measurement in steps.
    Quantisation,
    /// An agent stops: it sends nothing, and its setpoints hold.
    Freeze,
}

impl FaultKind {
    fn name(self) -> &'static str {
        match self {
            Self::Stuck => "stuck",
            Self::Drift => "drift",
            Self::Nan => "nan",
            Self::Noise => "noise",
            Self::Quantisation => "quantisation",
            Self::Freeze => "freeze",
        }
    }
}

/// The same scenario with something going wrong, run beside it: one row in the table of faults.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// Words for the table.
    pub label: String,
    /// Keys of the scenario and their values here: `"faults": [...]`, `"control.channel.loss": 0.5`.
    pub set: Map<String, Value>,
    /// When it begins, s.
    pub from_s: f64,
    /// When it is over, s; left out where it is not. From here, or else from `from_s`, the time to converge counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// Batteries, from 1, that nobody can expect to share while it lasts.
    #[serde(default)]
    pub affected: Vec<u32>,
    /// Converged is who stays within this, pu, both omega and K_P P.
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    /// Why it cannot converge, where it cannot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cannot: Option<String>,
}

fn tolerance() -> f64 {
    1e-5
}

/// A fault of a Real input of a participant.
#[derive(Clone, Debug, PartialEq)]
pub struct WireFault {
    /// Place in the document.
    pub place: String,
    /// The input, `participant.variable`.
    pub signal: String,
    /// What becomes of its value.
    pub wrong: Wrong,
    /// From when, ns.
    pub from_ns: i64,
    /// Until when, ns.
    pub until_ns: Option<i64>,
}

/// What becomes of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wrong {
    /// This one, or the last right one.
    Stuck(Option<f64>),
    /// What has come together at this rate, per s, is added.
    Drift(f64),
    /// Not a number.
    Nan,
    /// Normal noise is added.
    Noise {
        /// Standard deviation.
        deviation: f64,
        /// Seed.
        seed: u64,
    },
    /// The nearest multiple of this.
    Quantised(f64),
}

/// All faults of a scenario, checked: those of wires and those of messages.
pub(super) fn resolve(
    scenario: &Scenario,
    origin: &str,
) -> Result<(Vec<WireFault>, Vec<MessageFault>), ScenarioError> {
    let batteries = Batteries::new(scenario);
    let (mut wires, mut messages) = (Vec::new(), Vec::new());
    for (k, fault) in scenario.faults.iter().enumerate() {
        let place = format!("faults[{k}]");
        let wrong = |key: &str, found: String, expected: String| ScenarioError::Value {
            origin: origin.into(),
            path: format!("{place}.{key}"),
            found,
            expected,
        };
        check(fault, &wrong)?;
        for signal in batteries.expand(&fault.signal, &format!("{place}.signal"), origin)? {
            match Target::parse(&signal) {
                Some(Target::Wire(signal)) => wires.push(WireFault {
                    place: place.clone(),
                    wrong: wire_fault(fault, &signal, &wrong)?,
                    signal,
                    from_ns: nanoseconds(fault.from_s),
                    until_ns: fault.until_s.map(nanoseconds),
                }),
                Some(Target::Messages { agent, told }) => {
                    let kind = message_fault(fault, told, &wrong)?;
                    let n = scenario.bess.len();
                    if agent == 0 || agent as usize > n {
                        return Err(wrong("signal", format!("agent {agent}"), format!("one of 1 to {n}")));
                    }
                    let (from_s, until_s) = (fault.from_s, fault.until_s);
                    messages.push(MessageFault { agent, told, kind, from_s, until_s });
                }
                None => {
                    let expected = "P[3], grid.NAME, messages.omega[3] (also P, V, Q, SoC), messages[3] or \
                                    agent[3]";
                    return Err(wrong("signal", format!("{signal:?}"), expected.into()));
                }
            }
        }
    }
    Ok((wires, messages))
}

/// Where a fault is.
enum Target {
    /// `participant.variable`.
    Wire(String),
    Messages {
        agent: u32,
        told: Option<Told>,
    },
}

impl Target {
    fn parse(signal: &str) -> Option<Self> {
        let (name, agent) = match signal.split_once('[') {
            Some((name, rest)) => (name, rest.strip_suffix(']')),
            None => (signal, None),
        };
        let agent = || agent?.parse().ok();
        if name == "messages" || name == "agent" {
            return Some(Self::Messages { agent: agent()?, told: None });
        }
        if let Some(quantity) = name.strip_prefix("messages.") {
            let (_, told) = Told::ALL.into_iter().find(|(name, _)| *name == quantity)?;
            return Some(Self::Messages { agent: agent()?, told: Some(told) });
        }
        match signal.split_once('.') {
            None => Some(Self::Wire(format!("controller.{signal}"))),
            Some(("controller" | "grid", _)) => Some(Self::Wire(signal.into())),
            Some(_) => None,
        }
    }
}

/// The keys that belong to each kind, and the times.
fn check(fault: &Fault, wrong: &impl Fn(&str, String, String) -> ScenarioError) -> Result<(), ScenarioError> {
    use FaultKind::{Drift, Noise, Quantisation, Stuck};
    let kind = fault.kind.name();
    for (key, owner, found, needed) in [
        ("value", Stuck, fault.value, false),
        ("rate_per_s", Drift, fault.rate_per_s, true),
        ("deviation", Noise, fault.deviation, true),
        ("seed", Noise, fault.seed.map(|seed| seed as f64), false),
        ("step", Quantisation, fault.step, true),
    ] {
        match found {
            Some(found) if fault.kind != owner => {
                let expected =
                    format!("no such key with kind \"{kind}\"; it belongs to \"{}\"", owner.name());
                return Err(wrong(key, found.to_string(), expected));
            }
            None if fault.kind == owner && needed => {
                return Err(wrong(key, "nothing".into(), format!("a number, for kind \"{kind}\" needs it")));
            }
            _ => {}
        }
    }
    for (key, found) in [("deviation", fault.deviation), ("step", fault.step)] {
        if let Some(found) = found.filter(|found| *found <= 0.0) {
            return Err(wrong(key, found.to_string(), "a number greater than 0".into()));
        }
    }
    if !(0.0..=3e9).contains(&fault.from_s) {
        return Err(wrong("from_s", fault.from_s.to_string(), "a time from 0, s".into()));
    }
    if let Some(until_s) = fault.until_s.filter(|until_s| !(*until_s > fault.from_s && *until_s <= 3e9)) {
        return Err(wrong("until_s", until_s.to_string(), format!("a time after from_s = {}", fault.from_s)));
    }
    Ok(())
}

fn wire_fault(
    fault: &Fault,
    signal: &str,
    wrong: &impl Fn(&str, String, String) -> ScenarioError,
) -> Result<Wrong, ScenarioError> {
    Ok(match fault.kind {
        FaultKind::Stuck => Wrong::Stuck(fault.value),
        FaultKind::Drift => Wrong::Drift(fault.rate_per_s.unwrap_or(0.0)),
        FaultKind::Noise => {
            Wrong::Noise { deviation: fault.deviation.unwrap_or(0.0), seed: fault.seed.unwrap_or(0) }
        }
        FaultKind::Quantisation => Wrong::Quantised(fault.step.unwrap_or(1.0)),
        FaultKind::Nan if signal.starts_with("controller.") => Wrong::Nan,
        FaultKind::Nan => {
            let expected = "a measurement of the controller or messages, for a grid has no way to live without \
                            a setpoint";
            return Err(wrong("signal", format!("{signal:?}"), expected.into()));
        }
        FaultKind::Freeze => {
            return Err(wrong("signal", format!("{signal:?}"), "agent[3], for only an agent freezes".into()));
        }
    })
}

fn message_fault(
    fault: &Fault,
    told: Option<Told>,
    wrong: &impl Fn(&str, String, String) -> ScenarioError,
) -> Result<MessageFaultKind, ScenarioError> {
    let whole = fault.signal.starts_with("agent");
    let kind = match fault.kind {
        FaultKind::Freeze if whole => return Ok(MessageFaultKind::Freeze),
        FaultKind::Stuck => MessageFaultKind::Stuck { value: fault.value },
        FaultKind::Drift => MessageFaultKind::Drift { rate_per_s: fault.rate_per_s.unwrap_or(0.0) },
        FaultKind::Nan => MessageFaultKind::Nan,
        FaultKind::Freeze | FaultKind::Noise | FaultKind::Quantisation => {
            let expected = match fault.kind {
                FaultKind::Freeze => "agent[3], for only an agent freezes",
                _ => "a measurement such as P[3]: what is told follows it",
            };
            return Err(wrong("signal", format!("{:?}", fault.signal), expected.into()));
        }
    };
    if whole {
        let expected = "messages[3] or a measurement such as P[3]; agent[3] goes with kind \"freeze\"";
        return Err(wrong("signal", format!("{:?}", fault.signal), expected.into()));
    }
    let of_one = matches!(kind, MessageFaultKind::Stuck { value: Some(_) } | MessageFaultKind::Drift { .. });
    if told.is_none() && of_one {
        let expected = "messages.omega[3] or another quantity, to which the number belongs";
        return Err(wrong("signal", format!("{:?}", fault.signal), expected.into()));
    }
    Ok(kind)
}

//! A fleet taken apart: which FMU holds which agents, what its variables are called there, and whose messages go
//! where. Who exports parts, connects them or runs them reads it here; nothing is computed.

use super::Resource;
use crate::control::config::Config;
use crate::control::part::Outside;
pub use crate::control::partition::Cut;
use crate::control::partition::{PartitionError, numbers, split};
use crate::fmi::lookup::Registry;
use crate::fmi::{Interface, ModelError};
use crate::models::Controller;

/// What an output is that [`Fleet::only_place`] finds nowhere, and what can be connected instead.
pub const NO_ONE_PLACE: [&str; 2] = [
    "the whole fleet's, which no one part of the controller knows",
    "a variable of one agent, or a controller that is not in parts",
];

/// What a part knows of its neighbours outside beside their messages: `remote_capacity`, `remote_P_exchange_max`.
const AGREED_ON: [&str; 2] = ["capacity", "P_exchange_max"];

/// All parts of a fleet, the first first.
#[derive(Clone, Debug)]
pub struct Fleet {
    /// The parts.
    pub parts: Vec<Member>,
    /// Name of the outputs and inputs that carry messages, without `local_` and `remote_`.
    pub words: Vec<String>,
    cut: Cut,
}

/// One part.
#[derive(Clone, Debug)]
pub struct Member {
    /// What it is called among participants and components: `cluster1`, `agent3`.
    pub name: String,
    /// What its archive is called: `BessCluster1.fmu`, `BessAgent3.fmu`.
    pub archive: String,
    /// What makes it.
    pub resource: Resource<Config>,
    /// Numbers in the fleet of its agents, from 1: `P[1]` is that of the first.
    pub own: Vec<u32>,
    /// The neighbours outside and the parts that they belong to: `remote_p[1]` is of the first.
    pub outside: Vec<Outside>,
    /// Its agents that are told of outside: `local_p[1]` is of the first.
    pub tellers: Vec<u32>,
}

/// One way of messages, the same for every word: `local_WORD[from.1]` of part `from.0` feeds `remote_WORD[to.1]` of
/// part `to.0`. Parts count from 0, places in the arrays from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    /// Part and place of the output.
    pub from: (usize, usize),
    /// Part and place of the input.
    pub to: (usize, usize),
}

impl Fleet {
    /// The parts that a whole controller is cut into; messages take one step of the resource.
    pub fn of(whole: &Resource<Config>, cut: Cut) -> Result<Self, ModelError> {
        let refused = |error: PartitionError| ModelError::new(error.to_string());
        let part_of = numbers(&whole.config, cut);
        let configs = split(&whole.config, &part_of, whole.step_s).map_err(refused)?;
        let word = match cut {
            Cut::Clusters => ("cluster", "Cluster"),
            Cut::Agents => ("agent", "Agent"),
        };
        let members = configs.into_iter().filter_map(|config| {
            let part = config.part.as_ref()?;
            Some(Member {
                name: format!("{}{}", word.0, part.number),
                archive: format!("Bess{}{}.fmu", word.1, part.number),
                own: part.own().collect(),
                outside: part.outside.clone(),
                tellers: part.tellers(&config.communication),
                resource: Resource { config, ..*whole },
            })
        });
        let mut fleet = Self { parts: members.collect(), words: Vec::new(), cut };
        // Any part with a neighbour outside has all messages.
        if let Some(member) = fleet.parts.iter().find(|member| !member.outside.is_empty()) {
            let model = Controller::new(member.resource.clone())?;
            let registry = Registry::new(&model, Interface::Structured)
                .map_err(|error| ModelError::new(error.to_string()))?;
            let words = registry.groups().filter_map(|(_, group)| group.name.strip_prefix("local_"));
            fleet.words = words.map(str::to_owned).collect();
        }
        Ok(fleet)
    }

    /// What a part is called: `cluster`, `agent`.
    pub fn kind(&self) -> &'static str {
        match self.cut {
            Cut::Clusters => "cluster",
            Cut::Agents => "agent",
        }
    }

    /// All ways of messages, part by part and slot by slot.
    pub fn ways(&self) -> Vec<Way> {
        let mut ways = Vec::new();
        for (to, member) in self.parts.iter().enumerate() {
            for (slot, outside) in member.outside.iter().enumerate() {
                let from = (outside.part as usize).wrapping_sub(1);
                let sender = self.parts.get(from).map_or(&[][..], |sender| &sender.tellers);
                if let Ok(place) = sender.binary_search(&outside.agent) {
                    ways.push(Way { from: (from, place + 1), to: (to, slot + 1) });
                }
            }
        }
        ways
    }

    /// Where a variable of the whole controller is: `P[5]` in one part under another number, `enable` in all
    /// under its own name, and what both ends of a link have to know of an agent also with its neighbours. Nowhere if
    /// only the whole fleet has it. Parts count from 0.
    pub fn places(&self, variable: &str) -> Vec<(usize, String)> {
        let Some((quantity, agent)) = variable.strip_suffix(']').and_then(|v| v.split_once('[')) else {
            // The largest difference in sight of one part or another is not the largest of all.
            let has_it = !variable.starts_with("spread_") || self.parts.len() == 1;
            return (0..self.parts.len())
                .filter(|_| has_it)
                .map(|part| (part, variable.to_owned()))
                .collect();
        };
        let Ok(agent) = agent.parse::<u32>() else { return Vec::new() };
        let is_agreed_on = AGREED_ON.contains(&quantity);
        let of = |(part, member): (usize, &Member)| {
            let here =
                member.own.binary_search(&agent).ok().map(|place| format!("{quantity}[{}]", place + 1));
            let outside = member.outside.iter().position(|outside| outside.agent == agent);
            let there = || outside.map(|slot| format!("remote_{quantity}[{}]", slot + 1));
            Some((part, here.or_else(|| there().filter(|_| is_agreed_on))?))
        };
        self.parts.iter().enumerate().filter_map(of).collect()
    }

    /// The one part that knows an output of the whole controller, from 0; nobody where each part knows its own, or
    /// none any.
    pub fn only_place(&self, variable: &str) -> Option<(usize, String)> {
        let mut places = self.places(variable);
        let place = places.pop()?;
        places.is_empty().then_some(place)
    }

    /// What a variable of part `part`, from 0, is called in the whole controller: the other way of [`Self::places`].
    pub fn in_fleet(&self, part: usize, variable: &str) -> Option<String> {
        let Some((quantity, place)) = variable.strip_suffix(']').and_then(|v| v.split_once('[')) else {
            return Some(variable.to_owned());
        };
        let place: usize = place.parse().ok()?;
        let agent = self.parts.get(part)?.own.get(place.checked_sub(1)?)?;
        Some(format!("{quantity}[{agent}]"))
    }
}

//! The variables of a part of a fleet: those of its own agents as in the whole controller, and messages. What its
//! agents tell neighbours in other parts are outputs `local_*`, what they hear inputs `remote_*`; equal words connect.

use super::variables::{COMMON, FEW, MEASURED, consensus_inputs, inputs, setpoints};
use super::{Controller, parameters};
use crate::control;
use crate::control::delay::Quantity;
use crate::control::messages::Messages;
use crate::fmi::{Access, Causality, Dependencies, Group, Range, Unit};
use crate::models::variables::{GroupExt, group, input, output, parameter, switch};

/// What arrives as a Real.
const HEARD: &[&str] = &["remote_omega", "remote_p", "remote_V", "remote_q", "remote_E", "remote_V_mean"];

/// All variables.
pub fn variables(controller: &control::Controller) -> Vec<Group<Controller>> {
    let n = controller.own_agents().len();
    let (slots, tellers) = controller.slots_and_tellers();
    let optional = (controller.tells_share(), controller.tells_ended());
    let mut all = inputs(n, controller.topologies().count());
    if !slots.is_empty() {
        all.extend(remote(slots.len(), optional));
    }
    all.extend(setpoints(n));
    all.extend(consensus_inputs(n, || Dependencies::Of(heard)));
    all.extend(diagnostics(n, !slots.is_empty()));
    if !tellers.is_empty() {
        all.extend(local(tellers.len(), optional));
    }
    all.extend(parameters::tunable());
    all.extend(parameters::fixed(n));
    if !slots.is_empty() {
        all.extend(agreed(slots.len()));
    }
    all
}

/// What the rates of an agent follow: its measurements and its neighbours', and what arrives from those outside.
fn heard(model: &Controller, i: usize) -> Vec<(&'static str, usize)> {
    let (slots, _) = model.slots_and_tellers();
    let mut around = vec![i];
    let mut outside = Vec::new();
    for place in model.topologies().neighbours(model.at(i)) {
        match (model.own.binary_search(&place), slots.binary_search(&place)) {
            (Ok(own), _) => around.push(own),
            (_, Ok(slot)) => outside.push(slot),
            _ => {}
        }
    }
    let n = model.own.len();
    if model.part().is_some_and(|part| part.election.is_some()) {
        // Whoever leads hears others.
        (around, outside) = ((0..n).collect(), (0..slots.len()).collect());
    }
    let all_own: Vec<usize> = if n <= FEW { (0..n).collect() } else { around.clone() };
    let mut all: Vec<(&'static str, usize)> = Vec::new();
    all.extend(MEASURED.iter().flat_map(|&name| around.iter().map(move |&j| (name, j))));
    all.extend(HEARD.iter().flat_map(|&name| outside.iter().map(move |&k| (name, k))));
    if model.tells_share() {
        all.extend(outside.iter().map(|&k| ("remote_share", k)));
    }
    all.extend(COMMON.iter().map(|&name| (name, 0)));
    all.extend(all_own.into_iter().map(|j| ("available", j)));
    all
}

/// Spreads and errors over the own agents and the neighbours outside.
fn diagnostics(n: usize, has_outside: bool) -> Vec<Group<Controller>> {
    let of = |own: &'static [&'static str], both: &'static [&'static str]| {
        Dependencies::All(if has_outside { both } else { own })
    };
    vec![
        output("spread_P", "Largest difference of K_P (P - P_set) in sight", |m: &Controller, _| {
            m.outputs().spread_P
        })
        .unit(Unit::PerUnit)
        .follows(of(&["P", "available"], &["P", "available", "remote_p"])),
        output("spread_Q", "Largest difference of K_Q (Q - Q_set) in sight", |m: &Controller, _| {
            m.outputs().spread_Q
        })
        .unit(Unit::PerUnit)
        .follows(of(&["Q", "available"], &["Q", "available", "remote_q"])),
        output(
            "spread_E",
            "Largest difference of the state of charge E / C in sight",
            |m: &Controller, _| m.outputs().spread_E,
        )
        .follows(of(&["E", "available"], &["E", "available", "remote_E"])),
        output(
            "error_omega",
            "Largest distance of a frequency in sight from omega_ref",
            |m: &Controller, _| m.outputs().error_omega,
        )
        .unit(Unit::PerUnit)
        .follows(of(
            &["omega", "omega_ref", "available"],
            &["omega", "omega_ref", "available", "remote_omega"],
        )),
        output("error_V", "Largest distance of a voltage in sight from V_ref", |m: &Controller, _| {
            m.outputs().error_V
        })
        .unit(Unit::PerUnit)
        .follows(of(&["V", "V_ref", "available"], &["V", "V_ref", "available", "remote_V"])),
        group(
            "cluster",
            "Number of the agent's cluster in the fleet, from 1",
            Causality::Output,
            Access::Integer(|m: &Controller, i| m.outputs().cluster[m.at(i)], None),
        )
        .each(n)
        .follows(Dependencies::All(&["topology"])),
        group(
            "saturated",
            "A limit of the agent is active",
            Causality::Output,
            Access::Boolean(|m: &Controller, i| m.outputs().saturated[m.at(i)], None),
        )
        .each(n)
        .follows(Dependencies::Of(heard)),
    ]
}

fn at(messages: &Messages, quantity: Quantity, k: usize) -> f64 {
    messages.of(quantity).get(k).copied().unwrap_or_default()
}

fn put(messages: &mut Messages, quantity: Quantity, k: usize, value: f64) {
    if let Some(place) = messages.of_mut(quantity).get_mut(k) {
        *place = value;
    }
}

/// One quantity of the messages that arrive.
macro_rules! hear {
    ($name:literal, $about:literal, $quantity:ident, $unit:ident) => {
        input(
            $name,
            $about,
            |m: &Controller, k| at(&m.inputs().remote, Quantity::$quantity, k),
            |m: &mut Controller, k, v| put(&mut m.inputs_mut().remote, Quantity::$quantity, k, v),
        )
        .unit(Unit::$unit)
    };
}

/// One quantity of the messages that leave.
macro_rules! tell {
    ($name:literal, $about:literal, $quantity:ident, $unit:ident) => {
        output($name, $about, |m: &Controller, k| at(&m.outputs().local, Quantity::$quantity, k))
            .unit(Unit::$unit)
    };
}

/// One number of how a neighbour stands.
macro_rules! hear_number {
    ($name:literal, $about:literal, $field:ident) => {
        group(
            $name,
            $about,
            Causality::Input,
            Access::Integer(
                |m: &Controller, k| m.inputs().remote.standing.$field[k],
                Some(|m: &mut Controller, k, v| m.inputs_mut().remote.standing.$field[k] = v),
            ),
        )
    };
}

/// One number of how an agent stands.
macro_rules! tell_number {
    ($name:literal, $about:literal, $field:ident) => {
        group(
            $name,
            $about,
            Causality::Output,
            Access::Integer(|m: &Controller, k| m.outputs().local.standing.$field[k], None),
        )
    };
}

/// One truth of how an agent stands.
macro_rules! tell_truth {
    ($name:literal, $about:literal, $field:ident) => {
        group(
            $name,
            $about,
            Causality::Output,
            Access::Boolean(|m: &Controller, k| m.outputs().local.standing.$field[k], None),
        )
    };
}

/// Messages of `count` neighbours outside.
fn remote(count: usize, (share, ended): (bool, bool)) -> Vec<Group<Controller>> {
    let mut all = vec![
        hear!("remote_omega", "Frequency of the neighbour outside, one step ago", Omega, PerUnit),
        hear!(
            "remote_p",
            "K_P (P - P_set) of the neighbour outside and what it owes, one step ago",
            P,
            PerUnit
        ),
        hear!("remote_V", "Voltage of the neighbour outside, one step ago", V, PerUnit),
        hear!(
            "remote_q",
            "K_Q (Q - Q_set) of the neighbour outside and what it owes, one step ago",
            Q,
            PerUnit
        ),
        hear!("remote_E", "State of charge E / C of the neighbour outside, one step ago", Soc, One),
        hear!(
            "remote_V_mean",
            "Estimate of the mean voltage of the neighbour outside, one step ago",
            MeanV,
            PerUnit
        ),
    ];
    if share {
        all.push(hear!(
            "remote_share",
            "P less P_set, followed, of the neighbour outside, one step ago",
            Share,
            PerUnit
        ));
    }
    all.push(switch(
        "remote_available",
        "The neighbour outside takes part; unconnected, it does not",
        |m: &Controller, k| m.inputs().remote.standing.available[k],
        |m: &mut Controller, k, v| m.inputs_mut().remote.standing.available[k] = v,
    ));
    all.push(switch(
        "remote_enabled",
        "The controller of the neighbour outside is on",
        |m: &Controller, k| m.inputs().remote.standing.enabled[k],
        |m: &mut Controller, k, v| m.inputs_mut().remote.standing.enabled[k] = v,
    ));
    all.push(
        hear_number!("remote_hops", "Links from the neighbour outside to the nearest pinned agent", hops)
            .range(Range::NOT_NEGATIVE),
    );
    all.push(hear_number!(
        "remote_links",
        "Links that the neighbour outside has more (less) than with everybody available",
        links
    ));
    if ended {
        all.push(
            hear_number!(
                "remote_ended",
                "Ended links whose exchange the neighbour outside still carries",
                ended
            )
            .range(Range::NOT_NEGATIVE),
        );
    }
    all.into_iter().map(|group| group.each(count)).collect()
}

/// Messages of `count` own agents to the other parts: sampled, so that no master finds a loop through them.
fn local(count: usize, (share, ended): (bool, bool)) -> Vec<Group<Controller>> {
    let mut all = vec![
        tell!("local_omega", "Frequency at the beginning of the last step", Omega, PerUnit),
        tell!("local_p", "K_P (P - P_set) and what is owed, at the beginning of the last step", P, PerUnit),
        tell!("local_V", "Voltage at the beginning of the last step", V, PerUnit),
        tell!("local_q", "K_Q (Q - Q_set) and what is owed, at the beginning of the last step", Q, PerUnit),
        tell!("local_E", "State of charge E / C at the beginning of the last step", Soc, One),
        tell!(
            "local_V_mean",
            "Estimate of the mean voltage at the beginning of the last step",
            MeanV,
            PerUnit
        ),
    ];
    if share {
        all.push(tell!(
            "local_share",
            "P less P_set, followed, at the beginning of the last step",
            Share,
            PerUnit
        ));
    }
    all.push(tell_truth!("local_available", "The agent takes part", available));
    all.push(tell_truth!("local_enabled", "The controller is on", enabled));
    all.push(tell_number!("local_hops", "Links from the agent to the nearest pinned agent", hops));
    all.push(tell_number!(
        "local_links",
        "Links that the agent has more (less) than with everybody available",
        links
    ));
    if ended {
        all.push(tell_number!("local_ended", "Ended links whose exchange the agent still carries", ended));
    }
    all.into_iter().map(|group| group.each(count)).collect()
}

/// What both ends of a link agree on when it is set up.
fn agreed(count: usize) -> Vec<Group<Controller>> {
    vec![
        parameter(
            "remote_capacity",
            "Energy capacity C of the neighbour outside",
            |m: &Controller, k| m.parameters().capacity[m.slots_and_tellers().0[k]],
            |m: &mut Controller, k, v| {
                let slot = m.slots_and_tellers().0[k];
                m.parameters_mut().capacity[slot] = v;
            },
        )
        .each(count)
        .unit(Unit::PerUnitHour)
        .range(Range::POSITIVE),
        parameter(
            "remote_P_exchange_max",
            "Most power that the energy exchange asks of the neighbour outside",
            |m: &Controller, k| m.parameters().P_exchange_max[m.slots_and_tellers().0[k]],
            |m: &mut Controller, k, v| {
                let slot = m.slots_and_tellers().0[k];
                m.parameters_mut().P_exchange_max[slot] = v;
            },
        )
        .each(count)
        .unit(Unit::PerUnit)
        .range(Range::NOT_NEGATIVE),
    ]
}

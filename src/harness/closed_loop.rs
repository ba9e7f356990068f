//! Whether the loop of controller and grid is closed and speaks one language: every measurement that the control
//! law needs has a source, every setpoint reaches somebody, and no unit contradicts a model description.
//! Changes nothing.

use super::coupling::{Connection, CouplingError, Endpoint};
use super::description::{Causality, Variable};
use super::lookup::Lookup;
use super::near;
use super::participant::Participant;
use super::plan::Plan;
use super::scenario::{CONTROLLER, GRID};
use super::value::Value;
use crate::scenario::Resolved;
use crate::scenario::connection::Wire;
use crate::scenario::units::Unit;
use std::collections::{BTreeMap, BTreeSet};

type Participants<'a> = &'a [Box<dyn Participant>];

/// Finds every name of the table and looks for inputs that it feeds twice, so that a misspelt line is not told as a
/// missing source.
pub(super) fn check_table(
    participants: Participants<'_>,
    connections: &[Connection],
) -> Result<(), CouplingError> {
    let lookup = Lookup::new(participants);
    let mut sources: BTreeMap<&Endpoint, &Endpoint> = BTreeMap::new();
    for (k, connection) in connections.iter().enumerate() {
        let place = format!("connection {} ({} to {})", k + 1, connection.from, connection.to);
        lookup.find(&place, &connection.from)?;
        lookup.find(&place, &connection.to)?;
        if let Some(first) = sources.insert(&connection.to, &connection.from) {
            let (to, first) = (connection.to.clone(), first.to_string());
            return Err(CouplingError::TwoSources { place, to, first });
        }
    }
    Ok(())
}

/// Compares the units that the table names with those that the model descriptions declare; where the table names
/// none and scales nothing, the declared ones with each other. Unknown units are nobody's business.
pub(super) fn check_units(
    participants: Participants<'_>,
    wires: &[Wire],
    connections: &[Connection],
) -> Result<(), CouplingError> {
    let lookup = Lookup::new(participants);
    let declared = |end: &Endpoint| lookup.get(end)?.unit.as_deref().and_then(Unit::parse);
    for (k, connection) in connections.iter().enumerate() {
        let (from, to) = (&connection.from, &connection.to);
        let (from_declared, to_declared) = (declared(from), declared(to));
        // The table comes first in the list of connections, in its order.
        let named = wires.get(k).filter(|wire| wire.from_unit.is_some() || wire.to_unit.is_some());
        if let Some(wire) = named {
            for (name, unit, found) in
                [(from, wire.from_unit, &from_declared), (to, wire.to_unit, &to_declared)]
            {
                let unit = unit.unwrap_or(Unit::PU);
                if let Some(found) = found.filter(|found| !found.is_like(unit)) {
                    return Err(CouplingError::Unit {
                        name: name.clone(),
                        declared: found.name.into(),
                        found: format!("{} in the connection table", unit.name),
                        expected: "the same there; `from_unit` is the unit of `from`, `to_unit` that of `to`"
                            .into(),
                    });
                }
            }
            continue;
        }
        if let (Some(source), Some(target)) = (from_declared, to_declared)
            && !source.is_like(target)
            && connection.factor == 1.0
            && connection.offset == 0.0
        {
            return Err(CouplingError::Unit {
                name: from.clone(),
                declared: source.name.into(),
                found: format!("a connection without conversion to {to}, in {}", target.name),
                expected: format!(
                    "a line in the scenario's `connections` with \"from_unit\": \"{}\", \"to_unit\": \"{}\"",
                    source.name, target.name
                ),
            });
        }
    }
    Ok(())
}

/// Names the first measurement without a source and the first setpoint that reaches nobody. A value set at the
/// start or by an event is a source; an agent that is not available at the start needs none.
pub(super) fn check_sources(
    participants: Participants<'_>,
    plan: &Plan,
    resolved: &Resolved,
) -> Result<(), CouplingError> {
    let gains = &resolved.control.gains;
    let voltage = gains.V != 0.0 || gains.Q != 0.0;
    let exchange = gains.E != 0.0;
    let settings = || plan.initial.iter().chain(plan.events.iter().flat_map(|event| &event.sets));
    let set: BTreeSet<(&str, &str)> = settings().map(|s| (&*s.participant, &*s.variable)).collect();
    // The last of several values counts.
    let of_controller = plan.initial.iter().filter(|s| s.participant == CONTROLLER);
    let start: BTreeMap<&str, Value> = of_controller.map(|s| (&*s.variable, s.value)).collect();
    let absent = |i: usize| start.get(&*format!("available[{i}]")).is_some_and(|value| value.as_f64() < 0.5);
    let targets: BTreeSet<&Endpoint> = plan.connections.iter().map(|c| &c.to).collect();
    let sources: BTreeSet<&Endpoint> = plan.connections.iter().map(|c| &c.from).collect();
    let lookup = Lookup::new(participants);
    let has = |endpoint: &Endpoint, causality| {
        lookup.get(endpoint).is_some_and(|variable| variable.causality == causality)
    };
    let agents = (1..=resolved.control.agents()).filter(|i| !absent(*i));
    for i in agents {
        for (participant, quantity, needed) in [
            (CONTROLLER, "P", true),
            (CONTROLLER, "omega", true),
            (CONTROLLER, "Q", voltage),
            (CONTROLLER, "V", voltage),
            (CONTROLLER, "E", exchange),
            (GRID, "omega_set", true),
        ] {
            let input = Endpoint::new(participant, format!("{quantity}[{i}]"));
            let fed = targets.contains(&input) || set.contains(&(participant, &*input.variable));
            if needed && !fed && has(&input, Causality::Input) {
                let hint = free(participants, participant, Causality::Output, &input.variable, &sources);
                let expected = "a connection to it, or a constant in `initial`".into();
                return Err(CouplingError::Open { name: input, found: "has no source", expected, hint });
            }
        }
        for (quantity, needed, off) in [
            ("omega_set", true, ""),
            ("V_set", voltage, ", or control.gains.V and control.gains.Q = 0"),
            ("P_set", exchange, ", or control.gains.E = 0"),
        ] {
            let output = Endpoint::new(CONTROLLER, format!("{quantity}[{i}]"));
            if needed && !sources.contains(&output) && has(&output, Causality::Output) {
                let hint = free(participants, CONTROLLER, Causality::Input, &output.variable, &targets);
                let expected = format!("a connection to the battery's inverter{off}");
                return Err(CouplingError::Open { name: output, found: "reaches no input", expected, hint });
            }
        }
    }
    Ok(())
}

/// What the other participant has left to connect: names near to the wanted one, else those with its quantity in
/// them as a word, else the first few.
fn free(
    participants: Participants<'_>,
    not: &str,
    causality: Causality,
    wanted: &str,
    taken: &BTreeSet<&Endpoint>,
) -> String {
    let Some(other) = participants.iter().find(|participant| participant.name() != not) else {
        return String::new();
    };
    let is_free = |variable: &&Variable| {
        let endpoint = Endpoint::new(other.name(), variable.name.as_str());
        variable.causality == causality && !taken.contains(&endpoint)
    };
    let names: Vec<&str> = other.variables().iter().filter(is_free).map(|v| v.name.as_str()).collect();
    let quantity = wanted.split('[').next().unwrap_or(wanted);
    let has_quantity = |name: &&&str| {
        let mut words = name.split(|c: char| !c.is_alphanumeric());
        words.any(|word| word.eq_ignore_ascii_case(quantity))
    };
    let mut shown = near::near_matches(wanted, names.iter().copied());
    if shown.is_empty() {
        shown = names.iter().filter(has_quantity).take(8).copied().collect();
    }
    if shown.is_empty() {
        shown = names.iter().take(8).copied().collect();
    }
    match shown.len() {
        0 => format!("; {} has no free {causality}", other.name()),
        _ => format!("; free in {}: {}", other.name(), shown.join(", ")),
    }
}

//! A federation out of a staged scenario: who its federates are, and what each of them runs. Starts nothing.

use super::address::Address;
use super::error::FederationError;
use super::library::Helics;
use super::others::{Joining, OTHERS, Others, Turn};
use super::rejoining::Rejoining;
use super::session::Session;
use super::topics::{Form, Share, Topic, topics};
use super::waiting::Waiting;
use crate::harness::scenario::{GRID, Staged};
use crate::harness::{Algorithm, Apart, Column, Connection, Endpoint, Event, Participant, Plan};
use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

/// HELICS takes time as a double in seconds; up to here, 52 days, neighbouring ones are less than a nanosecond apart.
const LONGEST_NS: i64 = 1 << 52;

/// Inputs of a part whose value is whether the agent behind it is there.
const PRESENCE: &str = "remote_available";

/// A federation, before anything is connected.
pub struct Federation {
    participants: Vec<Box<dyn Participant>>,
    plan: Plan,
    topics: Vec<Topic>,
    whole: Plan,
    columns: Vec<(Column, Vec<Endpoint>)>,
}

impl Federation {
    /// Of the participants and the plan of one process.
    pub fn new(apart: Apart, form: Form) -> Result<Self, FederationError> {
        let Apart { staged: (participants, plan), whole, columns } = apart;
        if plan.algorithm != Algorithm::Jacobi {
            return Err(FederationError::Algorithm);
        }
        if plan.stop_ns > LONGEST_NS {
            let [stop_s, longest_s] = [plan.stop_ns, LONGEST_NS].map(|ns| ns as f64 / 1e9);
            return Err(FederationError::TooLong { stop_s, longest_s });
        }
        let topics = topics(&participants, &plan.connections, (form, GRID));
        Ok(Self { participants, plan, topics, whole, columns })
    }

    /// Names of the federates, those of the participants.
    pub fn names(&self) -> Vec<String> {
        self.participants.iter().map(|participant| participant.name().to_owned()).collect()
    }

    /// Everything that travels.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// The plan of the whole, as one process runs it.
    pub fn whole(&self) -> &Plan {
        &self.whole
    }

    /// The columns of the whole, each with its sources: of several the largest counts.
    pub fn columns(&self) -> &[(Column, Vec<Endpoint>)] {
        &self.columns
    }

    /// The share of the federate of this name.
    pub fn share(&self, name: &str) -> Result<Share, FederationError> {
        match self.participants.iter().any(|participant| participant.name() == name) {
            true => Ok(Share::of(name, &self.topics)),
            false => Err(FederationError::Unknown { found: name.to_owned(), known: self.names().join(", ") }),
        }
    }

    /// Connects one federate and gives back what its process runs: itself and the others, and its part of the plan.
    /// Whom it waits for, `waiting` knows from then on.
    pub fn join(
        self,
        helics: &Arc<Helics>,
        name: &str,
        address: &Address,
        (is_late, waiting): (bool, &Waiting),
    ) -> Result<Staged, FederationError> {
        let share = self.share(name)?;
        let plan = own_plan(&self.plan, name, &share);
        let Some(own) = self.participants.into_iter().find(|participant| participant.name() == name) else {
            return Err(FederationError::Unknown { found: name.to_owned(), known: String::new() });
        };
        let mut session = Session::connect(helics, name, address, &share)?;
        session.tell(waiting)?;
        let turn = if name == GRID { Turn::Plant } else { Turn::Controller };
        let inbound: Vec<&Connection> =
            plan.connections.iter().filter(|c| c.from.participant == OTHERS).collect();
        let heard: Vec<String> = heard_names(&share).collect();
        let place = |connection: &Connection| heard.iter().position(|name| *name == connection.from.variable);
        let mut starts = vec![0.0; heard.len()];
        for connection in &inbound {
            let target = own.variables().iter().find(|v| v.name == connection.to.variable);
            let start = target.and_then(|variable| variable.start).map_or(0.0, |value| value.as_f64());
            if let Some(value) = place(connection).and_then(|place| starts.get_mut(place)) {
                *value = (start - connection.offset) / connection.factor;
            }
        }
        let tells = |connection: &&&Connection| connection.to.variable.starts_with(PRESENCE);
        let presence: Vec<usize> = inbound.iter().filter(tells).filter_map(|c| place(c)).collect();
        let joined_ns = Rc::new(Cell::new(0));
        let (joining, own): (_, Box<dyn Participant>) = match is_late {
            false => (Joining::AtStart, own),
            true => {
                let own = Box::new(Rejoining::new(own, Rc::clone(&joined_ns)));
                (Joining::Late(joined_ns), own)
            }
        };
        let others = Others::new(session, &share, (turn, joining), starts, &presence, GRID);
        let participants: Vec<Box<dyn Participant>> = match turn {
            // The master passes values on in this order, which is that of the exchange.
            Turn::Plant => vec![Box::new(others), own],
            Turn::Controller => vec![own, Box::new(others)],
        };
        Ok((participants, plan))
    }

    /// Ends the membership of a federate whose process has died, so that the others go on without it.
    ///
    /// HELICS waits for a dead federate for ever: those who live ask each other for the time again and again, and the
    /// broker, which looks after its connections only in silence, never looks. But a federate that may come back
    /// (reentrant) is let in while its name is still taken. So one is sent in its name twice: the first time its leaving
    /// frees the names of its publications, the second time it stands where the dead one stood, and leaves properly.
    pub fn bury(&self, helics: &Arc<Helics>, name: &str, address: &Address) -> Result<i64, FederationError> {
        let share = self.share(name)?;
        Session::enter(helics, name, address)?.leave()?;
        let mut session = Session::connect(helics, name, address, &share)?;
        let at_ns = session.enter_executing()?;
        session.leave()?;
        Ok(at_ns)
    }
}

/// Names of what is heard, as the outputs of the others are called.
fn heard_names(share: &Share) -> impl Iterator<Item = String> {
    let names = |topic: &Topic| -> Vec<String> {
        topic.variables.iter().map(|variable| format!("{}.{variable}", topic.from)).collect()
    };
    share.heard.iter().flat_map(names)
}

/// What of the plan of one process concerns this federate. All events keep their times, so that all steps are cut alike.
fn own_plan(plan: &Plan, name: &str, share: &Share) -> Plan {
    let is_own = |endpoint: &Endpoint| endpoint.participant == name;
    let inbound = plan.connections.iter().filter(|c| is_own(&c.to)).map(|connection| {
        let from = match is_own(&connection.from) {
            true => connection.from.clone(),
            false => Endpoint::new(OTHERS, connection.from.to_string()),
        };
        Connection { from, ..connection.clone() }
    });
    let outbound = share.told_variables.iter().map(|variable| {
        Connection::new(Endpoint::new(name, variable.as_str()), Endpoint::new(OTHERS, variable.as_str()))
    });
    let event = |event: &Event| {
        let sets = event.sets.iter().filter(|setting| setting.participant == name).cloned().collect();
        Event { at_ns: event.at_ns, sets }
    };
    Plan {
        connections: inbound.chain(outbound).collect(),
        initial: plan.initial.iter().filter(|setting| setting.participant == name).cloned().collect(),
        events: plan.events.iter().map(event).collect(),
        ..plan.clone()
    }
}

//! The variables of `BessConsensus.fmu`: the contract of DESIGN, section 3. Names are public; so is the order,
//! because value references count it.

use super::{Controller, parameters};
use crate::control::topology::Topologies;
use crate::fmi::{Access, Causality, Dependencies, Group, Range, Unit};
use crate::models::variables::{GroupExt, group, input, output, switch};

/// What every input u follows at once: the measurements of the agent and of whoever may become its
/// neighbour, the virtual leader, and the switches.
const MEASUREMENTS: &[&str] = &[
    "P",
    "Q",
    "V",
    "omega",
    "E",
    "omega_ref",
    "V_ref",
    "P_ref",
    "enable",
    "dispatch",
    "available",
    "topology",
];

/// The measurements among them.
pub(super) const MEASURED: &[&str] = &["P", "Q", "V", "omega", "E"];
/// The scalars among them.
pub(super) const COMMON: &[&str] = &["omega_ref", "V_ref", "P_ref", "enable", "dispatch", "topology"];
/// Up to so many agents all `available` are named. Beyond, those of the agent and its neighbours: that of another
/// agent counts only where its leaving parts the graph, and the lists would grow with the square of the agents.
pub(super) const FEW: usize = 100;

/// All variables for `n` agents with these communication graphs.
pub fn variables(n: usize, topologies: &Topologies) -> Vec<Group<Controller>> {
    let written = topologies.are_written();
    let mut all = inputs(n, topologies.count());
    all.extend(setpoints(n));
    all.extend(consensus_inputs(n, || measurements(written)));
    all.extend(diagnostics(n, written));
    all.extend(parameters::tunable());
    all.extend(parameters::fixed(n));
    all.iter_mut().filter(|group| group.count.is_some()).for_each(|group| group.size = Some("n"));
    all
}

/// What the inputs u of an agent follow: where the graphs are written out, it hears its neighbours only.
fn measurements(written: bool) -> Dependencies<Controller> {
    if written { Dependencies::Of(heard) } else { Dependencies::All(MEASUREMENTS) }
}

fn heard(model: &Controller, i: usize) -> Vec<(&'static str, usize)> {
    let order = model.order();
    let neighbours = model.topologies().neighbours(order.at(i)).map(|place| order.agent(place));
    let around: Vec<usize> = std::iter::once(i).chain(neighbours).collect();
    let named = |name: &'static str, agents: &[usize]| agents.iter().map(|&j| (name, j)).collect::<Vec<_>>();
    let mut all: Vec<_> = MEASURED.iter().flat_map(|name| named(name, &around)).collect();
    all.extend(COMMON.iter().map(|&name| (name, 0)));
    let n = model.agents();
    all.extend(if n <= FEW {
        named("available", &(0..n).collect::<Vec<_>>())
    } else {
        named("available", &around)
    });
    all
}

pub(super) fn inputs(n: usize, topologies: usize) -> Vec<Group<Controller>> {
    vec![
        input(
            "P",
            "Measured active power",
            |m: &Controller, i| m.inputs().P[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.inputs_mut().P[at] = v;
            },
        )
        .each(n)
        .in_row(|m| Some(&m.ordered()?.inputs().P), |m| Some(&mut m.ordered_mut()?.inputs_mut().P))
        .unit(Unit::PerUnit),
        input(
            "Q",
            "Measured reactive power, inductive positive",
            |m: &Controller, i| m.inputs().Q[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.inputs_mut().Q[at] = v;
            },
        )
        .each(n)
        .in_row(|m| Some(&m.ordered()?.inputs().Q), |m| Some(&mut m.ordered_mut()?.inputs_mut().Q))
        .unit(Unit::PerUnit),
        input(
            "V",
            "Measured voltage",
            |m: &Controller, i| m.inputs().V[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.inputs_mut().V[at] = v;
            },
        )
        .each(n)
        .in_row(|m| Some(&m.ordered()?.inputs().V), |m| Some(&mut m.ordered_mut()?.inputs_mut().V))
        .unit(Unit::PerUnit),
        input(
            "omega",
            "Measured frequency",
            |m: &Controller, i| m.inputs().omega[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.inputs_mut().omega[at] = v;
            },
        )
        .each(n)
        .in_row(|m| Some(&m.ordered()?.inputs().omega), |m| Some(&mut m.ordered_mut()?.inputs_mut().omega))
        .unit(Unit::PerUnit),
        input(
            "E",
            "Stored energy",
            |m: &Controller, i| m.inputs().E[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.inputs_mut().E[at] = v;
            },
        )
        .each(n)
        .in_row(|m| Some(&m.ordered()?.inputs().E), |m| Some(&mut m.ordered_mut()?.inputs_mut().E))
        .unit(Unit::PerUnitHour),
        input(
            "omega_ref",
            "Frequency of the virtual leader",
            |m: &Controller, _| m.inputs().omega_ref,
            |m: &mut Controller, _, v| {
                m.inputs_mut().omega_ref = v;
            },
        )
        .unit(Unit::PerUnit),
        input(
            "V_ref",
            "Voltage of the virtual leader",
            |m: &Controller, _| m.inputs().V_ref,
            |m: &mut Controller, _, v| {
                m.inputs_mut().V_ref = v;
            },
        )
        .unit(Unit::PerUnit),
        input(
            "P_ref",
            "Dispatched scaled power K_P P of the virtual leader",
            |m: &Controller, _| m.inputs().P_ref,
            |m: &mut Controller, _, v| {
                m.inputs_mut().P_ref = v;
            },
        )
        .unit(Unit::PerUnit),
        switch(
            "enable",
            "Controller on; off, it holds its setpoints",
            |m: &Controller, _| m.inputs().enable,
            |m: &mut Controller, _, v| {
                m.inputs_mut().enable = v;
            },
        ),
        switch(
            "dispatch",
            "The pinned agents follow P_ref",
            |m: &Controller, _| m.inputs().dispatch,
            |m: &mut Controller, _, v| {
                m.inputs_mut().dispatch = v;
            },
        ),
        switch(
            "available",
            "The agent takes part; if not, it is cut from the graph",
            |m: &Controller, i| m.inputs().available[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.inputs_mut().available[at] = v;
            },
        )
        .each(n),
        group(
            "topology",
            "Number of the communication graph, from 1",
            Causality::Input,
            Access::Integer(
                |m: &Controller, _| m.inputs().topology,
                Some(|m: &mut Controller, _, v| m.inputs_mut().topology = v),
            ),
        )
        .range(Range { min: 1.0, min_excluded: false, max: topologies as f64 }),
    ]
}

/// Sampled outputs: they change in a step only.
pub(super) fn setpoints(n: usize) -> Vec<Group<Controller>> {
    vec![
        output("omega_set", "Frequency setpoint of the droop", |m: &Controller, i| {
            m.outputs().omega_set[m.at(i)]
        })
        .in_row(|m| Some(&m.ordered()?.outputs().omega_set), |_| None),
        output("V_set", "Voltage setpoint of the droop", |m: &Controller, i| m.outputs().V_set[m.at(i)])
            .in_row(|m| Some(&m.ordered()?.outputs().V_set), |_| None),
        output("P_set", "Active power reference: the energy exchange", |m: &Controller, i| {
            m.outputs().P_set[m.at(i)]
        })
        .in_row(|m| Some(&m.ordered()?.outputs().P_set), |_| None),
        output("Q_set", "Reactive power reference", |m: &Controller, i| m.outputs().Q_set[m.at(i)])
            .in_row(|m| Some(&m.ordered()?.outputs().Q_set), |_| None),
    ]
    .into_iter()
    .map(|g| g.each(n).unit(Unit::PerUnit))
    .collect()
}

/// The rates of the laws, which `heard` says what they follow.
pub(super) fn consensus_inputs(
    n: usize,
    heard: impl Fn() -> Dependencies<Controller>,
) -> Vec<Group<Controller>> {
    vec![
        output("u_omega", "Consensus input of the frequency, equation (12)", |m: &Controller, i| {
            m.outputs().u_omega[m.at(i)]
        }),
        output("u_P", "Consensus input of the active power, equation (9)", |m: &Controller, i| {
            m.outputs().u_P[m.at(i)]
        }),
        output("u_E", "Consensus input of the state of charge, equation (11)", |m: &Controller, i| {
            m.outputs().u_E[m.at(i)]
        }),
        output("u_V", "Consensus input of the voltage, equation (13)", |m: &Controller, i| {
            m.outputs().u_V[m.at(i)]
        }),
        output("u_Q", "Consensus input of the reactive power, equation (10)", |m: &Controller, i| {
            m.outputs().u_Q[m.at(i)]
        }),
    ]
    .into_iter()
    .map(|g| {
        let unit = if g.name == "u_E" { Unit::PerSecond } else { Unit::PerUnitPerSecond };
        g.each(n).unit(unit).follows(heard())
    })
    .collect()
}

fn diagnostics(n: usize, written: bool) -> Vec<Group<Controller>> {
    let errors = [
        output("spread_P", "Largest difference of K_P (P - P_set)", |m: &Controller, _| m.outputs().spread_P)
            .follows(Dependencies::All(&["P", "available"])),
        output("spread_Q", "Largest difference of K_Q (Q - Q_set)", |m: &Controller, _| m.outputs().spread_Q)
            .follows(Dependencies::All(&["Q", "available"])),
        output("spread_E", "Largest difference of the state of charge E / C", |m: &Controller, _| {
            m.outputs().spread_E
        })
        .follows(Dependencies::All(&["E", "available"])),
        output("error_omega", "Largest distance of a frequency from omega_ref", |m: &Controller, _| {
            m.outputs().error_omega
        })
        .follows(Dependencies::All(&["omega", "omega_ref", "available"])),
        output("error_V", "Largest distance of a voltage from V_ref", |m: &Controller, _| {
            m.outputs().error_V
        })
        .follows(Dependencies::All(&["V", "V_ref", "available"])),
    ];
    let of = |name: &str| if name == "spread_E" { Unit::One } else { Unit::PerUnit };
    let mut all: Vec<_> = errors.into_iter().map(|g| (of(g.name), g)).map(|(unit, g)| g.unit(unit)).collect();
    all.push(
        output(
            "lambda_2",
            "Second smallest eigenvalue of the certificate's Laplacian; 1/s^(2 / (1 + eta))",
            |m: &Controller, _| m.outputs().lambda_2,
        )
        .follows(Dependencies::All(&["available", "topology"])),
    );
    all.push(
        output(
            "T_P",
            "Certified time until power sharing from the present errors, equation (27)",
            |m: &Controller, _| m.outputs().T_P,
        )
        .unit(Unit::Second)
        .follows(Dependencies::All(&["P", "P_ref", "dispatch", "available", "topology"])),
    );
    all.push(
        output(
            "T_omega",
            "Certified time until frequency restoration from the present errors, equation (33)",
            |m: &Controller, _| m.outputs().T_omega,
        )
        .unit(Unit::Second)
        .follows(Dependencies::All(&["omega", "omega_ref", "available", "topology"])),
    );
    all.push(
        group(
            "cluster",
            "Number of the agent's cluster, from 1",
            Causality::Output,
            Access::Integer(|m: &Controller, i| m.outputs().cluster[m.at(i)], None),
        )
        .each(n)
        .follows(Dependencies::All(if written { &["topology"] } else { &["available", "topology"] })),
    );
    all.push(
        group(
            "saturated",
            "A limit of the agent is active",
            Causality::Output,
            Access::Boolean(|m: &Controller, i| m.outputs().saturated[m.at(i)], None),
        )
        .each(n)
        .follows(measurements(written)),
    );
    all
}

//! The variables of `BessGrid.fmu`: the contract of DESIGN, section 3. Names are public; so is the order,
//! because value references count it.

use super::Grid;
use crate::fmi::{Dependencies, Group, Range, Unit};
use crate::models::variables::{GroupExt, input, output, parameter, switch};

/// All variables for `n` batteries and `buses` buses, with or without a tie to the main grid.
pub fn variables(n: usize, buses: usize, has_tie: bool) -> Vec<Group<Grid>> {
    let mut all = inputs(n, buses, has_tie);
    all.extend(outputs(n, buses));
    all.extend(parameters(n));
    for group in all.iter_mut().filter(|group| group.count.is_some()) {
        let of_buses = ["dP_load", "dQ_load", "bus_V", "bus_angle"].contains(&group.name);
        group.size = Some(if of_buses { "n_bus" } else { "n" });
    }
    all
}

fn inputs(n: usize, buses: usize, has_tie: bool) -> Vec<Group<Grid>> {
    let breaker = if has_tie { Range::ANY } else { Range::FALSE };
    vec![
        input(
            "omega_set",
            "Frequency setpoint of the droop",
            |m: &Grid, i| m.inputs().omega_set[i],
            |m: &mut Grid, i, v| {
                m.inputs_mut().omega_set[i] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit),
        input(
            "V_set",
            "Voltage setpoint of the droop",
            |m: &Grid, i| m.inputs().V_set[i],
            |m: &mut Grid, i, v| {
                m.inputs_mut().V_set[i] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit),
        input(
            "P_set",
            "Active power reference of the droop",
            |m: &Grid, i| m.inputs().P_set[i],
            |m: &mut Grid, i, v| {
                m.inputs_mut().P_set[i] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit),
        input(
            "Q_set",
            "Reactive power reference of the droop",
            |m: &Grid, i| m.inputs().Q_set[i],
            |m: &mut Grid, i, v| {
                m.inputs_mut().Q_set[i] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit),
        input(
            "dP_load",
            "Change of the active load at 1 pu voltage, by position of the bus",
            |m: &Grid, b| m.inputs().dP_load[b],
            |m: &mut Grid, b, v| m.inputs_mut().dP_load[b] = v,
        )
        .each(buses)
        .unit(Unit::PerUnit),
        input(
            "dQ_load",
            "Change of the reactive load at 1 pu voltage, by position of the bus",
            |m: &Grid, b| m.inputs().dQ_load[b],
            |m: &mut Grid, b, v| m.inputs_mut().dQ_load[b] = v,
        )
        .each(buses)
        .unit(Unit::PerUnit),
        switch(
            "tie_closed",
            "Breaker to the main grid",
            |m: &Grid, _| m.inputs().tie_closed,
            |m: &mut Grid, _, v| {
                m.inputs_mut().tie_closed = v;
            },
        )
        .range(breaker),
    ]
}

fn outputs(n: usize, buses: usize) -> Vec<Group<Grid>> {
    let network = || Dependencies::All(&["V_set", "Q_set", "dP_load", "dQ_load", "tie_closed"]);
    vec![
        output("P", "Measured active power", |m: &Grid, i| m.planes.get(|g| g.P(i), |d| d.P(i)))
            .each(n)
            .unit(Unit::PerUnit),
        output("Q", "Measured reactive power, inductive positive", |m: &Grid, i| {
            m.planes.get(|g| g.Q(i), |d| d.Q(i))
        })
        .each(n)
        .unit(Unit::PerUnit),
        output("V", "Voltage of the inverter", |m: &Grid, i| m.planes.get(|g| g.V(i), |d| d.V[i]))
            .each(n)
            .unit(Unit::PerUnit)
            .follows(Dependencies::SameIndex(&["V_set", "Q_set"])),
        output("omega", "Frequency of the inverter", |m: &Grid, i| {
            m.planes.get(|g| g.omega(i), |d| d.omega[i])
        })
        .each(n)
        .unit(Unit::PerUnit)
        .follows(Dependencies::SameIndex(&["omega_set", "P_set"])),
        output("E", "Stored energy", |m: &Grid, i| m.planes.get(|g| g.E(i), |d| d.E(i)))
            .each(n)
            .unit(Unit::PerUnitHour),
        output("bus_V", "Voltage magnitude, by position of the bus", |m: &Grid, b| {
            m.planes.get(|g| g.bus_V(b), |d| d.bus_V[b])
        })
        .each(buses)
        .unit(Unit::PerUnit)
        .follows(network()),
        output("bus_angle", "Voltage angle, by position of the bus", |m: &Grid, b| {
            m.planes.get(|g| g.bus_angle(b), |d| d.bus_angle[b])
        })
        .each(buses)
        .unit(Unit::Radian)
        .follows(network()),
        output("tie_P", "Active power from the main grid", |m: &Grid, _| {
            m.planes.get(|g| g.tie_P(), |d| d.tie.0)
        })
        .unit(Unit::PerUnit)
        .follows(network()),
        output("tie_Q", "Reactive power from the main grid", |m: &Grid, _| {
            m.planes.get(|g| g.tie_Q(), |d| d.tie.1)
        })
        .unit(Unit::PerUnit)
        .follows(network()),
    ]
}

fn parameters(n: usize) -> Vec<Group<Grid>> {
    vec![
        parameter(
            "E_start",
            "Stored energy at the start",
            |m: &Grid, i| m.parameters().E_start[i],
            |m: &mut Grid, i, v| {
                m.parameters_mut().E_start[i] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnitHour),
        parameter(
            "K_P",
            "Active power droop",
            |m: &Grid, i| m.parameters().K_P[i],
            |m: &mut Grid, i, v| {
                m.parameters_mut().K_P[i] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit)
        .range(Range::POSITIVE),
        parameter(
            "K_Q",
            "Reactive power droop",
            |m: &Grid, i| m.parameters().K_Q[i],
            |m: &mut Grid, i, v| {
                m.parameters_mut().K_Q[i] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit)
        .range(Range::POSITIVE),
        parameter(
            "X_c",
            "Coupling reactance",
            |m: &Grid, i| m.parameters().X_c[i],
            |m: &mut Grid, i, v| {
                m.parameters_mut().X_c[i] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit)
        .range(Range::POSITIVE),
        parameter(
            "omega_c",
            "Cutoff frequency of the power measurement",
            |m: &Grid, _| m.parameters().omega_c,
            |m: &mut Grid, _, v| {
                m.parameters_mut().omega_c = v;
            },
        )
        .unit(Unit::RadianPerSecond)
        .range(Range::POSITIVE),
    ]
}

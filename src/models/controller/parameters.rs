//! The parameters of `BessConsensus.fmu`, in the order of DESIGN, section 3.

use super::Controller;
use crate::control::config::{Discretisation, VoltagePolicy};
use crate::fmi::{Access, Causality, Group, Range, Unit};
use crate::models::variables::{GroupExt, group, parameter};

/// What may be set between steps.
pub fn tunable() -> Vec<Group<Controller>> {
    let gain = Range::NOT_NEGATIVE;
    vec![
        parameter(
            "eta",
            "Exponent of the sign power; 1 is the asymptotic law",
            |m: &Controller, _| m.parameters().eta,
            |m: &mut Controller, _, v| m.parameters_mut().eta = v,
        )
        .range(Range { min: 0.0, min_excluded: true, max: 1.0 }),
        parameter(
            "gain_omega",
            "Gain of u_omega; pu^(1 - eta)/s",
            |m: &Controller, _| m.parameters().gain_omega,
            |m: &mut Controller, _, v| {
                m.parameters_mut().gain_omega = v;
            },
        )
        .unit(Unit::PerSecond)
        .range(gain),
        parameter(
            "gain_P",
            "Gain of u_P; pu^(1 - eta)/s",
            |m: &Controller, _| m.parameters().gain_P,
            |m: &mut Controller, _, v| {
                m.parameters_mut().gain_P = v;
            },
        )
        .unit(Unit::PerSecond)
        .range(gain),
        parameter(
            "gain_E",
            "Gain of the energy exchange",
            |m: &Controller, _| m.parameters().gain_E,
            |m: &mut Controller, _, v| {
                m.parameters_mut().gain_E = v;
            },
        )
        .unit(Unit::PerSecond)
        .range(gain),
        parameter(
            "gain_V",
            "Gain of u_V; pu^(1 - eta)/s",
            |m: &Controller, _| m.parameters().gain_V,
            |m: &mut Controller, _, v| {
                m.parameters_mut().gain_V = v;
            },
        )
        .unit(Unit::PerSecond)
        .range(gain),
        parameter(
            "gain_Q",
            "Gain of u_Q; pu^(1 - eta)/s",
            |m: &Controller, _| m.parameters().gain_Q,
            |m: &mut Controller, _, v| {
                m.parameters_mut().gain_Q = v;
            },
        )
        .unit(Unit::PerSecond)
        .range(gain),
        parameter(
            "delay",
            "Communication delay of every edge without one of its own",
            |m: &Controller, _| m.parameters().delay,
            |m: &mut Controller, _, v| m.parameters_mut().delay = v,
        )
        .unit(Unit::Second)
        .range(gain),
        parameter(
            "theta_min",
            "Least width of the boundary layer",
            |m: &Controller, _| m.parameters().theta_min,
            |m: &mut Controller, _, v| {
                m.parameters_mut().theta_min = v;
            },
        )
        .unit(Unit::Second)
        .range(gain),
        parameter(
            "theta_E",
            "Boundary layer of the energy exchange",
            |m: &Controller, _| m.parameters().theta_E,
            |m: &mut Controller, _, v| {
                m.parameters_mut().theta_E = v;
            },
        )
        .unit(Unit::Second)
        .range(gain),
    ]
    .into_iter()
    .map(GroupExt::tunable)
    .collect()
}

/// What is fixed when initialisation ends, for `n` agents.
pub fn fixed(n: usize) -> Vec<Group<Controller>> {
    let choice = Range { min: 0.0, min_excluded: false, max: 1.0 };
    vec![
        group(
            "voltage_policy",
            "0: equation (13) as printed; 1: equal K_Q Q and the average voltage at V_ref",
            Causality::Parameter,
            Access::Integer(
                |m: &Controller, _| m.parameters().voltage_policy.number(),
                Some(|m: &mut Controller, _, v| {
                    m.parameters_mut().voltage_policy = VoltagePolicy::from_number(v).unwrap_or_default();
                }),
            ),
        )
        .range(choice),
        group(
            "discretisation",
            "0: capped; 1: explicit",
            Causality::Parameter,
            Access::Integer(
                |m: &Controller, _| m.parameters().discretisation.number(),
                Some(|m: &mut Controller, _, v| {
                    m.parameters_mut().discretisation = Discretisation::from_number(v).unwrap_or_default();
                }),
            ),
        )
        .range(choice),
        parameter(
            "K_P",
            "Active power droop",
            |m: &Controller, i| m.parameters().K_P[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.parameters_mut().K_P[at] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit)
        .range(Range::POSITIVE),
        parameter(
            "K_Q",
            "Reactive power droop",
            |m: &Controller, i| m.parameters().K_Q[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.parameters_mut().K_Q[at] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit)
        .range(Range::POSITIVE),
        parameter(
            "capacity",
            "Energy capacity C",
            |m: &Controller, i| m.parameters().capacity[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.parameters_mut().capacity[at] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnitHour)
        .range(Range::POSITIVE),
        parameter(
            "P_exchange_max",
            "Most power that the energy exchange asks of the battery",
            |m: &Controller, i| m.parameters().P_exchange_max[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.parameters_mut().P_exchange_max[at] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit)
        .range(Range::NOT_NEGATIVE),
        parameter(
            "omega_set_start",
            "Frequency setpoint at the start",
            |m: &Controller, i| m.parameters().omega_set_start[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.parameters_mut().omega_set_start[at] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit)
        .range(Range::POSITIVE),
        parameter(
            "V_set_start",
            "Voltage setpoint at the start",
            |m: &Controller, i| m.parameters().V_set_start[m.at(i)],
            |m: &mut Controller, i, v| {
                let at = m.at(i);
                m.parameters_mut().V_set_start[at] = v;
            },
        )
        .each(n)
        .unit(Unit::PerUnit)
        .range(Range::POSITIVE),
    ]
}

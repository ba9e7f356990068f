//! The plant: network, power flow, droop inverter, battery, loads, tie; and the agent model. Pure.
#![forbid(unsafe_code)]

//! The paper: graph, clustering, protocol, discretisation, delay, certificates. Pure: no I/O, no FMI.
#![forbid(unsafe_code)]

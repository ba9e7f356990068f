//! The shared library of `BessConsensus.fmu`: the controller model behind the FMI 2.0 functions.

bess_consensus::export_fmi2!(bess_consensus::models::Controller);

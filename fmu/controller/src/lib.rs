//! The shared library of `BessConsensus.fmu`: the controller model behind the functions of FMI 2.0 and FMI 3.0.

bess_consensus::export_fmi2!(bess_consensus::models::Controller);
bess_consensus::export_fmi3!(bess_consensus::models::Controller);

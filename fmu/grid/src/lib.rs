//! The shared library of `BessGrid.fmu`: the grid model behind the functions of FMI 2.0 and FMI 3.0.

bess_consensus::export_fmi2!(bess_consensus::models::Grid);
bess_consensus::export_fmi3!(bess_consensus::models::Grid);

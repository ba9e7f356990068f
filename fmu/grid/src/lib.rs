//! The shared library of `BessGrid.fmu`: the grid model behind the FMI 2.0 functions.

bess_consensus::export_fmi2!(bess_consensus::models::Grid);

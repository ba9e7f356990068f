//! Electrical distances between BESS, the default distances of the clustering (DESIGN section 1).

use super::case::Case;
use super::error::GridError;
use super::load::LoadModel;
use super::lu::Lu;
use super::plant::Plant;
use faer::c64;

/// n x n distances between BESS buses (ids), pu: `abs(Z_ii + Z_jj - Z_ij - Z_ji)`, Z the inverse of the
/// bus admittance matrix with the loads' admittances at the solved voltage in it (for Z_ij = Z_ji, as
/// without phase shifters, DESIGN's `Z_ii + Z_jj - 2 Z_ij`). Symmetric, zero on the diagonal.
pub fn electrical_distances(case: &Case, bess_buses: &[u64]) -> Result<Vec<Vec<f64>>, GridError> {
    case.validate("case.")?;
    let plant = Plant::of_case(case, bess_buses, LoadModel::Impedance)?;
    let lu = Lu::new(&plant.admittance, "the case with its loads and without sources")?;
    let mut scratch = lu.scratch();
    let n = plant.n();
    let mut Z = vec![vec![c64::ZERO; n]; n];
    let mut column = vec![c64::ZERO; plant.n_bus()];
    for j in 0..n {
        column.fill(c64::ZERO);
        column[plant.bess_bus[j]] = c64::ONE;
        lu.solve(&mut column, &mut scratch);
        for i in 0..n {
            Z[i][j] = column[plant.bess_bus[i]];
        }
    }
    let mut distance = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..i {
            let d = (Z[i][i] + Z[j][j] - Z[i][j] - Z[j][i]).norm();
            if !d.is_finite() {
                return Err(GridError::Singular { what: "the case with its loads and without sources" });
            }
            distance[i][j] = d;
            distance[j][i] = d;
        }
    }
    Ok(distance)
}

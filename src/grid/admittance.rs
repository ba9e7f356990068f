//! The bus admittance matrix: lines, transformers with taps and phase shifts, line charging, bus
//! shunts. Knows nothing of loads and sources.

use super::case::{Case, ISOLATED};
use super::error::GridError;
use faer::c64;
use faer::sparse::{SparseColMat, Triplet};

/// A sparse complex matrix, compressed columns.
pub type SparseMatrix = SparseColMat<usize, c64>;

/// Bus admittance matrix of a validated case, pu, rows and columns in the order of the bus table.
/// Every diagonal entry is stored; branches out of service or at an isolated bus are left out.
pub fn bus_admittance(case: &Case) -> Result<SparseMatrix, GridError> {
    let positions = case.positions();
    let n = case.bus.len();
    let mut entries = Vec::with_capacity(n + 4 * case.branch.len());
    for (k, bus) in case.bus.iter().enumerate() {
        let shunt = if bus.kind == ISOLATED { c64::ZERO } else { c64::new(bus.gs, bus.bs) / case.base_mva };
        entries.push(Triplet::new(k, k, shunt));
    }
    for branch in case.branch.iter().filter(|branch| branch.status == 1) {
        let (Some(&f), Some(&t)) = (positions.get(&branch.from), positions.get(&branch.to)) else { continue };
        if case.bus[f].kind == ISOLATED || case.bus[t].kind == ISOLATED {
            continue;
        }
        let series = c64::ONE / c64::new(branch.r, branch.x);
        let charging = c64::new(0.0, branch.b / 2.0);
        let ratio = if branch.ratio == 0.0 { 1.0 } else { branch.ratio };
        let tap = c64::from_polar(ratio, branch.shift.to_radians());
        entries.push(Triplet::new(f, f, (series + charging) / (ratio * ratio)));
        entries.push(Triplet::new(f, t, -series / tap.conj()));
        entries.push(Triplet::new(t, f, -series / tap));
        entries.push(Triplet::new(t, t, series + charging));
    }
    SparseColMat::try_new_from_triplets(n, n, &entries)
        .map_err(|_| GridError::Singular { what: "the bus admittance matrix" })
}

/// Where the diagonal entries stand in the values of a matrix that stores all of them.
pub(crate) fn diagonal_positions(matrix: &SparseMatrix) -> Vec<usize> {
    let (col_ptr, row_idx) = (matrix.symbolic().col_ptr(), matrix.symbolic().row_idx());
    (0..matrix.ncols()).filter_map(|j| (col_ptr[j]..col_ptr[j + 1]).find(|&at| row_idx[at] == j)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two buses, one transformer: the textbook pi equivalent with the tap at `from`.
    #[test]
    fn a_phase_shifting_transformer_by_hand() {
        let case = Case::from_json(
            r#"{"base_mva": 100, "bus": [{"id": 7, "type": 3, "gs": 5, "bs": 19}, {"id": 3, "type": 1}],
                "branch": [{"from": 7, "to": 3, "r": 0.0, "x": 0.25, "b": 0.2, "ratio": 0.8, "shift": 90}],
                "generator": [{"bus": 7}]}"#,
        )
        .unwrap();
        let y = bus_admittance(&case).unwrap().to_dense();
        let close = |a: c64, re: f64, im: f64| (a - c64::new(re, im)).norm() < 1e-12;
        // Series -4j, charging 0.1j at each end; N = 0.8 j.
        assert!(close(y[(0, 0)], 0.05, -3.9 / 0.64 + 0.19));
        assert!(close(y[(1, 1)], 0.0, -3.9));
        // Y_ft = -y / conj(N) = 4j / (-0.8j) = -5;  Y_tf = -y / N = 4j / 0.8j = 5.
        assert!(close(y[(0, 1)], -5.0, 0.0));
        assert!(close(y[(1, 0)], 5.0, 0.0));
    }
}

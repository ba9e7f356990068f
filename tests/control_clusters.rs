//! CAK finds the clusters that were planted, and those of the paper's case.
#![cfg(feature = "controller")]

mod control_support;

use bess_consensus::control::clustering::{Verdict, cluster};
use control_support::Random;

/// A normal deviate (Box, Muller).
fn normal(random: &mut Random) -> f64 {
    let radius = (-2.0 * random.within(1e-300, 1.0).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.within(0.0, 1.0)).cos()
}

#[test]
fn planted_clusters_are_found() {
    let mut random = Random(7);
    for groups in 2..=6 {
        let mut found = 0;
        for _ in 0..100 {
            let mut places = Vec::new();
            let mut planted = Vec::new();
            for g in 0..groups {
                let angle = std::f64::consts::TAU * g as f64 / groups as f64;
                for _ in 0..random.integer(4, 8) {
                    let (dx, dy) = (0.4 * normal(&mut random), 0.4 * normal(&mut random));
                    places.push((10.0 * angle.cos() + dx, 10.0 * angle.sin() + dy));
                    planted.push(g);
                }
            }
            let distance = |a: &(f64, f64), b: &(f64, f64)| (a.0 - b.0).hypot(a.1 - b.1);
            let distances: Vec<Vec<f64>> =
                places.iter().map(|a| places.iter().map(|b| distance(a, b)).collect()).collect();
            // Groups are numbered by their lowest agents, as the clusters are.
            found += usize::from(cluster(&distances).cluster == planted);
        }
        println!("{groups} groups: {found} of 100");
        assert!(found >= 97, "{groups} groups: {found} of 100");
    }
}

/// Electrical distances abs(Z_ii + Z_jj - 2 Z_ij) between buses 1, 2, 3, 6, 8, 9, 12 of the 57-bus case, from
/// an independent computation (NumPy, loads as admittances at the case's voltages), to four digits.
#[test]
fn the_57_bus_case_has_the_two_clusters_of_the_paper() {
    let upper = [
        [0.0, 0.0252, 0.0560, 0.1116, 0.1058, 0.0880, 0.0677],
        [0.0, 0.0, 0.0533, 0.1144, 0.1120, 0.0961, 0.0799],
        [0.0, 0.0, 0.0, 0.0813, 0.0907, 0.0803, 0.0760],
        [0.0, 0.0, 0.0, 0.0, 0.0670, 0.0844, 0.1081],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0417, 0.0868],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0601],
        [0.0; 7],
    ];
    let distances: Vec<Vec<f64>> =
        (0..7).map(|i: usize| (0..7).map(|j| upper[i.min(j)][i.max(j)]).collect()).collect();
    let found = cluster(&distances);
    for (k, cut) in found.cuts.iter().enumerate() {
        println!("{cut:?}");
        let first = found.cuts[0].gain;
        let later = found.cuts[k + 1..].iter().any(|later| later.gain >= first);
        let expected = match (k, cut.gain >= first, later) {
            (0, ..) => Verdict::First,
            (_, true, _) => Verdict::Gains,
            (_, false, true) => Verdict::OnTheWay,
            (_, false, false) => Verdict::Kept,
        };
        assert_eq!(cut.verdict, expected, "{cut:?}");
    }
    assert!(found.cuts.iter().any(|cut| cut.verdict == Verdict::OnTheWay), "this case shows what it is for");
    assert_eq!(found.cluster, [0, 0, 0, 1, 1, 1, 1]);
}

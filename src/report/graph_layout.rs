//! Where to draw agents that have no positions of their own: each cluster a ring, the rings around a
//! common centre, leaders turned towards it. Only a drawing; says nothing about distances.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Pages are wide and names are written across: the rings become ellipses.
const STRETCH: f64 = 1.6;

/// Positions (x, y), in arbitrary units, for agents of these clusters. `groups` holds the cluster of
/// each agent, `is_leader` (missing entries are `false`) whether it is its cluster's active leader.
pub fn cluster_layout(groups: &[usize], is_leader: &[bool]) -> Vec<(f64, f64)> {
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (agent, group) in groups.iter().enumerate() {
        members.entry(*group).or_default().push(agent);
    }
    // Neighbours on a ring lie about one unit apart.
    let radius = |count: usize| if count < 2 { 0.0 } else { 0.5 / (PI / count as f64).sin().min(1.0) };
    let largest = members.values().map(|m| radius(m.len())).fold(0.0, f64::max);
    let clusters = members.len();
    let spread = if clusters < 2 { 0.0 } else { (largest + 0.7) / (PI / clusters as f64).sin() };
    let mut positions = vec![(0.0, 0.0); groups.len()];
    for (c, agents) in members.values().enumerate() {
        // The first cluster lies on the left; two clusters lie side by side.
        let bearing = PI - TAU * c as f64 / clusters as f64;
        let (centre_x, centre_y) = (spread * bearing.cos(), spread * bearing.sin());
        let inward = if clusters < 2 { FRAC_PI_2 } else { bearing + PI };
        let lead = agents.iter().position(|&a| is_leader.get(a).copied().unwrap_or(false)).unwrap_or(0);
        let r = radius(agents.len());
        for (k, &agent) in agents.iter().enumerate() {
            let angle = inward + TAU * (k as f64 - lead as f64) / agents.len() as f64;
            if let Some(position) = positions.get_mut(agent) {
                *position = (STRETCH * (centre_x + r * angle.cos()), centre_y + r * angle.sin());
            }
        }
    }
    positions
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn distance(a: (f64, f64), b: (f64, f64)) -> f64 {
        (a.0 - b.0).hypot(a.1 - b.1)
    }

    proptest! {
        #[test]
        fn nobody_sits_on_anybody(groups in prop::collection::vec(0_usize..6, 1..40)) {
            let p = cluster_layout(&groups, &[]);
            for i in 0..p.len() {
                for j in 0..i {
                    prop_assert!(distance(p[i], p[j]) > 0.9, "{i} {j}: {}", distance(p[i], p[j]));
                }
            }
        }
    }

    #[test]
    fn leaders_of_two_clusters_face_each_other() {
        let groups = [0, 0, 0, 1, 1, 1, 1];
        let leaders = [false, true, false, false, false, true, false];
        let p = cluster_layout(&groups, &leaders);
        let between = distance(p[1], p[5]);
        for i in 0..3 {
            for j in 3..7 {
                assert!(distance(p[i], p[j]) >= between - 1e-12);
            }
        }
    }
}

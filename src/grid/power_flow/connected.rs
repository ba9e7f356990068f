//! Whether all buses in service hang together; a dead part would make the equations singular.

use super::super::case::{Case, ISOLATED, REFERENCE};
use super::super::error::GridError;

/// Refuses a case with a bus in service that has no path to the reference bus.
pub(super) fn check_connected(case: &Case) -> Result<(), GridError> {
    let positions = case.positions();
    let live = |k: usize| case.bus[k].kind != ISOLATED;
    let mut neighbours = vec![Vec::new(); case.bus.len()];
    for branch in case.branch.iter().filter(|b| b.status == 1) {
        if let (Some(&f), Some(&t)) = (positions.get(&branch.from), positions.get(&branch.to))
            && live(f)
            && live(t)
        {
            neighbours[f].push(t);
            neighbours[t].push(f);
        }
    }
    let mut reached = vec![false; case.bus.len()];
    let mut waiting: Vec<usize> = case.bus.iter().position(|b| b.kind == REFERENCE).into_iter().collect();
    while let Some(k) = waiting.pop() {
        if !std::mem::replace(&mut reached[k], true) {
            waiting.extend(&neighbours[k]);
        }
    }
    match (0..case.bus.len()).find(|&k| live(k) && !reached[k]) {
        None => Ok(()),
        Some(k) => Err(GridError::invalid(
            format!("bus[{k}]"),
            format!("bus {} without a path to the reference bus", case.bus[k].id),
            "one connected network; close a branch, or mark dead buses as isolated (type 4)",
        )),
    }
}

//! Settings of a plan resolved against its participants: whose, by value reference, and in which recorded columns they
//! show. Sets nothing itself.

use crate::harness::coupling::{CouplingError, Endpoint};
use crate::harness::lookup::Lookup;
use crate::harness::plan::Setting;
use crate::harness::wiring::{Values, Wiring};

/// An event with its names resolved.
pub(super) struct Due {
    pub at_ns: i64,
    pub sets: Vec<(usize, Values)>,
    pub records: Vec<(usize, f64)>,
}

pub(super) type Resolved = (Vec<(usize, Values)>, Vec<(usize, f64)>);

/// Settings as values by participant, and what they put into the recorded columns.
pub(super) fn resolve(
    lookup: &Lookup<'_>,
    wiring: &Wiring,
    place: &str,
    settings: &[Setting],
    is_running: bool,
) -> Result<Resolved, CouplingError> {
    let mut sets: Vec<(usize, Values)> = Vec::new();
    let mut records = Vec::new();
    for setting in settings {
        let endpoint = Endpoint::new(&*setting.participant, &*setting.variable);
        let (index, reference, value) = lookup.settable(place, &endpoint, setting.value, is_running)?;
        match sets.iter_mut().find(|(participant, _)| *participant == index) {
            Some((_, values)) => values.push(reference, value),
            None => {
                let mut values = Values::default();
                values.push(reference, value);
                sets.push((index, values));
            }
        }
        records.extend(wiring.set_column(&endpoint).map(|column| (column, value.as_f64())));
    }
    Ok((sets, records))
}

pub(super) fn record(values: &mut [f64], records: &[(usize, f64)]) {
    for (column, found) in records {
        if let Some(value) = values.get_mut(*column) {
            *value = *found;
        }
    }
}

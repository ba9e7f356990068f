//! An observer that keeps chosen columns in memory, for the report.

use super::error::HarnessError;
use super::observer::{Column, Experiment, Observer, ObserverError, Sample};

type Choice = Box<dyn Fn(&Column) -> bool>;

/// Keeps the chosen columns of every `every`-th sample.
pub struct Memory {
    choice: Choice,
    every: u64,
    chosen: Vec<usize>,
    columns: Vec<Column>,
    times_ns: Vec<i64>,
    values: Vec<Vec<f64>>,
}

impl Memory {
    /// Keeps the columns for which `choice` is true.
    pub fn new(every: u64, choice: impl Fn(&Column) -> bool + 'static) -> Self {
        Self {
            choice: Box::new(choice),
            every,
            chosen: Vec::new(),
            columns: Vec::new(),
            times_ns: Vec::new(),
            values: Vec::new(),
        }
    }

    /// The columns kept.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Times of the samples, ns.
    pub fn times_ns(&self) -> &[i64] {
        &self.times_ns
    }

    /// Adds a sample that an earlier run has taken; one value for each column kept.
    pub(super) fn push(&mut self, t_ns: i64, row: &[f64]) {
        self.times_ns.push(t_ns);
        for (values, value) in self.values.iter_mut().zip(row) {
            values.push(*value);
        }
    }

    /// The samples from number `from` on: times and values.
    pub(super) fn rows(&self, from: usize) -> impl Iterator<Item = (i64, impl Iterator<Item = f64>)> {
        let row = move |k: usize| self.values.iter().filter_map(move |values| values.get(k).copied());
        self.times_ns.iter().enumerate().skip(from).map(move |(k, t_ns)| (*t_ns, row(k)))
    }

    /// Values of the column `participant.variable`, one for each time.
    pub fn values(&self, participant: &str, variable: &str) -> Option<&[f64]> {
        let is_it = |column: &Column| column.participant == participant && column.variable == variable;
        let index = self.columns.iter().position(is_it)?;
        self.values.get(index).map(Vec::as_slice)
    }
}

impl Observer for Memory {
    fn begin(&mut self, experiment: &Experiment) -> Result<(), ObserverError> {
        let columns = experiment.columns.iter().enumerate();
        let (chosen, columns) = columns
            .filter(|(_, column)| (self.choice)(column))
            .map(|(index, column)| (index, column.clone()))
            .unzip();
        (self.chosen, self.columns) = (chosen, columns);
        let steps = (experiment.stop_ns - experiment.start_ns) / experiment.step_ns.max(1);
        // Room for all samples, within reason: no allocation in a step.
        let room = (steps as u64 / self.every.max(1)).saturating_add(64).min(1 << 20) as usize;
        self.times_ns = Vec::with_capacity(room);
        self.values = self.chosen.iter().map(|_| Vec::with_capacity(room)).collect();
        Ok(())
    }

    fn sample(&mut self, sample: Sample<'_>) -> Result<(), ObserverError> {
        if sample.is_kept(self.every) {
            self.times_ns.push(sample.t_ns);
            for (values, column) in self.values.iter_mut().zip(&self.chosen) {
                values.extend(sample.values.get(*column));
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: Option<&HarnessError>) -> Result<(), ObserverError> {
        Ok(())
    }
}

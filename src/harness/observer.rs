//! Who looks on while a simulation runs. An observer sees values, never participants, and cannot
//! change anything but end the run by an error.

use super::error::HarnessError;
use super::master::Position;
use super::value::Kind;
use std::time::{Duration, Instant};

/// One recorded quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Participant.
    pub participant: String,
    /// Variable.
    pub variable: String,
    /// Its type; values arrive as f64 all the same.
    pub kind: Kind,
    /// Its unit, if it says one.
    pub unit: Option<String>,
}

impl Column {
    /// `participant.variable`.
    pub fn label(&self) -> String {
        format!("{}.{}", self.participant, self.variable)
    }
}

/// What is about to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Start, ns.
    pub start_ns: i64,
    /// End, ns.
    pub stop_ns: i64,
    /// Regular step, ns.
    pub step_ns: i64,
    /// Participant by participant: its outputs (Real, Integer, Boolean), then what events set in it.
    pub columns: Vec<Column>,
}

/// What was read at one communication point, after the events there.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Time, ns.
    pub t_ns: i64,
    /// The number of the communication point, from 0; none for a point that an event, or the end of the
    /// run, puts between two of them.
    pub regular: Option<u64>,
    /// Whether the run ends here.
    pub last: bool,
    /// One value for each column; Booleans 0 or 1.
    pub values: &'a [f64],
}

impl Sample<'_> {
    /// Whether one that keeps every `every`-th point keeps this one: irregular points and the last are
    /// always kept, because something happens there.
    pub fn is_kept(&self, every: u64) -> bool {
        self.last || self.regular.is_none_or(|k| k.is_multiple_of(every.max(1)))
    }
}

/// Looks on. `begin` comes once, then samples in order of time, then `finish` once, also after an error.
pub trait Observer {
    /// Before initialisation.
    fn begin(&mut self, experiment: &Experiment) -> Result<(), ObserverError>;
    /// At a communication point; should allocate nothing.
    fn sample(&mut self, sample: Sample<'_>) -> Result<(), ObserverError>;
    /// Whether it wants to keep the position of the run at this communication point, which was just sampled.
    fn is_due(&mut self, _t_ns: i64, _last: bool) -> bool {
        false
    }
    /// The position that was due.
    fn keep(&mut self, _position: Position) -> Result<(), ObserverError> {
        Ok(())
    }
    /// After the last sample; `error` is what ended the run too early.
    fn finish(&mut self, error: Option<&HarnessError>) -> Result<(), ObserverError>;
}

/// Why an observer could not go on.
#[derive(Debug, thiserror::Error)]
#[error("{what}: {source}")]
pub struct ObserverError {
    /// What it was doing, with the path.
    pub what: String,
    /// Why it could not.
    #[source]
    pub source: Box<dyn std::error::Error + Send + Sync>,
}

/// Keeps nothing.
pub struct Silent;

impl Observer for Silent {
    fn begin(&mut self, _: &Experiment) -> Result<(), ObserverError> {
        Ok(())
    }
    fn sample(&mut self, _: Sample<'_>) -> Result<(), ObserverError> {
        Ok(())
    }
    fn finish(&mut self, _: Option<&HarnessError>) -> Result<(), ObserverError> {
        Ok(())
    }
}

/// Several observers as one. All of them get to finish; the first error counts.
pub struct FanOut<'a>(pub Vec<&'a mut dyn Observer>);

impl Observer for FanOut<'_> {
    fn begin(&mut self, experiment: &Experiment) -> Result<(), ObserverError> {
        self.0.iter_mut().try_for_each(|observer| observer.begin(experiment))
    }

    fn sample(&mut self, sample: Sample<'_>) -> Result<(), ObserverError> {
        self.0.iter_mut().try_for_each(|observer| observer.sample(sample))
    }

    fn is_due(&mut self, t_ns: i64, last: bool) -> bool {
        self.0.iter_mut().any(|observer| observer.is_due(t_ns, last))
    }

    fn keep(&mut self, position: Position) -> Result<(), ObserverError> {
        self.0.iter_mut().try_for_each(|observer| observer.keep(position.clone()))
    }

    fn finish(&mut self, error: Option<&HarnessError>) -> Result<(), ObserverError> {
        let mut first = Ok(());
        for observer in &mut self.0 {
            let finished = observer.finish(error);
            if first.is_ok() {
                first = finished;
            }
        }
        first
    }
}

/// Calls a function with the time reached, s, and the share done, 0 to 1: at the start, at most once in
/// `interval`, and at the last point.
pub struct Progress<F: FnMut(f64, f64)> {
    interval: Duration,
    report: F,
    start_ns: i64,
    stop_ns: i64,
    reported: Option<Instant>,
}

impl<F: FnMut(f64, f64)> Progress<F> {
    /// A new hook.
    pub fn new(interval: Duration, report: F) -> Self {
        Self { interval, report, start_ns: 0, stop_ns: 0, reported: None }
    }
}

impl<F: FnMut(f64, f64)> Observer for Progress<F> {
    fn begin(&mut self, experiment: &Experiment) -> Result<(), ObserverError> {
        (self.start_ns, self.stop_ns, self.reported) = (experiment.start_ns, experiment.stop_ns, None);
        Ok(())
    }

    fn sample(&mut self, sample: Sample<'_>) -> Result<(), ObserverError> {
        let now = Instant::now();
        let due = self.reported.is_none_or(|reported| now.duration_since(reported) >= self.interval);
        if due || sample.last {
            self.reported = Some(now);
            let span = (self.stop_ns - self.start_ns).max(1) as f64;
            (self.report)(super::slave::seconds(sample.t_ns), (sample.t_ns - self.start_ns) as f64 / span);
        }
        Ok(())
    }

    fn finish(&mut self, _: Option<&HarnessError>) -> Result<(), ObserverError> {
        Ok(())
    }
}

//! The trajectories of all federates as one, and from it the figures and the report of an ordinary run.

use super::super::{Failure, run};
use super::FederateArgs;
use super::runner::Ended;
use crate::federation::{Federation, OTHERS};
use crate::harness::recorder::{PART, WHOLE};
use crate::harness::{Column, Experiment};
use crate::scenario::Resolved;
use miette::{IntoDiagnostic, WrapErr};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::time::{Duration, Instant};

/// Who has left what where.
pub struct Remains<'a> {
    /// The folder of the run; each federate has one of its name in it.
    pub folder: &'a Path,
    /// The federates of this run.
    pub names: &'a [String],
    /// Wall time.
    pub took: Duration,
}

/// Removes the trajectories that an earlier run has left, so that none of them is taken for one of this run.
pub fn clear(folder: &Path, names: &[String]) -> Result<(), Failure> {
    for path in names.iter().flat_map(|name| [WHOLE, PART].map(|file| folder.join(name).join(file))) {
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(error).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// Writes trajectory, summary and report, and says how it went.
pub fn conclude(
    args: &FederateArgs,
    resolved: &Resolved,
    federation: &Federation,
    remains: &Remains<'_>,
    ended: &Ended,
) -> Result<(), Failure> {
    let tables: Vec<Table> =
        remains.names.iter().map(|name| Table::read(&remains.folder.join(name))).collect::<Result<_, _>>()?;
    let merged = Merged::of(federation, remains, &tables);
    let plan = federation.whole();
    let reached_ns = merged.times_ns.last().copied().unwrap_or(plan.start_ns);
    let is_whole = reached_ns >= plan.stop_ns;
    let early = ended.died.iter().map(|(name, how)| format!("{name} ended early ({how})"));
    let reasons: Vec<String> = match &ended.broken {
        Some(reason) => vec![reason.clone()],
        None => early.collect(),
    };
    // Who died may have come back, by whomever it was started.
    let dir = |name: &str| remains.folder.join(name);
    let is_back = |name: &str| dir(name).join(WHOLE).is_file() && !dir(name).join(PART).is_file();
    let lost = ended.died.iter().any(|(name, _)| !is_back(name));
    if !merged.times_ns.is_empty() {
        let experiment = Experiment {
            start_ns: plan.start_ns,
            stop_ns: plan.stop_ns,
            step_ns: plan.step_ns,
            columns: merged.columns.clone(),
        };
        let early = (!is_whole).then(|| reasons.first().cloned().unwrap_or_else(|| "it stopped".into()));
        let rows = (0..merged.times_ns.len()).map(|k| (merged.times_ns[k], merged.row(&tables, k)));
        let replayed = run::replay(resolved, plan.clone(), &experiment, rows, (remains.folder, remains.took));
        let replayed = replayed.map_err(|error| run::failed(&error))?;
        run::conclude(resolved, &replayed, remains.folder, early.as_deref(), (!args.no_report, args.quiet))?;
    }
    match (is_whole, lost) {
        (true, false) => Ok(()),
        (true, true) => {
            let report = miette::miette!(
                help = "from then on its columns are what it told last",
                "{}; the others went on to the end",
                reasons.join("; ")
            );
            Err(Failure { report, code: 3 })
        }
        _ => {
            let reached_s = reached_ns as f64 / 1e9;
            let help = format!("what there is lies in {}", remains.folder.display());
            let reason = reasons.join("; ");
            Err(Failure {
                report: miette::miette!(help = help, "the federation ended at t = {reached_s} s: {reason}"),
                code: if ended.died.is_empty() { 1 } else { 3 },
            })
        }
    }
}

/// One federate's trajectory.
struct Table {
    columns: Vec<String>,
    times_ns: Vec<i64>,
    values: Vec<f64>,
}

impl Table {
    /// The whole one, else what there is. Somebody may still be writing it: a federate that came back.
    fn read(folder: &Path) -> Result<Self, Failure> {
        let until = Instant::now() + Duration::from_secs(10);
        let (whole, part) = (folder.join(WHOLE), folder.join(PART));
        let is_being_written = |path: &Path| {
            File::open(path)
                .is_ok_and(|file| matches!(file.try_lock_shared(), Err(std::fs::TryLockError::WouldBlock)))
        };
        while is_being_written(&part) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(20));
        }
        let path = if part.is_file() { part } else { whole };
        let mut table = Self { columns: Vec::new(), times_ns: Vec::new(), values: Vec::new() };
        let Ok(file) = File::open(&path) else { return Ok(table) };
        let named = || path.display().to_string();
        let mut lines = BufReader::new(file).lines();
        if let Some(header) = lines.next() {
            table.columns = cells(&header.into_diagnostic().wrap_err_with(named)?);
            table.columns.remove(0);
        }
        let mut row = Vec::with_capacity(table.columns.len() + 1);
        for line in lines {
            row.clear();
            let line = line.into_diagnostic().wrap_err_with(named)?;
            row.extend(line.split(',').map_while(|cell| cell.parse::<f64>().ok()));
            // The last line of a run that was killed may be half a line.
            let [time_s, values @ ..] = row.as_slice() else { break };
            if values.len() != table.columns.len() {
                break;
            }
            table.times_ns.push((time_s * 1e9).round() as i64);
            table.values.extend_from_slice(values);
        }
        Ok(table)
    }

    fn value(&self, row: usize, column: usize) -> f64 {
        self.values.get(row * self.columns.len() + column).copied().unwrap_or(f64::NAN)
    }
}

/// All columns on all instants. Where one has no row it holds its last.
struct Merged {
    columns: Vec<Column>,
    /// Tables and columns in them; of several the largest value counts.
    sources: Vec<Vec<(usize, usize)>>,
    times_ns: Vec<i64>,
    /// Row of each table at each instant.
    rows: Vec<Vec<usize>>,
}

impl Merged {
    fn of(federation: &Federation, remains: &Remains<'_>, tables: &[Table]) -> Self {
        let mut places: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
        let others = format!("{OTHERS}.");
        for (k, table) in tables.iter().enumerate() {
            let own = remains.names.get(k).map_or_else(String::new, |name| format!("{name}."));
            for (column, label) in table.columns.iter().enumerate() {
                // Of whom others have run, what was heard is known; who has run here knows best.
                if label.starts_with(&own) {
                    places.insert(label, (k, column));
                } else if let Some(heard) = label.strip_prefix(&others) {
                    places.entry(heard).or_insert((k, column));
                }
            }
        }
        let mut merged =
            Self { columns: Vec::new(), sources: Vec::new(), times_ns: Vec::new(), rows: Vec::new() };
        for (column, sources) in federation.columns() {
            let found = sources.iter().filter_map(|source| places.get(&*source.to_string()).copied());
            let found: Vec<(usize, usize)> = found.collect();
            if !found.is_empty() {
                merged.columns.push(column.clone());
                merged.sources.push(found);
            }
        }
        let times: BTreeSet<i64> = tables.iter().flat_map(|table| table.times_ns.iter().copied()).collect();
        // Only instants that everyone has begun at.
        let first = tables.iter().filter_map(|table| table.times_ns.first()).max().copied();
        merged.times_ns = times.into_iter().filter(|t_ns| *t_ns >= first.unwrap_or(i64::MAX)).collect();
        let at =
            |table: &Table, t_ns: i64| table.times_ns.partition_point(|own| *own <= t_ns).saturating_sub(1);
        let rows = |table: &Table| merged.times_ns.iter().map(|t_ns| at(table, *t_ns)).collect();
        merged.rows = tables.iter().map(rows).collect();
        merged
    }

    fn row(&self, tables: &[Table], k: usize) -> Vec<f64> {
        let value = |(table, column): &(usize, usize)| {
            let row = self.rows.get(*table).and_then(|rows| rows.get(k));
            match (tables.get(*table), row) {
                (Some(table), Some(row)) => table.value(*row, *column),
                _ => f64::NAN,
            }
        };
        let largest = |places: &Vec<(usize, usize)>| {
            places.iter().map(value).reduce(|a, b| if b > a { b } else { a }).unwrap_or(f64::NAN)
        };
        self.sources.iter().map(largest).collect()
    }
}

/// The cells of a header, where names with commas stand in quotes.
fn cells(line: &str) -> Vec<String> {
    let (mut cells, mut cell) = (Vec::new(), String::new());
    let mut quoted = false;
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' if quoted && letters.peek() == Some(&'"') => {
                letters.next();
                cell.push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(std::mem::take(&mut cell)),
            letter => cell.push(letter),
        }
    }
    cells.push(cell);
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_as_they_are_written() {
        assert_eq!(
            cells("time,grid.P[1],\"grid.A[1,2]\",\"say \"\"x\"\"\""),
            ["time", "grid.P[1]", "grid.A[1,2]", "say \"x\""]
        );
    }
}

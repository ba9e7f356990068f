//! Writes `trajectory.csv`. A thread of its own formats and writes, fed with recycled buffers over a
//! bounded channel, so that the simulation only copies numbers. While it is written the file is called
//! `trajectory.csv.part`: whole lines, up to the last whole second of the simulation and of the clock, whatever ends the
//! program. It gets its name when it is whole; after an error it keeps the other one.

use super::csv::{self, Job, Mark};
use super::error::HarnessError;
use super::hash::Fnv64;
use super::observer::{Experiment, Observer, ObserverError, Sample};
use std::fs::{self, File, TryLockError};
use std::io::{self, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Name of a whole trajectory.
pub const WHOLE: &str = "trajectory.csv";
/// Name of one that is being written, or that an error cut short.
pub const PART: &str = "trajectory.csv.part";

/// Numbers in one buffer: large enough to make the hand-over rare, small enough for the cache.
const BLOCK: usize = 16 * 1024;
/// Buffers under way; when all are, the simulation waits for the disk.
const BLOCKS: usize = 8;
/// How long rows stay here at most; and a second of the simulation, ns.
const PATIENCE: Duration = Duration::from_secs(1);
const SECOND_NS: i64 = 1_000_000_000;

/// Records all columns of every `every`-th communication point; see [`Sample::is_kept`].
pub struct Recorder {
    folder: PathBuf,
    every: u64,
    from: Option<Mark>,
    is_marked: bool,
    running: Option<Running>,
    written: Option<PathBuf>,
}

struct Running {
    jobs: SyncSender<Job>,
    empty: Receiver<Vec<f64>>,
    block: Vec<f64>,
    second: i64,
    handed: Instant,
    writer: JoinHandle<io::Result<File>>,
}

impl Recorder {
    /// Writes into this folder, which is made if it is not there.
    pub fn new(folder: impl Into<PathBuf>, every: u64) -> Self {
        Self { folder: folder.into(), every, from: None, is_marked: false, running: None, written: None }
    }

    /// The same, able to say by [`Recorder::mark`] where the file ends.
    pub fn marked(self) -> Self {
        Self { is_marked: true, ..self }
    }

    /// Goes on behind this mark of the file that an earlier run has left in the folder.
    pub fn resuming(folder: impl Into<PathBuf>, every: u64, from: Mark) -> Self {
        Self { from: Some(from), ..Self::new(folder, every).marked() }
    }

    /// The file that was written, whole or partial, once finished.
    pub fn written(&self) -> Option<&Path> {
        self.written.as_deref()
    }

    /// Brings everything so far to the disk and says where the file ends.
    pub fn mark(&mut self) -> Result<Mark, ObserverError> {
        self.hand_over()?;
        let (answer, answered) = sync_channel(1);
        let asked = self.running.as_ref().is_some_and(|running| running.jobs.send(Job::Mark(answer)).is_ok());
        match answered.recv() {
            Ok(mark) if asked => Ok(mark),
            _ => Err(self.stopped()),
        }
    }

    fn failed(&self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> ObserverError {
        ObserverError { what: format!("recording into {}", self.folder.display()), source: source.into() }
    }

    /// What the writer says about a failed hand-over is the real reason.
    fn stopped(&mut self) -> ObserverError {
        match self.join() {
            Err(error) => error,
            Ok(_) => self.failed("the writing thread has stopped early"),
        }
    }

    fn hand_over(&mut self) -> Result<(), ObserverError> {
        let Some(running) = &mut self.running else { return Ok(()) };
        if running.block.is_empty() {
            return Ok(());
        }
        let handed = running.empty.recv().map_err(|_| ()).and_then(|next| {
            running.jobs.send(Job::Rows(std::mem::replace(&mut running.block, next))).map_err(|_| ())
        });
        running.handed = Instant::now();
        handed.map_err(|()| self.stopped())
    }

    /// Waits for the writer.
    fn join(&mut self) -> Result<Option<File>, ObserverError> {
        let Some(Running { jobs, block, writer, .. }) = self.running.take() else { return Ok(None) };
        if !block.is_empty() {
            // Fails only if the writer has given up, which its own result tells.
            let _ = jobs.send(Job::Rows(block));
        }
        drop(jobs);
        match writer.join() {
            Ok(Ok(file)) => Ok(Some(file)),
            Ok(Err(error)) => Err(self.failed(error)),
            Err(_) => Err(self.failed("the writing thread has panicked")),
        }
    }

    /// The file to write, this run's alone, cut to what it may hold.
    fn open(&self) -> Result<File, ObserverError> {
        let (part, whole) = (self.folder.join(PART), self.folder.join(WHOLE));
        if let Some(mark) = self.from {
            // A run that was ended between its last step and its report had a whole file already.
            let path = if part.exists() { &part } else { &whole };
            let named = |error: io::Error| self.failed(format!("{}: {error}", path.display()));
            let (hash, found) = Fnv64::of_file(path, mark.bytes).map_err(named)?;
            if (found, hash.value()) != (mark.bytes, mark.hash) {
                let reason = "does not begin with what the checkpoint says; start the run again";
                return Err(self.failed(format!("{} {reason}", path.display())));
            }
            if path == &whole {
                fs::rename(&whole, &part).map_err(named)?;
            }
        }
        let opened = File::options().read(true).write(true).create(true).truncate(false).open(&part);
        let mut file = opened.map_err(|error| self.failed(error))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                return Err(
                    self.failed(format!("{PART} is being written by another run; choose another folder"))
                );
            }
            // A file system without locks is no reason not to record.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let length = self.from.map_or(0, |mark| mark.bytes);
        let cut = file.set_len(length).and_then(|()| file.seek(SeekFrom::Start(length)));
        cut.map_err(|error| self.failed(error))?;
        Ok(file)
    }
}

impl Observer for Recorder {
    fn begin(&mut self, experiment: &Experiment) -> Result<(), ObserverError> {
        fs::create_dir_all(&self.folder).map_err(|error| self.failed(error))?;
        let file = self.open()?;
        let width = 1 + experiment.columns.len();
        let rows = (BLOCK / width).max(1);
        let (jobs, waiting) = sync_channel(BLOCKS);
        let (recycle, empty) = sync_channel(BLOCKS + 1);
        for _ in 0..BLOCKS {
            // Holds BLOCKS + 1, so it never blocks here, and the receiver lives.
            let _ = recycle.try_send(Vec::with_capacity(rows * width));
        }
        let (columns, from) = (experiment.columns.clone(), (self.from.take(), self.is_marked));
        let writer = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || csv::write(file, &columns, from, &waiting, &recycle))
            .map_err(|error| self.failed(error))?;
        let block = Vec::with_capacity(rows * width);
        self.written = None;
        self.running = Some(Running { jobs, empty, block, second: i64::MIN, handed: Instant::now(), writer });
        Ok(())
    }

    fn sample(&mut self, sample: Sample<'_>) -> Result<(), ObserverError> {
        if !sample.is_kept(self.every) {
            return Ok(());
        }
        let Some(running) = &mut self.running else { return Ok(()) };
        running.block.push(super::slave::seconds(sample.t_ns));
        running.block.extend_from_slice(sample.values);
        let second = sample.t_ns.div_euclid(SECOND_NS);
        let is_full = running.block.capacity() - running.block.len() <= sample.values.len();
        if is_full || second != running.second || running.handed.elapsed() >= PATIENCE {
            running.second = second;
            self.hand_over()?;
        }
        Ok(())
    }

    fn finish(&mut self, error: Option<&HarnessError>) -> Result<(), ObserverError> {
        let Some(file) = self.join()? else { return Ok(()) };
        let part = self.folder.join(PART);
        if error.is_some() {
            self.written = Some(part);
            return Ok(());
        }
        drop(file);
        let target = self.folder.join(WHOLE);
        fs::rename(&part, &target).map_err(|error| self.failed(error))?;
        self.written = Some(target);
        Ok(())
    }
}

//! Records a run so that it can be resumed: the trajectory, chosen columns in memory and, behind them on disk, the
//! same samples as raw numbers, and a checkpoint every so often. Runs without checkpoints do not use it.

use super::checkpoint::{CHECKPOINT, Checkpoint, Identity};
use super::csv::Mark;
use super::error::HarnessError;
use super::hash::Fnv64;
use super::master::Position;
use super::memory::Memory;
use super::observer::{Experiment, Observer, ObserverError, Sample};
use super::recorder::Recorder;
use super::whole::part_of;
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Name of the file with the samples, in the folder of the results.
pub const SAMPLES: &str = "checkpoint.samples";

/// A [`Recorder`] and a [`Memory`] with checkpoints.
pub struct Keeping {
    folder: PathBuf,
    every_ns: i64,
    identity: Identity,
    recorder: Recorder,
    memory: Memory,
    from: Option<Mark>,
    samples: Option<BufWriter<File>>,
    end: Mark,
    /// Samples in the memory that are in the file.
    kept: usize,
    next_ns: i64,
}

impl Keeping {
    /// A new run, kept every `every_ns` > 0 of simulated time, at its start and at its end.
    pub fn new(folder: &Path, every_ns: i64, identity: Identity, record_every: u64, memory: Memory) -> Self {
        Self {
            folder: folder.to_path_buf(),
            every_ns,
            identity,
            recorder: Recorder::new(folder, record_every).marked(),
            memory,
            from: None,
            samples: None,
            end: Mark { bytes: 0, hash: Fnv64::default().value() },
            kept: 0,
            next_ns: i64::MIN,
        }
    }

    /// Goes on from a checkpoint of the same run; begin with its position.
    pub fn resuming(folder: &Path, checkpoint: &Checkpoint, record_every: u64, memory: Memory) -> Self {
        let t_ns = checkpoint.position.t_ns();
        let identity = checkpoint.identity.clone();
        Self {
            recorder: Recorder::resuming(folder, record_every, checkpoint.trajectory),
            from: Some(checkpoint.samples),
            next_ns: t_ns.saturating_add(checkpoint.every_ns),
            ..Self::new(folder, checkpoint.every_ns, identity, record_every, memory)
        }
    }

    /// The columns kept in memory.
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Removes the checkpoint; done when all results that need it are written.
    pub fn clear(folder: &Path) -> io::Result<()> {
        let checkpoint = folder.join(CHECKPOINT);
        // The half of one is there where a run was killed while it wrote it.
        for path in [part_of(&checkpoint), checkpoint, folder.join(SAMPLES)] {
            match fs::remove_file(path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        Ok(())
    }

    fn failed(&self, what: &str, source: io::Error) -> ObserverError {
        ObserverError { what: format!("{}: {what}", self.folder.display()), source: source.into() }
    }

    /// Takes in the samples that are in the file already; changes nothing on disk.
    fn take_in(&mut self, mark: Mark) -> io::Result<()> {
        let path = self.folder.join(SAMPLES);
        let (hash, found) = Fnv64::of_file(&path, mark.bytes)?;
        if (found, hash.value()) != (mark.bytes, mark.hash) {
            let reason = "does not begin with what the checkpoint says; start the run again";
            return Err(io::Error::new(io::ErrorKind::InvalidData, reason));
        }
        let mut bytes = BufReader::new(File::open(&path)?.take(mark.bytes));
        let (mut number, mut row) = ([0; 8], vec![0.0; self.memory.columns().len()]);
        let rows = mark.bytes / (8 * (1 + row.len() as u64));
        for _ in 0..rows {
            bytes.read_exact(&mut number)?;
            let t_ns = i64::from_le_bytes(number);
            for value in &mut row {
                bytes.read_exact(&mut number)?;
                *value = f64::from_le_bytes(number);
            }
            self.memory.push(t_ns, &row);
        }
        (self.end, self.kept) = (mark, rows as usize);
        Ok(())
    }

    /// Opens the file of samples where the next ones belong.
    fn open(&mut self) -> io::Result<File> {
        let path = self.folder.join(SAMPLES);
        if self.from.take().is_none() {
            // An older checkpoint must not be taken for one of this run.
            Self::clear(&self.folder)?;
            return File::create_new(path);
        }
        let mut file = File::options().write(true).open(&path)?;
        file.set_len(self.end.bytes)?;
        file.seek(SeekFrom::Start(self.end.bytes))?;
        Ok(file)
    }

    /// Brings the samples since the last time to the disk.
    fn append(&mut self) -> io::Result<()> {
        let Some(file) = &mut self.samples else { return Ok(()) };
        let mut hash = Fnv64::from_value(self.end.hash);
        let mut put = |bytes: [u8; 8]| {
            hash.add(&bytes);
            self.end.bytes += 8;
            file.write_all(&bytes)
        };
        for (t_ns, row) in self.memory.rows(self.kept) {
            put(t_ns.to_le_bytes())?;
            for value in row {
                put(value.to_le_bytes())?;
            }
            self.kept += 1;
        }
        self.end.hash = hash.value();
        file.flush()?;
        file.get_ref().sync_data()
    }
}

impl Observer for Keeping {
    fn begin(&mut self, experiment: &Experiment) -> Result<(), ObserverError> {
        self.memory.begin(experiment)?;
        if let Some(mark) = self.from {
            self.take_in(mark).map_err(|error| self.failed(SAMPLES, error))?;
        }
        // It sees to it that no other run writes here, so nothing is removed before.
        self.recorder.begin(experiment)?;
        let file = self.open().map_err(|error| self.failed(SAMPLES, error))?;
        self.samples = Some(BufWriter::new(file));
        Ok(())
    }

    fn sample(&mut self, sample: Sample<'_>) -> Result<(), ObserverError> {
        self.memory.sample(sample)?;
        self.recorder.sample(sample)
    }

    fn is_due(&mut self, t_ns: i64, last: bool) -> bool {
        last || t_ns >= self.next_ns
    }

    fn keep(&mut self, position: Position) -> Result<(), ObserverError> {
        let trajectory = self.recorder.mark()?;
        self.append().map_err(|error| self.failed(SAMPLES, error))?;
        self.next_ns = position.t_ns().saturating_add(self.every_ns);
        let (identity, samples) = (self.identity.clone(), self.end);
        let checkpoint = Checkpoint { identity, every_ns: self.every_ns, position, trajectory, samples };
        checkpoint.write(&self.folder).map_err(|error| self.failed(CHECKPOINT, error))
    }

    fn finish(&mut self, error: Option<&HarnessError>) -> Result<(), ObserverError> {
        self.recorder.finish(error)
    }
}

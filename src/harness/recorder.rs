//! Writes `trajectory.csv`. A thread of its own formats and writes, fed with recycled buffers over a
//! bounded channel, so that the simulation only copies numbers. The file appears under its name only
//! when it is whole; after an error what there is goes to `trajectory.partial.csv`.

use super::csv;
use super::error::HarnessError;
use super::observer::{Experiment, Observer, ObserverError, Sample};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use tempfile::NamedTempFile;

/// Name of a whole trajectory.
pub const WHOLE: &str = "trajectory.csv";
/// Name of one that an error cut short.
pub const PARTIAL: &str = "trajectory.partial.csv";

/// Numbers in one buffer: large enough to make the hand-over rare, small enough for the cache.
const BLOCK: usize = 16 * 1024;
/// Buffers under way; when all are, the simulation waits for the disk.
const BLOCKS: usize = 8;

/// Records all columns of every `every`-th communication point; see [`Sample::is_kept`].
pub struct Recorder {
    folder: PathBuf,
    every: u64,
    running: Option<Running>,
    written: Option<PathBuf>,
}

struct Running {
    full: SyncSender<Vec<f64>>,
    empty: Receiver<Vec<f64>>,
    block: Vec<f64>,
    writer: JoinHandle<io::Result<NamedTempFile>>,
}

impl Recorder {
    /// Writes into this folder, which is made if it is not there.
    pub fn new(folder: impl Into<PathBuf>, every: u64) -> Self {
        Self { folder: folder.into(), every, running: None, written: None }
    }

    /// The file that was written, whole or partial, once finished.
    pub fn written(&self) -> Option<&Path> {
        self.written.as_deref()
    }

    fn failed(&self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> ObserverError {
        ObserverError { what: format!("recording into {}", self.folder.display()), source: source.into() }
    }

    /// Waits for the writer; what it says about a failed hand-over is the real reason.
    fn join(&mut self) -> Result<Option<NamedTempFile>, ObserverError> {
        let Some(Running { full, block, writer, .. }) = self.running.take() else { return Ok(None) };
        if !block.is_empty() {
            // Fails only if the writer has given up, which its own result tells.
            let _ = full.send(block);
        }
        drop(full);
        match writer.join() {
            Ok(Ok(file)) => Ok(Some(file)),
            Ok(Err(error)) => Err(self.failed(error)),
            Err(_) => Err(self.failed("the writing thread has panicked")),
        }
    }
}

impl Observer for Recorder {
    fn begin(&mut self, experiment: &Experiment) -> Result<(), ObserverError> {
        fs::create_dir_all(&self.folder).map_err(|error| self.failed(error))?;
        let file = temporary(&self.folder).map_err(|error| self.failed(error))?;
        let width = 1 + experiment.columns.len();
        let rows = (BLOCK / width).max(1);
        let (full, filled) = sync_channel::<Vec<f64>>(BLOCKS);
        let (recycle, empty) = sync_channel(BLOCKS + 1);
        for _ in 0..BLOCKS {
            // Holds BLOCKS + 1, so it never blocks here, and the receiver lives.
            let _ = recycle.try_send(Vec::with_capacity(rows * width));
        }
        let columns = experiment.columns.clone();
        let writer = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || csv::write(file, &columns, &filled, &recycle))
            .map_err(|error| self.failed(error))?;
        let block = Vec::with_capacity(rows * width);
        self.written = None;
        self.running = Some(Running { full, empty, block, writer });
        Ok(())
    }

    fn sample(&mut self, sample: Sample<'_>) -> Result<(), ObserverError> {
        if !sample.is_kept(self.every) {
            return Ok(());
        }
        let Some(running) = &mut self.running else { return Ok(()) };
        if running.block.capacity() - running.block.len() <= sample.values.len() {
            let handed = running.empty.recv().map_err(|_| ()).and_then(|next| {
                running.full.send(std::mem::replace(&mut running.block, next)).map_err(|_| ())
            });
            if handed.is_err() {
                self.join()?;
                return Err(self.failed("the writing thread has stopped early"));
            }
        }
        running.block.push(super::slave::seconds(sample.t_ns));
        running.block.extend_from_slice(sample.values);
        Ok(())
    }

    fn finish(&mut self, error: Option<&HarnessError>) -> Result<(), ObserverError> {
        let Some(file) = self.join()? else { return Ok(()) };
        let (name, other) = if error.is_none() { (WHOLE, Some(PARTIAL)) } else { (PARTIAL, None) };
        let target = self.folder.join(name);
        file.persist(&target).map_err(|error| self.failed(error.error))?;
        // A remnant of an earlier, failed run would look like a part of this one.
        if let Some(other) = other {
            let _ = fs::remove_file(self.folder.join(other));
        }
        self.written = Some(target);
        Ok(())
    }
}

/// In the target folder, so that renaming does not copy; readable like any other file of the user.
fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".trajectory-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

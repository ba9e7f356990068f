//! The seeded run: sequences of calls out of a counter, on any number of threads, with a watchdog. The same seed and
//! number give the same sequence on every machine.

use crate::stranger::Stranger;
use crate::subject::Subject;
use crate::tally::Tally;
use crate::world::World;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A sequence that takes longer hangs. Some ask the grid for years in one step, which it refuses after two million internal
/// steps: a minute of a processor under AddressSanitizer, of which a busy machine gives little.
const PATIENCE: Duration = Duration::from_secs(900);

/// What to run.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Chooses the sequences.
    pub seed: u64,
    /// How many calls at least.
    pub calls: u64,
    /// Number of the first sequence.
    pub first: u64,
    /// Threads, each with instances of its own.
    pub threads: usize,
}

/// What a run found.
#[derive(Debug)]
pub struct Finding {
    /// The sequence.
    pub sequence: u64,
    /// What was wrong.
    pub text: String,
}

/// The finaliser of splitmix64 (Steele, Lea, Flood 2014).
fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The bytes of a sequence: 1 to 16 KiB, for tens to a thousand calls.
pub fn bytes(seed: u64, sequence: u64) -> Vec<u8> {
    let start = mix(seed ^ mix(sequence.wrapping_add(0x9e37_79b9_7f4a_7c15)));
    let draw = |k: u64| mix(start.wrapping_add(k.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
    let length = 128 << (draw(0) % 5);
    (1..=length).flat_map(|k| draw(k).to_le_bytes()).collect()
}

/// Runs sequences until so many calls are made or something is found. `others` are FMUs whose states are offered.
pub fn run(subject: &Subject, other: Option<&Subject>, run: Run) -> Result<Tally, Finding> {
    let (next, calls) = (AtomicU64::new(run.first), AtomicU64::new(0));
    let stop = AtomicBool::new(false);
    let total: Mutex<Result<Tally, Finding>> = Mutex::new(Ok(Tally::default()));
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..run.threads.max(1))
            .map(|_| {
                let (next, calls, stop, total) = (&next, &calls, &stop, &total);
                let at = std::sync::Arc::new(Mutex::new((0, Instant::now())));
                let seen = at.clone();
                let work = move || {
                    let stranger = other.map(Stranger::of);
                    let foreign = stranger.as_ref().map_or(std::ptr::null_mut(), Stranger::state);
                    while calls.load(Ordering::Relaxed) < run.calls && !stop.load(Ordering::Relaxed) {
                        let sequence = next.fetch_add(1, Ordering::Relaxed);
                        if let Ok(mut at) = at.lock() {
                            *at = (sequence, Instant::now());
                        }
                        let bytes = bytes(run.seed, sequence);
                        let played =
                            catch_unwind(AssertUnwindSafe(|| World::play(subject, foreign, &bytes, false)));
                        let mut total = total.lock().expect("no worker panics while it holds this");
                        match (played, &mut *total) {
                            (Ok(tally), Ok(total)) => {
                                calls.fetch_add(tally.calls(), Ordering::Relaxed);
                                total.add(&tally);
                            }
                            (Err(payload), Ok(_)) => {
                                stop.store(true, Ordering::Relaxed);
                                *total = Err(Finding { sequence, text: text(payload) });
                            }
                            _ => {}
                        }
                    }
                };
                (scope.spawn(work), seen)
            })
            .collect();
        // What hangs cannot be stopped from within, so the program ends.
        while workers.iter().any(|(worker, _)| !worker.is_finished()) {
            std::thread::sleep(Duration::from_millis(50));
            for (_, seen) in workers.iter().filter(|(worker, _)| !worker.is_finished()) {
                let at = seen.lock().map(|at| *at);
                if let Ok((sequence, since)) = at
                    && since.elapsed() > PATIENCE
                {
                    eprintln!("{}: sequence {sequence} of seed {} hangs", subject.name, run.seed);
                    std::process::abort();
                }
            }
        }
    });
    total.into_inner().expect("no worker panics while it holds this")
}

/// What a panic said.
fn text(payload: Box<dyn std::any::Any + Send>) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default()
}

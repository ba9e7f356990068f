//! How long a federate has been waiting for the others, whom it misses, and whether somebody is there to answer for
//! one of them. HELICS tells nobody that a process is gone, but who is there answers a query while it waits, or computes.
//! Decides nothing: who asks, and what comes of it, is somebody else's business.

use super::error::FederationError;
use super::library::{Helics, HelicsError, LAST_WORDS, Object};
use super::session::{Caller, c_string};
use std::collections::BTreeSet;
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What HELICS's core of a federate answers itself, and nobody in its place.
const QUESTION: &str = "current_time";

/// A federate's waiting, seen from other threads of its process; clones are of the same.
#[derive(Clone, Default)]
pub struct Waiting(Arc<Inner>);

#[derive(Default)]
struct Inner {
    since: Mutex<Option<Instant>>,
    core: Mutex<Option<Core>>,
    silent: Mutex<BTreeSet<String>>,
    has_started: AtomicBool,
}

/// A core of HELICS, never let go of before the process ends: a question may be under way.
#[derive(Clone, Copy)]
struct Core(Object);

// SAFETY: HELICS's cores take queries from any thread; nothing else is done with it.
unsafe impl Send for Core {}

impl Waiting {
    /// Time since the call of HELICS began that this federate is in; zero while it is in none.
    pub fn time(&self) -> Duration {
        locked(&self.0.since).map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Whether time has started: before, nobody can be done without.
    pub fn has_started(&self) -> bool {
        self.0.has_started.load(Ordering::Relaxed)
    }

    /// Names of those that were silent at the last communication point.
    pub fn silent(&self) -> Vec<String> {
        locked(&self.0.silent).iter().cloned().collect()
    }

    /// Whether anybody answers for the federate of this name within this time: its own core, or the broker where it
    /// knows that the federate has left, or was not there yet.
    pub fn answers(
        &self,
        helics: &Arc<Helics>,
        federate: &str,
        limit: Duration,
    ) -> Result<bool, FederationError> {
        let Some(core) = *locked(&self.0.core) else { return Ok(true) };
        let (helics, question) = (Arc::clone(helics), [c_string(federate)?, c_string(QUESTION)?]);
        let (said, listening) = channel();
        // HELICS waits for the answer as long as others keep it busy, so the thread may stay until the process ends.
        helics.open_questions.fetch_add(1, Ordering::SeqCst);
        let asking = std::thread::Builder::new().name("ask".into()).spawn(move || {
            let core = core;
            let functions = &helics.functions;
            let mut error = HelicsError { code: 0, message: ptr::null() };
            // SAFETY: strings and error live through the calls; the query is freed once, and the core is never freed.
            unsafe {
                let query = (functions.create_query)(question[0].as_ptr(), question[1].as_ptr());
                (functions.query_core)(query, core.0, &mut error);
                (functions.free_query)(query);
            }
            helics.open_questions.fetch_sub(1, Ordering::SeqCst);
            // Nobody may be listening any more.
            let _ = said.send(());
        });
        let what = || "the thread that asks the others cannot be started".to_owned();
        asking.map_err(|source| FederationError::Process { what: what(), source })?;
        Ok(listening.recv_timeout(limit).is_ok())
    }

    /// Lets others ask by the core of this federate.
    pub(super) fn connected(
        &self,
        helics: &Helics,
        name: &str,
        federate: Object,
    ) -> Result<(), FederationError> {
        let core = Caller { name }.checked("helicsFederateGetCore", |error| {
            // SAFETY: the federate is valid, the error lives through the call.
            unsafe { (helics.functions.get_core)(federate, error) }
        })?;
        *locked(&self.0.core) = Some(Core(core));
        Ok(())
    }

    /// Where questions are open, gives the core the time to say good-bye: nobody can close the library.
    pub(super) fn leave(&self, helics: &Helics, name: &str) {
        let Some(core) = *locked(&self.0.core) else { return };
        if helics.open_questions.load(Ordering::SeqCst) > 0 {
            let ms = i32::try_from(LAST_WORDS.as_millis()).unwrap_or(i32::MAX);
            let _ = Caller { name }.checked("helicsCoreWaitForDisconnect", |error| {
                // SAFETY: the core is never freed, the error lives through the call.
                unsafe { (helics.functions.core_wait)(core.0, ms, error) }
            });
        }
    }

    /// Makes a call that waits for others.
    pub(super) fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        *locked(&self.0.since) = Some(Instant::now());
        let result = call();
        *locked(&self.0.since) = None;
        result
    }

    pub(super) fn start(&self) {
        self.0.has_started.store(true, Ordering::Relaxed);
    }

    /// Notes that the federate of this name has fallen silent, or is back.
    pub(super) fn note(&self, federate: &str, is_silent: bool) {
        let mut silent = locked(&self.0.silent);
        if is_silent {
            silent.insert(federate.to_owned());
        } else {
            silent.remove(federate);
        }
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

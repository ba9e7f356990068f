//! Looks after the federates that one of them waits for. Where an exchange takes longer than anybody has patience for,
//! the others are asked whether they are there. Without the grid all ends; anybody else who does not answer is taken
//! out, so that the others go on: by the grid, or, where that is a stranger who cannot, by one of the others. Two at once
//! would be in each other's way.

use super::super::Failure;
use super::FederateArgs;
use super::children::{FUNERAL, bury};
use super::watch::Watch;
use crate::federation::{Helics, Waiting};
use crate::harness::scenario::GRID;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

/// How often it looks.
const LOOK: Duration = Duration::from_millis(200);
/// How long a federate may take to answer. Its own thread does so, whatever the federate computes.
const ANSWER: Duration = Duration::from_secs(5);
/// How long the others may take to notice that one was taken out.
const NOTICE: Duration = Duration::from_secs(1);

/// Who looks after whom.
pub struct Vigil {
    /// The command line of the federate that waits.
    pub args: FederateArgs,
    /// The library.
    pub helics: Arc<Helics>,
    /// Name of the federate that waits.
    pub own: String,
    /// Names of all federates.
    pub names: Vec<String>,
}

impl Vigil {
    /// Begins, in a thread that ends with the process.
    pub fn start(self, waiting: &Waiting, watch: &Watch) -> std::io::Result<()> {
        let (waiting, watch) = (waiting.clone(), watch.clone());
        let looking = std::thread::Builder::new().name("vigil".into());
        looking.spawn(move || self.look(&waiting, &watch)).map(|_| ())
    }

    fn look(&self, waiting: &Waiting, watch: &Watch) {
        let patience = Duration::from_nanos(self.args.patience.unsigned_abs());
        loop {
            std::thread::sleep(LOOK);
            if waiting.time() < patience {
                continue;
            }
            let silent = self.silent(waiting);
            let waited = waiting.time();
            if waited < patience {
                continue;
            }
            let names = silent.join(", ");
            let since = format!("{names}: no answer, {:.0} s after an exchange began", waited.as_secs_f64());
            if silent.is_empty() {
                // Somebody computes for long, or has not come yet.
                std::thread::sleep(patience);
            } else if silent.contains(&GRID) {
                watch.call_off(&self.helics, &format!("{since}; without {GRID} there is nothing to measure"));
            } else if !waiting.has_started() {
                watch
                    .call_off(&self.helics, &format!("{since}; before the start nobody can be done without"));
            } else if waited < patience + FUNERAL * self.turn(&silent) {
                std::thread::sleep(patience);
            } else if let Err(reason) = silent.iter().try_for_each(|name| self.take_out(name, &since)) {
                watch.call_off(&self.helics, &reason);
            } else {
                std::thread::sleep(NOTICE);
            }
        }
    }

    /// Those of the others for whom nobody answers.
    fn silent(&self, waiting: &Waiting) -> Vec<&str> {
        let others = self.names.iter().filter(|name| **name != self.own);
        let is_silent = |name: &&String| matches!(waiting.answers(&self.helics, name, ANSWER), Ok(false));
        others.filter(is_silent).map(String::as_str).collect()
    }

    /// How many are before this one in taking somebody out: the grid is the first, which is always there.
    fn turn(&self, silent: &[&str]) -> u32 {
        let before = |name: &&String| !silent.contains(&name.as_str()) && **name != self.own;
        match self.own == GRID {
            true => 0,
            false => {
                let parts =
                    self.names.iter().filter(|name| *name != GRID).take_while(|name| **name != self.own);
                1 + parts.filter(before).count() as u32
            }
        }
    }

    fn take_out(&self, name: &str, since: &str) -> Result<(), String> {
        let args = &self.args;
        let broker_name = args.broker_name(args.address().port);
        // What it says is nobody's business.
        let (said, _listener) = channel();
        match bury(args, &self.helics, (name, usize::MAX), (&broker_name, Path::new(".")), &said) {
            Ok(true) => {
                eprintln!(
                    "{since}; {name} was taken out, the others go on. To bring it back: the same command as before, with --resume"
                );
                Ok(())
            }
            Ok(false) => Err(format!("{since}; {name} could not be taken out of the federation")),
            Err(Failure { report, .. }) => Err(format!("{since}; {report}")),
        }
    }
}

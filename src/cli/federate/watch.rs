//! The line from a federate or broker to the process that started it: when it is cut, or says so, whatever waits in
//! HELICS ends with an error, and if it does not, the process does. So nobody is left behind.

use crate::federation::Helics;
use std::io::BufRead;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How long an orderly end may take after that.
const PATIENCE: Duration = Duration::from_secs(15);

/// Why the run was called off, once it was.
#[derive(Clone, Default)]
pub struct Watch(Arc<Mutex<Option<String>>>);

impl Watch {
    /// Listens on standard input from now on.
    pub fn start(helics: &Arc<Helics>) -> std::io::Result<Self> {
        let watch = Self::default();
        let (own, helics) = (watch.clone(), Arc::clone(helics));
        std::thread::Builder::new().name("watch".into()).spawn(move || {
            let mut line = String::new();
            let heard = std::io::stdin().lock().read_line(&mut line).unwrap_or(0);
            let reason = match heard {
                0 => "the process that started this one is gone".to_owned(),
                _ => line.trim().to_owned(),
            };
            own.call_off(&helics, &reason);
        })?;
        Ok(watch)
    }

    /// Ends what waits in HELICS, and after a while this process.
    pub fn call_off(&self, helics: &Helics, reason: &str) -> ! {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(reason.to_owned());
        helics.abort(reason);
        std::thread::sleep(PATIENCE);
        eprintln!("{reason}; HELICS did not let go within {} s", PATIENCE.as_secs());
        std::process::exit(1);
    }

    /// Why, if it was.
    pub fn reason(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

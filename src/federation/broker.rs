//! The broker of a federation: started, waited for. What it does between is HELICS's own business.

use super::error::FederationError;
use super::library::{Helics, Object, text};
use super::session::{Caller, c_string};
use std::sync::Arc;
use std::time::Duration;

/// A running broker.
pub struct Broker {
    helics: Arc<Helics>,
    object: Object,
}

impl Broker {
    /// Starts one for so many federates; `options` are those of `helics_broker`.
    pub fn start(
        helics: &Arc<Helics>,
        core: &str,
        name: &str,
        options: &str,
    ) -> Result<Self, FederationError> {
        let [kind, c_name, options] = [c_string(core)?, c_string(name)?, c_string(options)?];
        let object = Caller { name: "broker" }.checked("helicsCreateBroker", |error| {
            // SAFETY: the strings and the error live through the call.
            unsafe {
                (helics.functions.create_broker)(kind.as_ptr(), c_name.as_ptr(), options.as_ptr(), error)
            }
        })?;
        Ok(Self { helics: Arc::clone(helics), object })
    }

    /// Whether it is there for federates.
    pub fn is_connected(&self) -> bool {
        // SAFETY: the broker is valid as long as this object.
        unsafe { (self.helics.functions.broker_is_connected)(self.object) != 0 }
    }

    /// Where it listens, as HELICS writes it.
    pub fn address(&self) -> String {
        // SAFETY: as above; the text is copied at once.
        text(unsafe { (self.helics.functions.broker_address)(self.object) })
    }

    /// Waits for the end of the federation, this long at most; whether it has ended.
    pub fn wait(&self, limit: Duration) -> Result<bool, FederationError> {
        let ms = i32::try_from(limit.as_millis()).unwrap_or(i32::MAX);
        let ended = Caller { name: "broker" }.checked("helicsBrokerWaitForDisconnect", |error| {
            // SAFETY: as above.
            unsafe { (self.helics.functions.broker_wait)(self.object, ms, error) }
        })?;
        Ok(ended != 0)
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        let _ = Caller { name: "broker" }.checked("helicsBrokerDisconnect", |error| {
            // SAFETY: the broker is valid, and let go by the next call.
            unsafe { (self.helics.functions.broker_disconnect)(self.object, error) }
        });
        // SAFETY: nobody uses it any more.
        unsafe { (self.helics.functions.broker_free)(self.object) }
    }
}

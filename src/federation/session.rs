//! One federate's life in HELICS, safely: connect, register, initialise, advance, leave. Knows values and times, never
//! what they mean.

use super::address::Address;
use super::error::FederationError;
use super::library::{Helics, HelicsError, Object, text};
use super::topics::Share;
use super::waiting::Waiting;
use std::ffi::{CString, c_char, c_int};
use std::ptr;
use std::sync::Arc;

/// HELICS's numbers, from helics_api.h.
const UNINTERRUPTIBLE: c_int = 1;
const REENTRANT: c_int = 38;
const RECONNECTABLE: c_int = 412;
const TYPE_DOUBLE: c_int = 1;
const TYPE_VECTOR: c_int = 4;
const ITERATE_IF_NEEDED: c_int = 2;
const NEXT_STEP: c_int = 0;
const ITERATING: c_int = 3;

struct Input {
    object: Object,
    is_double: bool,
    /// Where its values go.
    first: usize,
    count: usize,
    /// Index of its sender.
    sender: usize,
}

struct Publication {
    object: Object,
    is_double: bool,
    /// Which of the told values it holds, in order.
    values: Vec<f64>,
    indices: Vec<usize>,
}

/// A federate, from its connection to its end.
pub struct Session {
    helics: Arc<Helics>,
    name: String,
    federate: Object,
    inputs: Vec<Input>,
    publications: Vec<Publication>,
    senders: Vec<String>,
    waiting: Waiting,
}

impl Session {
    /// Connects to the broker, waiting for it within reason, and registers what the share says. Others may be under way,
    /// and a federate of this name may have been there before.
    pub fn connect(
        helics: &Arc<Helics>,
        name: &str,
        address: &Address,
        share: &Share,
    ) -> Result<Self, FederationError> {
        let mut session = Self::enter(helics, name, address)?;
        session.register(share)?;
        Ok(session)
    }

    /// Connects without telling or hearing anything.
    pub(super) fn enter(
        helics: &Arc<Helics>,
        name: &str,
        address: &Address,
    ) -> Result<Self, FederationError> {
        let functions = &helics.functions;
        let call = Caller { name };
        let [c_name, c_type, c_options] =
            [c_string(name)?, c_string(&address.core)?, c_string(&address.core_options())?];
        // SAFETY: takes nothing; the object is freed below.
        let info = unsafe { (functions.create_info)() };
        let prepared = call
            .checked("helicsFederateInfoSetCoreTypeFromString", |error| {
                // SAFETY: info is valid, the string and the error live through the call.
                unsafe { (functions.set_core_type)(info, c_type.as_ptr(), error) }
            })
            .and_then(|()| {
                call.checked("helicsFederateInfoSetCoreInitString", |error| {
                    // SAFETY: as above.
                    unsafe { (functions.set_core_init)(info, c_options.as_ptr(), error) }
                })
            })
            .and_then(|()| {
                [UNINTERRUPTIBLE, REENTRANT].into_iter().try_for_each(|flag| {
                    call.checked("helicsFederateInfoSetFlagOption", |error| {
                        // SAFETY: as above.
                        unsafe { (functions.set_flag)(info, flag, 1, error) }
                    })
                })
            });
        let created = prepared.and_then(|()| {
            call.checked("helicsCreateValueFederate", |error| {
                // SAFETY: as above.
                unsafe { (functions.create_federate)(c_name.as_ptr(), info, error) }
            })
        });
        // SAFETY: made above and not used again.
        unsafe { (functions.free_info)(info) };
        Ok(Self {
            helics: Arc::clone(helics),
            name: name.to_owned(),
            federate: created?,
            inputs: Vec::new(),
            publications: Vec::new(),
            senders: Vec::new(),
            waiting: Waiting::default(),
        })
    }

    /// Registers publications and inputs, all reconnectable, so that a federate that comes back finds its places.
    pub(super) fn register(&mut self, share: &Share) -> Result<(), FederationError> {
        let helics = Arc::clone(&self.helics);
        let (functions, federate) = (&helics.functions, self.federate);
        let name = self.name.clone();
        let call = Caller { name: &name };
        for topic in &share.told {
            let [key, unit] = [c_string(&topic.publication)?, c_string(&topic.unit)?];
            let kind = if topic.is_double { TYPE_DOUBLE } else { TYPE_VECTOR };
            let position = |variable: &String| share.told_variables.iter().position(|own| own == variable);
            let indices: Vec<usize> = topic.variables.iter().filter_map(position).collect();
            // Two receivers of one double hear one publication.
            if share
                .told
                .iter()
                .take_while(|other| *other != topic)
                .any(|o| o.publication == topic.publication)
            {
                continue;
            }
            let object = call.checked("helicsFederateRegisterGlobalPublication", |error| {
                // SAFETY: the federate is valid, strings and error live through the call.
                unsafe {
                    (functions.register_publication)(federate, key.as_ptr(), kind, unit.as_ptr(), error)
                }
            })?;
            call.checked("helicsPublicationSetOption", |error| {
                // SAFETY: the publication is the one just registered.
                unsafe { (functions.publication_option)(object, RECONNECTABLE, 1, error) }
            })?;
            let values = vec![0.0; indices.len()];
            self.publications.push(Publication { object, is_double: topic.is_double, values, indices });
        }
        let mut first = 0;
        for topic in &share.heard {
            let [key, unit, target] =
                [c_string(&topic.input)?, c_string(&topic.unit)?, c_string(&topic.publication)?];
            let kind = if topic.is_double { TYPE_DOUBLE } else { TYPE_VECTOR };
            let object = call.checked("helicsFederateRegisterGlobalInput", |error| {
                // SAFETY: the federate is valid, strings and error live through the call.
                unsafe { (functions.register_input)(federate, key.as_ptr(), kind, unit.as_ptr(), error) }
            })?;
            call.checked("helicsInputSetOption", |error| {
                // SAFETY: the input is the one just registered.
                unsafe { (functions.input_option)(object, RECONNECTABLE, 1, error) }
            })?;
            call.checked("helicsInputAddTarget", |error| {
                // SAFETY: as above; the string lives through the call.
                unsafe { (functions.add_target)(object, target.as_ptr(), error) }
            })?;
            let sender = self.senders.iter().position(|sender| *sender == topic.from).unwrap_or_else(|| {
                self.senders.push(topic.from.clone());
                self.senders.len() - 1
            });
            let count = topic.variables.len();
            self.inputs.push(Input { object, is_double: topic.is_double, first, count, sender });
            first += count;
        }
        Ok(())
    }

    /// Lets `waiting` know from now on whom it waits for.
    pub(super) fn tell(&mut self, waiting: &Waiting) -> Result<(), FederationError> {
        waiting.connected(&self.helics, &self.name, self.federate)?;
        self.waiting = waiting.clone();
        Ok(())
    }

    /// Notes that a sender has fallen silent, or is back.
    pub(super) fn note(&self, sender: &str, is_silent: bool) {
        self.waiting.note(sender, is_silent);
    }

    /// Names of those whom it hears, in the order of [`Session::read`]'s flags.
    pub fn senders(&self) -> &[String] {
        &self.senders
    }

    /// Waits until all federates are there.
    pub fn enter_initializing(&self) -> Result<(), FederationError> {
        self.call("helicsFederateEnterInitializingMode", |f, error| {
            // SAFETY: the federate is valid as long as the session.
            unsafe { (f.functions.enter_initializing)(self.federate, error) }
        })
    }

    /// One more exchange before time starts; false when nobody had anything new and time has started.
    pub fn iterate(&self) -> Result<bool, FederationError> {
        let result = self.call("helicsFederateEnterExecutingModeIterative", |f, error| {
            // SAFETY: as above.
            unsafe { (f.functions.enter_executing_iterative)(self.federate, ITERATE_IF_NEEDED, error) }
        })?;
        match result {
            NEXT_STEP => {
                self.waiting.start();
                Ok(false)
            }
            ITERATING => Ok(true),
            other => Err(self.failed("helicsFederateEnterExecutingModeIterative", format!("said {other}"))),
        }
    }

    /// Lets time start, and says which time it is then, ns: later than 0 for one who comes late.
    pub fn enter_executing(&self) -> Result<i64, FederationError> {
        self.call("helicsFederateEnterExecutingMode", |f, error| {
            // SAFETY: as above.
            unsafe { (f.functions.enter_executing)(self.federate, error) }
        })?;
        self.waiting.start();
        let time_s = self.call("helicsFederateGetCurrentTime", |f, error| {
            // SAFETY: as above.
            unsafe { (f.functions.current_time)(self.federate, error) }
        })?;
        Ok(ns(time_s))
    }

    /// Waits for this time, ns. Fails where the federation ended before.
    pub fn request(&self, time_ns: i64) -> Result<(), FederationError> {
        let granted_s = self.call("helicsFederateRequestTime", |f, error| {
            // SAFETY: as above.
            unsafe { (f.functions.request_time)(self.federate, time_ns as f64 / 1e9, error) }
        })?;
        if ns(granted_s) != time_ns {
            let reason = format!("was granted {granted_s:?} s instead of {:?} s", time_ns as f64 / 1e9);
            return Err(self.failed("helicsFederateRequestTime", reason));
        }
        Ok(())
    }

    /// Tells all topics; `values` are those of [`Share::told_variables`].
    pub fn publish(&mut self, values: &[f64]) -> Result<(), FederationError> {
        let functions = &self.helics.functions;
        let call = Caller { name: &self.name };
        for publication in &mut self.publications {
            let object = publication.object;
            for (value, index) in publication.values.iter_mut().zip(&publication.indices) {
                *value = values.get(*index).copied().unwrap_or(f64::NAN);
            }
            match (publication.is_double, publication.values.first()) {
                (true, Some(value)) => call.checked("helicsPublicationPublishDouble", |error| {
                    // SAFETY: the publication lives as long as its federate.
                    unsafe { (functions.publish_double)(object, *value, error) }
                })?,
                _ => call.checked("helicsPublicationPublishVector", |error| {
                    // SAFETY: as above; pointer and length are those of one array.
                    unsafe {
                        let (pointer, count) = (publication.values.as_ptr(), publication.values.len());
                        (functions.publish_vector)(object, pointer, count as c_int, error)
                    }
                })?,
            }
        }
        Ok(())
    }

    /// Reads what is new into `values`; `is_heard` says of each sender whether anything of it was new.
    pub fn read(&mut self, values: &mut [f64], is_heard: &mut [bool]) -> Result<(), FederationError> {
        let functions = &self.helics.functions;
        let call = Caller { name: &self.name };
        is_heard.fill(false);
        for input in &self.inputs {
            // SAFETY: the input lives as long as its federate.
            if unsafe { (functions.is_updated)(input.object) } == 0 {
                continue;
            }
            let Some(target) = values.get_mut(input.first..input.first + input.count) else { continue };
            if input.is_double {
                let value = call.checked("helicsInputGetDouble", |error| {
                    // SAFETY: as above.
                    unsafe { (functions.get_double)(input.object, error) }
                })?;
                target.fill(value);
            } else {
                // SAFETY: as above.
                let found = unsafe { (functions.vector_size)(input.object) };
                if found != input.count as c_int {
                    let sender = self.senders.get(input.sender).map_or("", String::as_str);
                    let reason = format!("{sender} sent {found} values, expected {}", input.count);
                    return Err(call.failed("helicsInputGetVector", reason));
                }
                let mut size: c_int = 0;
                call.checked("helicsInputGetVector", |error| {
                    // SAFETY: as above; HELICS writes at most as many values as it is told there is room for.
                    unsafe {
                        (functions.get_vector)(input.object, target.as_mut_ptr(), found, &mut size, error)
                    }
                })?;
            }
            if let Some(flag) = is_heard.get_mut(input.sender) {
                *flag = true;
            }
        }
        Ok(())
    }

    /// Leaves; the others go on without it. A second call does nothing.
    pub fn leave(&mut self) -> Result<(), FederationError> {
        let federate = std::mem::replace(&mut self.federate, ptr::null_mut());
        if federate.is_null() {
            return Ok(());
        }
        let functions = &self.helics.functions;
        let left = Caller { name: &self.name }.checked("helicsFederateDisconnect", |error| {
            // SAFETY: the federate was made by this session and is let go here.
            unsafe { (functions.disconnect)(federate, error) }
        });
        // SAFETY: nobody has it any more.
        unsafe { (functions.free_federate)(federate) };
        self.waiting.leave(&self.helics, &self.name);
        left
    }

    fn call<T>(
        &self,
        function: &'static str,
        body: impl FnOnce(&Helics, *mut HelicsError) -> T,
    ) -> Result<T, FederationError> {
        self.waiting
            .during(|| Caller { name: &self.name }.checked(function, |error| body(&self.helics, error)))
    }

    fn failed(&self, function: &'static str, reason: String) -> FederationError {
        Caller { name: &self.name }.failed(function, reason)
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // Nobody is left to be told.
        let _ = self.leave();
    }
}

/// Who calls, for the error that may come of it.
pub(super) struct Caller<'a> {
    pub name: &'a str,
}

impl Caller<'_> {
    /// Calls a function that fills a `HelicsError`.
    pub fn checked<T>(
        &self,
        function: &'static str,
        body: impl FnOnce(*mut HelicsError) -> T,
    ) -> Result<T, FederationError> {
        let mut error = HelicsError { code: 0, message: ptr::null::<c_char>() };
        let value = body(&mut error);
        match error.code {
            0 => Ok(value),
            code => Err(self.failed(function, format!("{} ({code})", text(error.message)))),
        }
    }

    fn failed(&self, call: &'static str, reason: String) -> FederationError {
        let hint = match call {
            "helicsCreateValueFederate" => {
                "; is the broker running, at this address and with this core type?"
            }
            "helicsFederateRequestTime" => "; the federation has ended, or its broker is gone",
            _ => "",
        };
        FederationError::Call { federate: self.name.to_owned(), call, reason, hint }
    }
}

/// The nearest nanosecond; HELICS counts in them too.
fn ns(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

pub(super) fn c_string(text: &str) -> Result<CString, FederationError> {
    CString::new(text).map_err(|_| FederationError::Name { text: text.to_owned() })
}

//! Log lines on their way from model and shell to the importer's logger. Never a line from another
//! thread than the calling one, never a line break inside a line.
//!
//! `loggingOn` and the chosen categories govern events and warnings. A line that explains why a call
//! did not return fmi2OK always goes out: it is no debug message, and there is no other way to learn
//! what was wrong.

use super::bindings::{
    fmi2CallbackFunctions, fmi2CallbackLogger, fmi2ComponentEnvironment, fmi2Status, fmi2Status_fmi2Discard,
    fmi2Status_fmi2Error, fmi2Status_fmi2Fatal, fmi2Status_fmi2OK, fmi2Status_fmi2Warning,
};
use super::model::{Log, LogLevel};
use std::ffi::{CStr, CString};
use std::fmt;
use std::io::Write;

/// The log categories of the model description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Category {
    /// Events of the model, for instance a new topology.
    Events,
    /// Something that a user should look at.
    Warning,
    /// A status that cannot be given.
    Discard,
    /// A refused call.
    Error,
    /// The instance is lost.
    Fatal,
}

impl Category {
    /// All categories but `logAll`, which stands for them.
    pub const ALL: [Category; 5] =
        [Category::Events, Category::Warning, Category::Discard, Category::Error, Category::Fatal];

    /// Its name in the model description.
    pub fn name(self) -> &'static CStr {
        match self {
            Category::Events => c"logEvents",
            Category::Warning => c"logStatusWarning",
            Category::Discard => c"logStatusDiscard",
            Category::Error => c"logStatusError",
            Category::Fatal => c"logStatusFatal",
        }
    }

    /// What it holds, for the model description.
    pub fn description(self) -> &'static str {
        match self {
            Category::Events => "events of the model",
            Category::Warning => "what a user should look at",
            Category::Discard => "a status that is not available",
            Category::Error => "refused calls, with variable, value and what was expected",
            Category::Fatal => "the instance is lost",
        }
    }

    /// The FMI status of its lines.
    pub fn status(self) -> fmi2Status {
        match self {
            Category::Events => fmi2Status_fmi2OK,
            Category::Warning => fmi2Status_fmi2Warning,
            Category::Discard => fmi2Status_fmi2Discard,
            Category::Error => fmi2Status_fmi2Error,
            Category::Fatal => fmi2Status_fmi2Fatal,
        }
    }
}

/// The name of the category that stands for all.
pub const LOG_ALL: &CStr = c"logAll";

/// Where lines end up.
pub trait Sink {
    /// Takes one line.
    fn write(&mut self, category: Category, message: fmt::Arguments<'_>);
}

/// A function or closure is a sink.
impl<F: FnMut(Category, fmt::Arguments<'_>)> Sink for F {
    fn write(&mut self, category: Category, message: fmt::Arguments<'_>) {
        self(category, message);
    }
}

/// Lets pass what is wanted and hands it to the sink, if there is one.
pub struct Logger {
    sink: Option<Box<dyn Sink + Send>>,
    events: bool,
    warnings: bool,
}

impl Logger {
    /// Swallows everything.
    pub fn silent() -> Self {
        Self { sink: None, events: false, warnings: false }
    }

    /// Writes to this sink; events and warnings only with `logging_on`.
    pub fn new(sink: impl Sink + Send + 'static, logging_on: bool) -> Self {
        Self { sink: Some(Box::new(sink)), events: logging_on, warnings: logging_on }
    }

    /// fmi2SetDebugLogging; no categories, or `logAll`, mean all. Unknown ones are named in a warning
    /// and ignored: masters pass categories of their own.
    pub fn set_debug_logging<'a>(&mut self, on: bool, categories: impl Iterator<Item = &'a CStr>) {
        self.set_debug_logging_by("fmi2SetDebugLogging", on, categories);
    }

    /// The same by a function of another name.
    pub(super) fn set_debug_logging_by<'a>(
        &mut self,
        function: &str,
        on: bool,
        categories: impl Iterator<Item = &'a CStr>,
    ) {
        let mut categories = categories.peekable();
        let all = categories.peek().is_none();
        (self.events, self.warnings) = (on && all, on && all);
        for name in categories {
            if name == LOG_ALL {
                (self.events, self.warnings) = (on, on);
            } else if name == Category::Events.name() {
                self.events |= on;
            } else if name == Category::Warning.name() {
                self.warnings |= on;
            } else if !Category::ALL.iter().any(|known| known.name() == name) {
                let line = format_args!(
                    "{function}: category {name:?} is unknown and ignored; expected logEvents, \
                     logStatusWarning, logStatusDiscard, logStatusError, logStatusFatal or logAll"
                );
                if let (true, Some(sink)) = (on, &mut self.sink) {
                    sink.write(Category::Warning, line);
                }
            }
        }
    }

    /// Writes one line, if its category is wanted.
    pub fn write(&mut self, category: Category, message: fmt::Arguments<'_>) {
        let wanted = match category {
            Category::Events => self.events,
            Category::Warning => self.warnings,
            Category::Discard | Category::Error | Category::Fatal => true,
        };
        if let (true, Some(sink)) = (wanted, &mut self.sink) {
            sink.write(category, message);
        }
    }
}

impl Log for Logger {
    fn log(&mut self, level: LogLevel, message: fmt::Arguments<'_>) {
        let category = match level {
            LogLevel::Event => Category::Events,
            LogLevel::Warning => Category::Warning,
        };
        self.write(category, message);
    }
}

/// The importer's logger.
struct Callback {
    function: unsafe extern "C" fn(
        fmi2ComponentEnvironment,
        *const std::ffi::c_char,
        fmi2Status,
        *const std::ffi::c_char,
        *const std::ffi::c_char,
        ...
    ),
    environment: fmi2ComponentEnvironment,
    instance_name: CString,
    line: Vec<u8>,
}

// SAFETY: the environment is the importer's and only handed back to it, from inside a call that the
// importer makes; FMI lets it make its calls from any thread, one at a time.
unsafe impl Send for Callback {}

/// The message as one line that ends in NUL, in the room of `line`.
pub(super) fn write_line(line: &mut Vec<u8>, message: fmt::Arguments<'_>) {
    line.clear();
    if line.write_fmt(message).is_err() {
        line.extend_from_slice(b"(a log line that could not be formatted)");
    }
    for byte in line.iter_mut() {
        if matches!(byte, 0 | b'\n' | b'\r') {
            *byte = b' ';
        }
    }
    line.push(0);
}

impl Sink for Callback {
    fn write(&mut self, category: Category, message: fmt::Arguments<'_>) {
        write_line(&mut self.line, message);
        // SAFETY: the function is the importer's logger, alive as long as the instance (FMI 2.0.1,
        // section 2.1.5); all strings end in NUL, and "%s" takes exactly the one argument given.
        unsafe {
            (self.function)(
                self.environment,
                self.instance_name.as_ptr(),
                category.status(),
                category.name().as_ptr(),
                c"%s".as_ptr(),
                self.line.as_ptr(),
            );
        }
    }
}

/// The logger behind the importer's callbacks, any of which may be missing.
///
/// # Safety
/// `functions` is NULL or points to a valid structure; its logger, if any, stays callable while the
/// result lives.
pub(super) unsafe fn from_callbacks(
    functions: *const fmi2CallbackFunctions,
    instance_name: &CStr,
    on: bool,
) -> Logger {
    // SAFETY: as promised by the caller.
    let functions = unsafe { functions.as_ref() };
    let logger: fmi2CallbackLogger = functions.and_then(|f| f.logger);
    match (functions, logger) {
        (Some(functions), Some(function)) => {
            let environment = functions.componentEnvironment;
            let instance_name = instance_name.to_owned();
            Logger::new(Callback { function, environment, instance_name, line: Vec::new() }, on)
        }
        _ => Logger::silent(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    fn recorded(on: bool) -> (Logger, Arc<Mutex<Vec<Category>>>) {
        let lines = Arc::new(Mutex::new(Vec::new()));
        let sink = Arc::clone(&lines);
        (Logger::new(move |category, _: fmt::Arguments<'_>| sink.lock().unwrap().push(category), on), lines)
    }

    fn passed(logger: &mut Logger, lines: &Mutex<Vec<Category>>) -> Vec<Category> {
        lines.lock().unwrap().clear();
        for category in Category::ALL {
            logger.write(category, format_args!("x"));
        }
        lines.lock().unwrap().clone()
    }

    #[test]
    fn errors_always_pass_and_the_rest_by_choice() {
        use Category::*;
        let (mut logger, lines) = recorded(false);
        assert_eq!(passed(&mut logger, &lines), [Discard, Error, Fatal]);
        logger.set_debug_logging(true, [].into_iter());
        assert_eq!(passed(&mut logger, &lines), [Events, Warning, Discard, Error, Fatal]);
        logger.set_debug_logging(true, [c"logStatusWarning"].into_iter());
        assert_eq!(passed(&mut logger, &lines), [Warning, Discard, Error, Fatal]);
        logger.set_debug_logging(true, [c"logEvents", c"logStatusError"].into_iter());
        assert_eq!(passed(&mut logger, &lines), [Events, Discard, Error, Fatal]);
        logger.set_debug_logging(true, [c"logAll"].into_iter());
        assert_eq!(passed(&mut logger, &lines), [Events, Warning, Discard, Error, Fatal]);
        logger.set_debug_logging(false, [].into_iter());
        assert_eq!(passed(&mut logger, &lines), [Discard, Error, Fatal]);
    }

    #[test]
    fn an_unknown_category_is_named_and_ignored() {
        let (mut logger, lines) = recorded(false);
        logger.set_debug_logging(true, [c"logEverything"].into_iter());
        assert_eq!(*lines.lock().unwrap(), [Category::Warning]);
        assert_eq!(passed(&mut logger, &lines), [Category::Discard, Category::Error, Category::Fatal]);
    }
}

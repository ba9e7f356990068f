//! Log lines on their way to FMI 3.0's `logMessage`. Which lines pass is decided in [`crate::fmi::logging`].

use crate::fmi::logging::{Category, Logger, Sink, write_line};
use crate::fmi::three::bindings::{
    fmi3InstanceEnvironment, fmi3LogMessageCallback, fmi3Status, fmi3Status_fmi3Discard,
    fmi3Status_fmi3Error, fmi3Status_fmi3Fatal, fmi3Status_fmi3OK, fmi3Status_fmi3Warning, fmi3String,
};
use std::fmt;

/// The importer's logger.
struct Callback {
    function: unsafe extern "C" fn(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String),
    environment: fmi3InstanceEnvironment,
    line: Vec<u8>,
}

// SAFETY: the environment is the importer's and only handed back to it, from inside a call that the
// importer makes; FMI lets it make its calls from any thread, one at a time.
unsafe impl Send for Callback {}

fn status(category: Category) -> fmi3Status {
    match category {
        Category::Events => fmi3Status_fmi3OK,
        Category::Warning => fmi3Status_fmi3Warning,
        Category::Discard => fmi3Status_fmi3Discard,
        Category::Error => fmi3Status_fmi3Error,
        Category::Fatal => fmi3Status_fmi3Fatal,
    }
}

impl Sink for Callback {
    fn write(&mut self, category: Category, message: fmt::Arguments<'_>) {
        write_line(&mut self.line, message);
        // SAFETY: the function is the importer's logger, alive as long as the instance (FMI 3.0,
        // section 2.3.1); both strings end in NUL.
        unsafe {
            (self.function)(
                self.environment,
                status(category),
                category.name().as_ptr(),
                self.line.as_ptr().cast(),
            );
        }
    }
}

/// The logger behind the importer's callback, which may be missing.
///
/// # Safety
/// `function`, if any, stays callable while the result lives.
pub(super) unsafe fn from_callback(
    function: fmi3LogMessageCallback,
    environment: fmi3InstanceEnvironment,
    on: bool,
) -> Logger {
    match function {
        Some(function) => Logger::new(Callback { function, environment, line: Vec::new() }, on),
        None => Logger::silent(),
    }
}

//! Federates of HELICS: a scenario's participants as processes, perhaps on several machines. Binds libhelics at run time,
//! and makes of all other federates one participant of an ordinary run, so that the master, the recorder and the
//! checkpoints of the harness are those of one process. Knows no physics, and of our own models the names of three inputs (`enable`, `available`,
//! `remote_available`); prints nothing, starts no process.

mod address;
mod broker;
mod error;
mod library;
mod member;
mod others;
mod rejoining;
mod session;
mod topics;
mod waiting;

pub use address::Address;
pub use broker::Broker;
pub use error::FederationError;
pub use library::{Helics, VARIABLE, WANTED};
pub use member::Federation;
pub use others::{LATER_NS, OTHERS};
pub use session::Session;
pub use topics::{Form, Share, Topic};
pub use waiting::Waiting;

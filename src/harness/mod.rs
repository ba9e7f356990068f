//! The importer side: unzip, load, safe instance, coupling, master algorithm, events, recorder.
//! Takes any FMI 2.0 co-simulation FMU. Knows nothing of batteries or grids, prints nothing, and
//! never lets C reach past [`library`], [`logger`] and [`slave`].

mod apart;
pub mod archive;
mod binary;
pub mod checkpoint;
mod closed_loop;
pub mod coupling;
mod csv;
pub mod description;
mod description_xml;
pub mod error;
mod fault;
pub mod fmu;
mod guarded;
mod hash;
pub mod in_process;
pub mod isolation;
pub mod keeping;
pub mod library;
pub mod logger;
mod lookup;
pub mod master;
pub mod memory;
pub mod near;
pub mod observer;
mod parted;
pub mod participant;
pub mod plan;
pub mod recorder;
pub mod scenario;
mod schedule;
mod screened;
pub mod slave;
mod slave_state;
pub mod value;
mod wiring;

pub use apart::{Apart, stage_apart};
pub use archive::{Limits, Unpacked};
pub use checkpoint::{Checkpoint, CheckpointError};
pub use coupling::{Connection, Endpoint, connect, connect_equal_names};
pub use description::{Causality, ModelDescription, Variability, Variable};
pub use error::HarnessError;
pub use fmu::Fmu;
pub use in_process::InProcess;
pub use isolation::Isolation;
pub use keeping::Keeping;
pub use master::{Outcome, Position, run, run_from};
pub use memory::Memory;
pub use observer::{Column, Experiment, FanOut, Observer, ObserverError, Progress, Sample, Silent};
pub use participant::{CallError, Participant, StateHandle, Trouble};
pub use plan::{Algorithm, Event, Plan, Setting};
pub use recorder::Recorder;
pub use scenario::{CONTROLLER, Cast, GRID, Origin, plan as scenario_plan, stage, stage_isolated};
pub use slave::Slave;
pub use value::{Kind, Value};

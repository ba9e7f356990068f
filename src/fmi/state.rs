//! FMU states: deep copies, and bytes that are valid in any process and instance of the same FMU.
//!
//! Layout of the bytes, little-endian: magic (8), format version (4), GUID (16), fingerprint of the resources (16),
//! payload length (8), FNV-1a 64 checksum of all of the foregoing and the payload (8), payload (postcard).

use super::call_order::State;
use super::derivatives::Ramps;
use super::guid::Guid;
use super::model::Model;
use serde::{Deserialize, Serialize};

const MAGIC: &[u8; 8] = b"FMI2STAT";
const FORMAT_VERSION: u32 = 3;
const HEADER: usize = 60;

/// What the shell itself keeps about an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Life {
    pub state: State,
    /// Counted communication time, ns.
    pub time_ns: i64,
    /// Whether fmi2ExitInitializationMode has been passed.
    pub initialized: bool,
    /// Whether something has been set since outputs were last brought in line.
    pub stale: bool,
}

/// Whose states are each other's: FMUs of one list of variables that were made from the same resources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Maker {
    pub guid: Guid,
    /// [`Model::fingerprint`].
    pub resources: u128,
}

impl Maker {
    /// Refuses what another has made.
    pub fn check(&self, found: &Maker) -> Result<(), FormatError> {
        if found.guid != self.guid {
            let (found, expected) = (found.guid.to_string(), self.guid.to_string());
            return Err(FormatError::OtherFmu { found, expected });
        }
        if found.resources != self.resources {
            return Err(FormatError::OtherResources);
        }
        Ok(())
    }
}

/// A deep copy of an instance's state.
pub struct Snapshot<M: Model> {
    pub(super) maker: Maker,
    pub(super) life: Life,
    pub(super) ramps: Ramps,
    pub(super) state: M::State,
}

impl<M: Model> Clone for Snapshot<M> {
    fn clone(&self) -> Self {
        Self { maker: self.maker, life: self.life, ramps: self.ramps.clone(), state: self.state.clone() }
    }
}

/// Why bytes are not a state of this FMU.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum FormatError {
    #[error("serialized state has {found} bytes; expected {expected} bytes")]
    Length { found: usize, expected: usize },
    #[error("these bytes are no FMU state: they do not begin with \"FMI2STAT\"")]
    Magic,
    #[error("serialized state has format version {found}; expected {FORMAT_VERSION}")]
    Version { found: u32 },
    #[error("serialized state belongs to the FMU with GUID {found}; expected {expected}")]
    OtherFmu { found: String, expected: String },
    #[error(
        "state belongs to an FMU that has the same variables and was made from other resources (graph, network, law, limits); \
         expected one of this FMU"
    )]
    OtherResources,
    #[error("serialized state is damaged: its checksum does not fit")]
    Checksum,
    #[error("serialized state cannot be read: {0}")]
    Payload(String),
    #[error("room for {found} bytes; expected at least {expected}, as fmi2SerializedFMUstateSize says")]
    Room { found: usize, expected: usize },
}

impl<M: Model> Snapshot<M> {
    /// Number of bytes that [`Snapshot::serialize_into`] writes.
    pub fn serialized_size(&self) -> Result<usize, FormatError> {
        let size = postcard::ser_flavors::Size::default();
        let payload = postcard::serialize_with_flavor(&(&self.life, &self.ramps, &self.state), size)
            .map_err(payload)?;
        Ok(HEADER + payload)
    }

    /// Writes the state to the front of `out` and returns the number of bytes. A `out` that is too
    /// short is refused.
    pub fn serialize_into(&self, out: &mut [u8]) -> Result<usize, FormatError> {
        let (expected, found) = (self.serialized_size()?, out.len());
        let (header, rest) = out.split_at_mut_checked(HEADER).ok_or(FormatError::Room { found, expected })?;
        let (front, checksum_field) = header.split_at_mut(HEADER - 8);
        let body = rest.get_mut(..expected - HEADER).ok_or(FormatError::Room { found, expected })?;
        let body = postcard::to_slice(&(&self.life, &self.ramps, &self.state), body).map_err(payload)?;
        let Maker { guid, resources } = self.maker;
        let length = (body.len() as u64).to_le_bytes();
        let fields: [&[u8]; 5] =
            [MAGIC, &FORMAT_VERSION.to_le_bytes(), &guid.0, &resources.to_le_bytes(), &length];
        for (place, byte) in front.iter_mut().zip(fields.into_iter().flatten()) {
            *place = *byte;
        }
        checksum_field.copy_from_slice(&checksum(front, body).to_le_bytes());
        Ok(expected)
    }

    /// The state as bytes.
    pub fn serialize(&self) -> Result<Vec<u8>, FormatError> {
        let mut bytes = vec![0; self.serialized_size()?];
        self.serialize_into(&mut bytes)?;
        Ok(bytes)
    }

    /// Reads bytes of this maker, neither fewer nor more than were written.
    pub(super) fn deserialize(bytes: &[u8], maker: Maker) -> Result<Self, FormatError> {
        let truncated = |expected| FormatError::Length { found: bytes.len(), expected };
        let (magic, rest) = bytes.split_first_chunk::<8>().ok_or(truncated(HEADER))?;
        if magic != MAGIC {
            return Err(FormatError::Magic);
        }
        let (version, rest) = rest.split_first_chunk::<4>().ok_or(truncated(HEADER))?;
        let found = u32::from_le_bytes(*version);
        if found != FORMAT_VERSION {
            return Err(FormatError::Version { found });
        }
        let (id, rest) = rest.split_first_chunk::<16>().ok_or(truncated(HEADER))?;
        let (resources, rest) = rest.split_first_chunk::<16>().ok_or(truncated(HEADER))?;
        maker.check(&Maker { guid: Guid(*id), resources: u128::from_le_bytes(*resources) })?;
        let (length, rest) = rest.split_first_chunk::<8>().ok_or(truncated(HEADER))?;
        let (sum, rest) = rest.split_first_chunk::<8>().ok_or(truncated(HEADER))?;
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        let body =
            Some(rest).filter(|r| r.len() == length).ok_or(truncated(HEADER.saturating_add(length)))?;
        let front = bytes.get(..HEADER - 8).ok_or(truncated(HEADER))?;
        if checksum(front, body) != u64::from_le_bytes(*sum) {
            return Err(FormatError::Checksum);
        }
        let ((life, ramps, state), left): ((Life, Ramps, M::State), _) =
            postcard::take_from_bytes(body).map_err(payload)?;
        if !left.is_empty() || life.state == State::Fatal || !ramps.is_finite() {
            return Err(FormatError::Payload("its contents contradict themselves".to_owned()));
        }
        Ok(Self { maker, life, ramps, state })
    }
}

fn payload(error: postcard::Error) -> FormatError {
    FormatError::Payload(error.to_string())
}

/// FNV-1a, 64 bits; it notices every change of a single byte.
pub(super) fn checksum(front: &[u8], body: &[u8]) -> u64 {
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    front.iter().chain(body).fold(0xcbf2_9ce4_8422_2325, step)
}

//! FMU states of FMI 3.0: that of [`crate::fmi::state`], with the shape of the model that it belongs to.
//!
//! Layout of the bytes, little-endian: magic (8), format version (4), instantiation token (16), payload length (8),
//! FNV-1a 64 checksum of all of the foregoing and the payload (8), payload: sizes and arrays (postcard), then the
//! bytes of FMI 2.0.

use super::call_order::Function;
use super::error::{Outcome, Reason};
use super::instance::Instance;
use crate::fmi::call_order::State as CommonState;
use crate::fmi::guid::Guid;
use crate::fmi::model::Model;
use crate::fmi::shape::ShapeValues;
use crate::fmi::state::{FormatError, Snapshot as Common, checksum};

const MAGIC: &[u8; 8] = b"FMI3STAT";
const FORMAT_VERSION: u32 = 1;
const HEADER: usize = 44;

/// A deep copy of an instance's state.
pub struct Snapshot<M: Model> {
    pub(super) token: Guid,
    pub(super) configuring: bool,
    /// What `inner` belongs to.
    pub(super) built: ShapeValues,
    /// What had been set beyond that.
    pub(super) wanted: Option<ShapeValues>,
    pub(super) inner: Common<M>,
}

fn unreadable(error: impl std::fmt::Display) -> Reason {
    Reason::Format(format!("serialized state cannot be read: {error}"))
}

fn common(error: FormatError) -> Reason {
    Reason::Format(error.to_string())
}

impl<M: Model> Snapshot<M> {
    fn head(&self) -> (bool, &ShapeValues, Option<&ShapeValues>) {
        (self.configuring, &self.built, self.wanted.as_ref())
    }

    fn head_size(&self) -> Outcome<usize> {
        let size = postcard::ser_flavors::Size::default();
        postcard::serialize_with_flavor(&self.head(), size).map_err(unreadable)
    }

    /// Number of bytes that [`Snapshot::serialize_into`] writes.
    pub fn serialized_size(&self) -> Outcome<usize> {
        Ok(HEADER + self.head_size()? + self.inner.serialized_size().map_err(common)?)
    }

    /// Writes the state to the front of `out`. An `out` that is too short is refused.
    pub fn serialize_into(&self, out: &mut [u8]) -> Outcome<()> {
        let (expected, found) = (self.serialized_size()?, out.len());
        let (header, rest) = match out.get_mut(..expected) {
            Some(out) => out.split_at_mut(HEADER),
            None => {
                let expected = format!("at least {expected}, as fmi3SerializedFMUStateSize says");
                return Err(Reason::argument("size", found, expected));
            }
        };
        let length = (expected - HEADER) as u64;
        let fields: [&[u8]; 4] = [MAGIC, &FORMAT_VERSION.to_le_bytes(), &self.token.0, &length.to_le_bytes()];
        let (front, checksum_field) = header.split_at_mut(HEADER - 8);
        for (place, byte) in front.iter_mut().zip(fields.into_iter().flatten()) {
            *place = *byte;
        }
        let (head, tail) = rest.split_at_mut(self.head_size()?);
        postcard::to_slice(&self.head(), head).map_err(unreadable)?;
        self.inner.serialize_into(tail).map_err(common)?;
        checksum_field.copy_from_slice(&checksum(front, rest).to_le_bytes());
        Ok(())
    }

    /// The state as bytes.
    pub fn serialize(&self) -> Outcome<Vec<u8>> {
        let mut bytes = vec![0; self.serialized_size()?];
        self.serialize_into(&mut bytes)?;
        Ok(bytes)
    }
}

impl<M: Model> Instance<M> {
    /// fmi3SetFMUState: back, or forth, to a snapshot of any instance of this FMU, also one of other sizes.
    pub fn restore(&mut self, snapshot: &Snapshot<M>) -> Outcome<()> {
        self.allow(Function::SetFMUState)?;
        if snapshot.token != self.token() {
            return Err(other_fmu(snapshot.token, self.token()));
        }
        let contradiction = || Reason::Format("state of other sizes than this FMU can have".to_owned());
        let shape = self.built.with(&snapshot.built).ok_or_else(contradiction)?;
        let wanted = match &snapshot.wanted {
            Some(values) => Some(self.built.with(values).ok_or_else(contradiction)?),
            None => None,
        };
        if shape == self.built {
            self.inner.restore(&snapshot.inner)?;
        } else {
            let mut fresh = self.fresh(&shape)?;
            fresh.restore(&snapshot.inner)?;
            self.replace(fresh, shape);
        }
        self.wanted = wanted;
        self.configuring = snapshot.configuring;
        Ok(())
    }

    /// fmi3DeserializeFMUState: bytes of any process and instance of this FMU.
    pub fn deserialize(&self, bytes: &[u8]) -> Outcome<Snapshot<M>> {
        self.allow(Function::DeserializeFMUState)?;
        let short = |expected: usize| {
            Reason::Format(format!("serialized state has {} bytes; expected {expected} bytes", bytes.len()))
        };
        let (magic, rest) = bytes.split_first_chunk::<8>().ok_or_else(|| short(HEADER))?;
        if magic != MAGIC {
            let reason = "these bytes are no FMU state of FMI 3.0: they do not begin with \"FMI3STAT\"";
            return Err(Reason::Format(reason.to_owned()));
        }
        let (version, rest) = rest.split_first_chunk::<4>().ok_or_else(|| short(HEADER))?;
        let found = u32::from_le_bytes(*version);
        if found != FORMAT_VERSION {
            let reason = format!("serialized state has format version {found}; expected {FORMAT_VERSION}");
            return Err(Reason::Format(reason));
        }
        let (token, rest) = rest.split_first_chunk::<16>().ok_or_else(|| short(HEADER))?;
        if *token != self.token().0 {
            return Err(other_fmu(Guid(*token), self.token()));
        }
        let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(|| short(HEADER))?;
        let (sum, payload) = rest.split_first_chunk::<8>().ok_or_else(|| short(HEADER))?;
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        if payload.len() != length {
            return Err(short(HEADER.saturating_add(length)));
        }
        let front = bytes.get(..HEADER - 8).ok_or_else(|| short(HEADER))?;
        if checksum(front, payload) != u64::from_le_bytes(*sum) {
            return Err(common(FormatError::Checksum));
        }
        type Head = (bool, ShapeValues, Option<ShapeValues>);
        let ((configuring, built, wanted), rest): (Head, _) =
            postcard::take_from_bytes(payload).map_err(unreadable)?;
        let contradiction = || unreadable("its contents contradict themselves");
        let shape = self.built.with(&built).ok_or_else(contradiction)?;
        let target = match &wanted {
            Some(values) => Some(self.built.with(values).ok_or_else(contradiction)?),
            None => None,
        };
        let maker = if shape == self.built { self.inner.maker() } else { self.fresh(&shape)?.maker() };
        let inner = Common::deserialize(rest, maker).map_err(common)?;
        // Other sizes are wanted in configuration mode alone, which is before anything begins.
        let is_possible = match target {
            _ if configuring => inner.life.state == CommonState::Instantiated,
            Some(target) => target.has_sizes_of(&shape),
            None => true,
        };
        if !is_possible {
            return Err(contradiction());
        }
        Ok(Snapshot { token: self.token(), configuring, built, wanted, inner })
    }
}

fn other_fmu(found: Guid, expected: Guid) -> Reason {
    Reason::Format(format!("state belongs to the FMU with instantiation token {found}; expected {expected}"))
}

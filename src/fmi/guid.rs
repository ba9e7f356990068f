//! The GUID: a hash of everything that an importer relies on. A model description and a shared
//! library with its resources that do not belong together are told apart by it.

use super::lookup::{Interface, Registry, Value};
use super::model::Model;
use super::shape::{Shape, Values};
use serde::Serialize;
use std::fmt;

/// Raised when the meaning of calls changes without a change in the list of variables.
const INTERFACE_VERSION: u32 = 1;

/// 128 bits, written in the shape of a UUID, without braces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guid(pub [u8; 16]);

impl Guid {
    /// Hash of identifier, interface version, what tells the model from its like, and each variable's name, type, causality, variability,
    /// unit, range and start value. `model` is freshly loaded.
    pub fn of<M: Model>(registry: &Registry<M>, model: &M) -> Self {
        let mut hash = Fnv128::default();
        hash.text(M::IDENTIFIER);
        hash.bytes(&INTERFACE_VERSION.to_le_bytes());
        hash.bytes(&[u8::from(registry.interface == Interface::Portable)]);
        let distinction = model.distinction();
        if !distinction.is_empty() {
            hash.text(&distinction);
        }
        for (_, group) in registry.groups() {
            hash.text(group.name);
            hash.bytes(&[
                group.type_in(registry.interface) as u8,
                group.causality as u8,
                group.variability as u8,
                group.unit.map_or(255, |unit| unit as u8),
                u8::from(group.count.is_some()),
                u8::from(group.range.min_excluded),
            ]);
            hash.bytes(&(group.len() as u64).to_le_bytes());
            hash.bytes(&group.range.min.to_bits().to_le_bytes());
            hash.bytes(&group.range.max.to_bits().to_le_bytes());
            if group.causality == super::registry::Causality::Output {
                continue;
            }
            for index in 0..group.len() {
                match group.value(model, index, Interface::Structured) {
                    Value::Real(value) => hash.bytes(&value.to_bits().to_le_bytes()),
                    Value::Integer(value) => hash.bytes(&value.to_le_bytes()),
                    Value::Boolean(value) => hash.bytes(&[u8::from(value)]),
                }
            }
        }
        Guid(hash.0.to_be_bytes())
    }

    /// The instantiation token of FMI 3.0: hash of the model's GUID and of what else its description shows.
    pub(super) fn token(self, shape: &Shape) -> Self {
        let mut hash = Fnv128::default();
        hash.text("FMI 3.0");
        hash.bytes(&self.0);
        for size in &shape.sizes {
            hash.text(size.name);
            for number in [size.value, size.min, size.max] {
                hash.bytes(&number.to_le_bytes());
            }
        }
        for array in &shape.arrays {
            hash.text(array.name);
            hash.text(array.size);
            hash.bytes(&[u8::from(matches!(array.values, Values::UInt64(_)))]);
        }
        Guid(hash.0.to_be_bytes())
    }
}

/// Hash of what a model is made from, for [`Model::fingerprint`]; 0 of what cannot be written as bytes.
pub fn fingerprint<T: Serialize>(of: &T) -> u128 {
    postcard::to_extend(of, Fnv128::default()).map_or(0, |hash| hash.0)
}

impl Extend<u8> for Fnv128 {
    fn extend<I: IntoIterator<Item = u8>>(&mut self, bytes: I) {
        bytes.into_iter().for_each(|byte| self.bytes(&[byte]));
    }
}

impl fmt::Display for Guid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, byte) in self.0.iter().enumerate() {
            let dash = if matches!(position, 4 | 6 | 8 | 10) { "-" } else { "" };
            write!(f, "{dash}{byte:02x}")?;
        }
        Ok(())
    }
}

/// FNV-1a, 128 bits: the same on every machine and in every version of Rust.
struct Fnv128(u128);

impl Default for Fnv128 {
    fn default() -> Self {
        Self(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d)
    }
}

impl Fnv128 {
    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u128::from(*byte)).wrapping_mul(0x0100_0000_0000_0000_0000_013b);
        }
    }

    fn text(&mut self, text: &str) {
        self.bytes(&(text.len() as u64).to_le_bytes());
        self.bytes(text.as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published vectors: draft-eastlake-fnv, appendix C.
    #[test]
    fn the_hash_is_fnv_1a() {
        for (text, expected) in [
            ("", 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d_u128),
            ("a", 0xd228_cb69_6f1a_8caf_7891_2b70_4e4a_8964),
            ("foobar", 0x343e_1662_793c_64bf_6f0d_3597_ba44_6f18),
        ] {
            let mut hash = Fnv128::default();
            hash.bytes(text.as_bytes());
            assert_eq!(hash.0, expected, "{text:?}");
        }
    }

    #[test]
    fn shape_of_a_uuid() {
        let guid = Guid([0xab; 16]).to_string();
        assert_eq!(guid, "abababab-abab-abab-abab-abababababab");
    }
}

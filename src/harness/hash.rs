//! FNV-1a over what a checkpoint relies on: the same on every machine. Finds mix-ups and damage, not forgery.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// FNV-1a, 64 bits, over bytes as they come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fnv64(u64);

impl Default for Fnv64 {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv64 {
    /// Goes on from a value of [`Fnv64::value`].
    pub fn from_value(value: u64) -> Self {
        Self(value)
    }

    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    pub fn value(self) -> u64 {
        self.0
    }

    pub fn of(bytes: &[u8]) -> u64 {
        let mut hash = Self::default();
        hash.add(bytes);
        hash.0
    }

    /// Hash and length of a file, or of its first `limit` bytes.
    pub fn of_file(path: &Path, limit: u64) -> io::Result<(Self, u64)> {
        let mut file = File::open(path)?.take(limit);
        let (mut hash, mut length) = (Self::default(), 0);
        let mut chunk = vec![0; 1 << 16];
        loop {
            let count = file.read(&mut chunk)?;
            if count == 0 {
                return Ok((hash, length));
            }
            hash.add(chunk.get(..count).unwrap_or_default());
            length += count as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published vectors: draft-eastlake-fnv, appendix C.
    #[test]
    fn the_hash_is_fnv_1a() {
        for (text, expected) in
            [("", 0xcbf2_9ce4_8422_2325), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            assert_eq!(Fnv64::of(text.as_bytes()), expected, "{text:?}");
        }
    }
}

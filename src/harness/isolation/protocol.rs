//! What travels between a run and the process of an FMU: frames of a length (u32, little-endian) and one message in
//! postcard's encoding. Values are their bytes, so that every bit arrives. Nothing here trusts the other side.

use serde::{Deserialize, Serialize};
use std::io::{self, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// Bytes of a message at most: a serialised state of 1 GiB with its frame.
const LARGEST: usize = (1 << 30) + 4096;

/// The three types that travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Type {
    Real,
    Integer,
    Boolean,
}

/// A call, named like the method of `Participant`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub enum Request<'a> {
    Setup { start_ns: i64, stop_ns: Option<i64> },
    EnterInitialization,
    ExitInitialization,
    Get { kind: Type, references: &'a [u8] },
    Set { kind: Type, references: &'a [u8], values: &'a [u8] },
    DoStep { t_ns: i64, h_ns: i64 },
    Terminate,
    Reset,
    SaveState,
    RestoreState(u64),
    ForgetState(u64),
    SerialiseState(u64),
    DeserialiseState(&'a [u8]),
}

/// The answer to a call; log lines may come before it.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply<'a> {
    Done,
    Values(&'a [u8]),
    State(u64),
    Bytes(&'a [u8]),
    Refused { function: &'a str, reason: &'a str, log: Vec<String> },
    Log { category: &'a str, message: &'a str },
}

/// A number as its bytes, little-endian.
pub trait Wire: Copy + Default {
    const SIZE: usize;
    fn put(self, bytes: &mut Vec<u8>);
    fn get(bytes: &[u8]) -> Self;
}

macro_rules! wire {
    ($($type:ty)*) => {$(
        impl Wire for $type {
            const SIZE: usize = size_of::<$type>();
            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
            fn get(bytes: &[u8]) -> Self {
                bytes.try_into().map_or_else(|_| Self::default(), Self::from_le_bytes)
            }
        }
    )*};
}
wire!(f64 i32 u32);

/// Appends numbers to what a message will hold.
pub fn pack<T: Wire>(values: &[T], bytes: &mut Vec<u8>) {
    values.iter().for_each(|value| value.put(bytes));
}

/// Takes numbers out of a message; false if it holds another number of them.
pub fn unpack<T: Wire>(bytes: &[u8], values: &mut [T]) -> bool {
    if bytes.len() != values.len() * T::SIZE {
        return false;
    }
    for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(T::SIZE)) {
        *value = T::get(bytes);
    }
    true
}

/// All numbers of a message; none if it ends within one.
pub fn unpack_all<T: Wire>(bytes: &[u8]) -> Option<Vec<T>> {
    let mut values = vec![T::default(); bytes.len() / T::SIZE];
    unpack(bytes, &mut values).then_some(values)
}

/// Sends messages; buffers are kept.
pub struct Sender {
    stream: UnixStream,
    buffer: Vec<u8>,
}

impl Sender {
    pub fn new(stream: UnixStream) -> Self {
        Self { stream, buffer: Vec::new() }
    }

    /// Lets the other side see that nothing will come any more.
    pub fn close(&self) {
        let _ = self.stream.shutdown(std::net::Shutdown::Write);
    }

    /// Sends one message whole.
    pub fn send(&mut self, message: &impl Serialize) -> io::Result<()> {
        let mut buffer = std::mem::take(&mut self.buffer);
        buffer.clear();
        buffer.extend_from_slice(&[0; 4]);
        let mut buffer = postcard::to_extend(message, buffer).map_err(io::Error::other)?;
        let length = buffer.len() - 4;
        if length > LARGEST {
            return Err(io::Error::other(format!("a message of {length} bytes; expected at most {LARGEST}")));
        }
        if let Some(header) = buffer.first_chunk_mut::<4>() {
            *header = (length as u32).to_le_bytes();
        }
        self.buffer = buffer;
        self.stream.write_all(&self.buffer)
    }
}

/// Receives messages; the last one is kept until the next.
pub struct Receiver {
    stream: BufReader<UnixStream>,
    message: Vec<u8>,
}

impl Receiver {
    pub fn new(stream: UnixStream) -> Self {
        Self { stream: BufReader::with_capacity(1 << 16, stream), message: Vec::new() }
    }

    /// How long [`Receiver::receive`] waits for bytes at most; zero is not allowed.
    pub fn set_limit(&mut self, limit: Duration) -> io::Result<()> {
        self.stream.get_ref().set_read_timeout(Some(limit.max(Duration::from_millis(1))))
    }

    /// Waits for one message; false at the end of the stream.
    pub fn receive(&mut self) -> io::Result<bool> {
        let mut header = [0; 4];
        match self.stream.read_exact(&mut header) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(false),
            received => received?,
        }
        let length = u32::from_le_bytes(header) as usize;
        if length > LARGEST {
            return Err(io::Error::other(format!("a message of {length} bytes; expected at most {LARGEST}")));
        }
        self.message.clear();
        // Grows with what arrives, not with what is promised.
        let received = self.stream.by_ref().take(length as u64).read_to_end(&mut self.message)?;
        Ok(received == length)
    }

    /// The message that was received last, or what is wrong with it.
    pub fn message<'a, M: Deserialize<'a>>(&'a self) -> io::Result<M> {
        match postcard::take_from_bytes(&self.message) {
            Ok((message, [])) => Ok(message),
            Ok(_) => Err(io::Error::other("a message that is longer than it should be")),
            Err(error) => Err(io::Error::other(format!("a message that cannot be read ({error})"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_arrives() {
        let (here, there) = UnixStream::pair().unwrap();
        let (mut sender, mut receiver) = (Sender::new(here), Receiver::new(there));
        let values =
            [0.1, -0.0, f64::INFINITY, f64::from_bits(0x7ff0_0000_dead_beef), f64::MIN_POSITIVE / 8.0];
        let (mut references, mut bytes) = (Vec::new(), Vec::new());
        pack(&[7_u32, u32::MAX], &mut references);
        pack(&values, &mut bytes);
        let request = Request::Set { kind: Type::Real, references: &references, values: &bytes };
        sender.send(&request).unwrap();
        assert!(receiver.receive().unwrap());
        let Request::Set { references, values: bytes, .. } = receiver.message().unwrap() else { panic!() };
        assert_eq!(unpack_all::<u32>(references).unwrap(), [7, u32::MAX]);
        let mut found = [0.0; 5];
        assert!(unpack(bytes, &mut found));
        assert_eq!(found.map(f64::to_bits), values.map(f64::to_bits));
        assert!(!unpack(bytes, &mut [0.0; 4]));
        drop(sender);
        assert!(!receiver.receive().unwrap());
    }

    #[test]
    fn nonsense_is_an_error_and_not_memory() {
        let (mut here, there) = UnixStream::pair().unwrap();
        let mut receiver = Receiver::new(there);
        here.write_all(&u32::MAX.to_le_bytes()).unwrap();
        assert!(receiver.receive().unwrap_err().to_string().contains("4294967295 bytes"));
        here.write_all(&[3, 0, 0, 0, 250, 1, 2]).unwrap();
        assert!(receiver.receive().unwrap());
        assert!(receiver.message::<Reply<'_>>().is_err());
        // A promise of a gigabyte that is not kept costs what was sent.
        here.write_all(&(1_u32 << 30).to_le_bytes()).unwrap();
        drop(here);
        assert!(!receiver.receive().unwrap());
        assert!(receiver.message.capacity() < 1 << 20);
    }
}

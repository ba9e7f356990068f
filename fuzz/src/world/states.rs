//! FMU states: own ones, those of other instances and other FMUs, NULL, and bytes in every kind of disrepair.

use super::{SLOTS, World};
use crate::verdict::Verdict;
use bess_consensus::fmi::bindings::*;
use bess_consensus::fmi::{Function, State};
use std::ptr::{null, null_mut};

/// What was saved: where in its life the instance was, unknown for forged contents, and what it was.
#[derive(Clone, Debug, Default)]
struct Saved {
    export: usize,
    life: Option<State>,
    ramped: bool,
    bytes: Vec<u8>,
}

/// A place for an `fmi2FMUstate`.
pub struct Slot {
    state: fmi2FMUstate,
    saved: Saved,
}

impl Default for Slot {
    fn default() -> Self {
        Self { state: null_mut(), saved: Saved::default() }
    }
}

/// Serialised states.
pub struct Blob(Saved);

/// Length of the header: magic 8, version 4, GUID 16, payload length 8, checksum 8.
const HEADER: usize = 44;

/// Puts the right length and checksum (FNV-1a, 64 bits) into a header, so that the contents are looked at.
fn seal(bytes: &mut [u8]) {
    let Some((header, body)) = bytes.split_at_mut_checked(HEADER) else { return };
    header[28..36].copy_from_slice(&(body.len() as u64).to_le_bytes());
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    let sum = header[..36].iter().chain(&*body).fold(0xcbf2_9ce4_8422_2325, step);
    header[36..44].copy_from_slice(&sum.to_le_bytes());
}

impl World<'_> {
    /// The serialised state of instance `k`, by the four functions that a master would use.
    pub(super) fn bytes(&self, k: usize) -> Vec<u8> {
        let Some(live) = &self.live[k] else { return Vec::new() };
        let functions = &self.subject.functions;
        let mut state = null_mut();
        // SAFETY: a living component, places for the results, and a state that is freed once.
        unsafe {
            let status = (functions.get_fmu_state)(live.c, &raw mut state);
            assert_eq!(status, fmi2Status_fmi2OK, "{:?}", live.log.take());
            let bytes = self.serialized(live.c, state);
            assert_eq!((functions.free_fmu_state)(live.c, &raw mut state), fmi2Status_fmi2OK);
            assert!(state.is_null());
            bytes
        }
    }

    /// # Safety
    /// `c` is a living component, `state` a living state of the same FMU.
    unsafe fn serialized(&self, c: fmi2Component, state: fmi2FMUstate) -> Vec<u8> {
        let functions = &self.subject.functions;
        let mut size = 0;
        // SAFETY: as promised, and an array of the size that the FMU asks for.
        unsafe {
            let status = (functions.serialized_fmu_state_size)(c, state, &raw mut size);
            assert_eq!(status, fmi2Status_fmi2OK, "size of a state");
            let mut bytes = vec![0_u8; size];
            let status = (functions.serialize_fmu_state)(c, state, bytes.as_mut_ptr().cast(), size);
            assert_eq!(status, fmi2Status_fmi2OK, "bytes of a state");
            bytes
        }
    }

    /// What is saved when instance `k` is saved now.
    fn save(&self, k: usize) -> Saved {
        let Some(live) = &self.live[k] else { return Saved::default() };
        Saved {
            export: live.export,
            life: live.state,
            ramped: live.ramped,
            bytes: live.known.clone().unwrap_or_else(|| self.bytes(k)),
        }
    }

    pub(super) fn get_state(&mut self, k: usize) {
        let slot = self.choices.below(SLOTS);
        let given = !self.choices.once_in(24);
        let verdict = match given {
            true => Verdict::Accept,
            false => Verdict::refuse(["argument FMUstate is NULL", "expected"]),
        };
        let mut state = self.slots[slot].state;
        let accepted = self.check(k, Function::GetFmuState, verdict, |functions, c| {
            // SAFETY: NULL, or a place that holds NULL or a living state of this FMU.
            unsafe { (functions.get_fmu_state)(c, if given { &raw mut state } else { null_mut() }) }
        });
        if accepted {
            assert!(!state.is_null());
            let saved = self.save(k);
            self.slots[slot] = Slot { state, saved };
        }
    }

    pub(super) fn set_state(&mut self, k: usize) {
        if !self.foreign.is_null() && self.choices.once_in(24) {
            return self.set_foreign(k);
        }
        let slot = self.choices.below(SLOTS);
        let (state, saved) = (self.slots[slot].state, self.slots[slot].saved.clone());
        let guid = |export: usize| self.subject.exports[export].guid.as_str();
        let own = self.live[k].as_ref().is_some_and(|live| live.export == saved.export);
        let verdict = if state.is_null() {
            Verdict::refuse(["argument FMUstate is NULL", "expected"])
        } else if guid(saved.export) != self.export(k).guid {
            Verdict::refuse(["belongs to", guid(saved.export), "expected", &self.export(k).guid])
        } else if saved.life.is_none() || !own {
            // Equal variables, but perhaps another network behind them.
            Verdict::Either
        } else {
            Verdict::Accept
        };
        let accepted = self.check(k, Function::SetFmuState, verdict, |functions, c| {
            // SAFETY: NULL, or a living state of this FMU.
            unsafe { (functions.set_fmu_state)(c, state) }
        });
        if !accepted {
            return;
        }
        if let Some(live) = &mut self.live[k] {
            (live.state, live.ramped) = (saved.life.filter(|_| own), saved.ramped);
        }
        if saved.life.is_some() && own {
            assert!(self.bytes(k) == saved.bytes, "{}: a state came back changed", self.subject.name);
        }
    }

    /// A living state of another FMU: to be refused, not read as one's own.
    fn set_foreign(&mut self, k: usize) {
        let verdict = || Verdict::refuse(["FMUstate", "another FMU", "expected"]);
        let mut state = self.foreign;
        self.check(k, Function::SetFmuState, verdict(), |functions, c| {
            // SAFETY: a living state of an FMU of this library's make.
            unsafe { (functions.set_fmu_state)(c, state) }
        });
        self.check(k, Function::GetFmuState, verdict(), |functions, c| {
            // SAFETY: as above.
            unsafe { (functions.get_fmu_state)(c, &raw mut state) }
        });
        self.check(k, Function::FreeFmuState, verdict(), |functions, c| {
            // SAFETY: as above.
            unsafe { (functions.free_fmu_state)(c, &raw mut state) }
        });
        assert_eq!(state, self.foreign, "a refused call keeps its hands off the state of another FMU");
    }

    pub(super) fn free_state(&mut self, k: usize) {
        let slot = self.choices.below(SLOTS);
        if self.choices.once_in(8) {
            self.check(k, Function::FreeFmuState, Verdict::Accept, |functions, c| {
                // SAFETY: NULL is allowed.
                unsafe { (functions.free_fmu_state)(c, null_mut()) }
            });
        }
        self.free_slot(k, slot);
    }

    pub(super) fn free_slot(&mut self, k: usize, slot: usize) {
        let mut state = self.slots[slot].state;
        let accepted = self.check(k, Function::FreeFmuState, Verdict::Accept, |functions, c| {
            // SAFETY: a place that holds NULL or a living state, of which there is no other copy.
            unsafe { (functions.free_fmu_state)(c, &raw mut state) }
        });
        if accepted {
            assert!(state.is_null());
            self.slots[slot] = Slot::default();
        }
    }

    pub(super) fn state_size(&mut self, k: usize) {
        let slot = &self.slots[self.choices.below(SLOTS)];
        let (state, known) = (slot.state, slot.saved.bytes.len());
        let given = !self.choices.once_in(16);
        let mut size = 7;
        let verdict = match (state.is_null(), given) {
            (true, _) => Verdict::refuse(["argument FMUstate is NULL", "expected"]),
            (false, false) => Verdict::refuse(["argument size is NULL", "expected"]),
            _ => Verdict::Accept,
        };
        let accepted = self.check(k, Function::SerializedFmuStateSize, verdict, |functions, c| {
            // SAFETY: NULL or a living state, NULL or a place for the result.
            unsafe {
                let place = if given { &raw mut size } else { null_mut() };
                (functions.serialized_fmu_state_size)(c, state, place)
            }
        });
        assert_eq!(size, if accepted { known } else { 7 });
    }

    pub(super) fn serialize(&mut self, k: usize) {
        let slot = self.choices.below(SLOTS);
        let (state, saved) = (self.slots[slot].state, self.slots[slot].saved.clone());
        let needed = saved.bytes.len();
        let (room, given) = match self.choices.below(16) {
            0 => (0, false),
            1 => (needed, false),
            2 => (needed.saturating_sub(1 + self.choices.below(needed)), true),
            3 => (needed + self.choices.below(100), true),
            _ => (needed, true),
        };
        let mut bytes = vec![0xa5_u8; room];
        let verdict = if state.is_null() {
            Verdict::refuse(["argument FMUstate is NULL", "expected"])
        } else if !given && room > 0 {
            Verdict::refuse(["argument serializedState is NULL", "expected"])
        } else if room < needed {
            Verdict::refuse([&format!("room for {room} bytes"), &format!("expected at least {needed}")])
        } else {
            Verdict::Accept
        };
        let accepted = self.check(k, Function::SerializeFmuState, verdict, |functions, c| {
            let place = if given { bytes.as_mut_ptr().cast() } else { null_mut() };
            // SAFETY: NULL or a living state, NULL or an array of that length.
            unsafe { (functions.serialize_fmu_state)(c, state, place, room) }
        });
        if accepted {
            assert!(bytes[..needed] == saved.bytes, "a state does not serialise alike twice");
            assert!(bytes[needed..].iter().all(|&byte| byte == 0xa5));
            if self.blobs.len() == SLOTS {
                self.blobs.remove(0);
            }
            self.blobs.push(Blob(saved));
        } else {
            assert!(bytes.iter().all(|&byte| byte == 0xa5), "a refused call has written");
        }
    }

    pub(super) fn deserialize(&mut self, k: usize) {
        let (mut saved, verdict) = self.damaged(k);
        let slot = self.choices.below(SLOTS);
        let (given, null_bytes) = (!self.choices.once_in(32), self.choices.once_in(32));
        let verdict = match (null_bytes, given) {
            (true, _) if !saved.bytes.is_empty() => {
                Verdict::refuse(["argument serializedState is NULL", "expected"])
            }
            (_, false) => Verdict::refuse(["argument FMUstate is NULL", "expected"]),
            _ => verdict,
        };
        let mut state = self.slots[slot].state;
        let accepted = self.check(k, Function::DeSerializeFmuState, verdict, |functions, c| {
            let (bytes, size) = (saved.bytes.as_ptr(), saved.bytes.len());
            // SAFETY: NULL or an array of that length, NULL or a place that holds NULL or a living state.
            unsafe {
                let place = if given { &raw mut state } else { null_mut() };
                (functions.deserialize_fmu_state)(
                    c,
                    if null_bytes { null() } else { bytes.cast() },
                    size,
                    place,
                )
            }
        });
        let Some(live) = &self.live[k] else { return };
        if accepted {
            // SAFETY: a living component and the state that it has just made.
            let again = unsafe { self.serialized(live.c, state) };
            assert!(saved.life.is_none() || again == saved.bytes, "bytes of a state came back changed");
            saved.bytes = again;
            self.slots[slot] = Slot { state, saved };
        } else {
            assert_eq!(state, self.slots[slot].state, "a refused call has made a state");
        }
    }

    /// A serialised state with something or nothing wrong, and what must come of it.
    fn damaged(&mut self, k: usize) -> (Saved, Verdict) {
        let bad = || Verdict::refuse(["serialized state"]);
        let blob = self.choices.below(SLOTS);
        let Some(Blob(saved)) = self.blobs.get(blob) else {
            let noise = (0..self.choices.below(80)).map(|_| self.choices.any()).collect();
            return (Saved { bytes: noise, ..Saved::default() }, Verdict::refuse(["state"]));
        };
        let mut saved = saved.clone();
        let guid = |export: usize| &self.subject.exports[export].guid;
        let own = self.live[k].as_ref().is_none_or(|live| guid(live.export) == guid(saved.export));
        let length = saved.bytes.len();
        let verdict = match self.choices.below(8) {
            0 => {
                saved.bytes.truncate(self.choices.below(length));
                Verdict::refuse(["serialized state has", "expected"])
            }
            1 => {
                saved.bytes.extend(std::iter::repeat_n(0, 1 + self.choices.below(9)));
                bad()
            }
            2 => {
                let (at, with) = (self.choices.below(length), self.choices.any::<u8>().max(1));
                saved.bytes[at] ^= with;
                Verdict::refuse(["state"])
            }
            3 | 4 => {
                self.forge(&mut saved.bytes);
                saved.life = None;
                Verdict::Either
            }
            _ if !own => Verdict::refuse(["belongs to the FMU with GUID", "expected"]),
            _ => return (saved, Verdict::Accept),
        };
        // Which of two things wrong is told is the callee's choice.
        let verdict = if own { verdict } else { Verdict::refuse(["state"]) };
        (saved, verdict)
    }

    /// Contents that nobody wrote, under a right checksum.
    fn forge(&mut self, bytes: &mut Vec<u8>) {
        if !self.subject.traits.checks_states {
            return;
        }
        for _ in 0..1 + self.choices.below(3) {
            let at = HEADER + self.choices.below(bytes.len() - HEADER);
            match self.choices.below(4) {
                0 => bytes[at] = self.choices.any(),
                1 => bytes[at] ^= 1 << self.choices.below(8),
                2 => {
                    let value = self.choices.of(&[f64::NAN, f64::INFINITY, 1e300, -1e300, 5e-324, -1.0]);
                    for (byte, new) in bytes[at..].iter_mut().zip(value.to_le_bytes()) {
                        *byte = new;
                    }
                }
                _ => {
                    let count = self.choices.below(8);
                    if self.choices.once_in(2) {
                        bytes.drain(at..(at + count).min(bytes.len()));
                    } else {
                        bytes.splice(at..at, std::iter::repeat_n(0xff, count));
                    }
                }
            }
            if bytes.len() <= HEADER {
                break;
            }
        }
        seal(bytes);
    }
}

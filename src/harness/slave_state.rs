//! FMU states of a [`Slave`]: kept inside it under handles, so that no pointer can outlive or leave
//! its instance.

use super::guarded::Guarded;
use super::participant::{CallError, StateHandle};
use super::slave::Slave;
use crate::fmi::bindings::{fmi2Byte, fmi2FMUstate};
use std::ptr;

/// Bytes of a serialised state at most; a library that asks for more has lost count.
const LARGEST_STATE: usize = 1 << 30;

impl Slave {
    fn keep(&mut self, state: fmi2FMUstate) -> StateHandle {
        let handle = self.next_state;
        self.next_state += 1;
        self.states.insert(handle, state);
        StateHandle(handle)
    }

    fn kept(&self, function: &'static str, state: StateHandle) -> Result<fmi2FMUstate, CallError> {
        self.able(
            function,
            self.parts.description.capabilities.can_get_and_set_state,
            "canGetAndSetFMUstate",
        )?;
        self.states.get(&state.0).copied().ok_or_else(|| {
            CallError::new(function, format!("not called: state {} is not kept by this instance", state.0))
        })
    }

    fn able(&self, function: &'static str, can: bool, flag: &str) -> Result<(), CallError> {
        self.alive(function)?;
        let refuse = || CallError::new(function, format!("not called: the FMU does not declare {flag}"));
        if can { Ok(()) } else { Err(refuse()) }
    }

    pub(super) fn save(&mut self) -> Result<StateHandle, CallError> {
        let function = "fmi2GetFMUstate";
        self.able(
            function,
            self.parts.description.capabilities.can_get_and_set_state,
            "canGetAndSetFMUstate",
        )?;
        let mut state: fmi2FMUstate = ptr::null_mut();
        // SAFETY: a living instance, and NULL asks it to allocate.
        let status = unsafe { (self.functions().get_fmu_state)(self.component, &mut state) };
        self.check(function, status)?;
        self.made(function, state)
    }

    /// Keeps a state that the library has made, if it has made one.
    fn made(&mut self, function: &'static str, state: fmi2FMUstate) -> Result<StateHandle, CallError> {
        if state.is_null() {
            return Err(CallError::new(function, "returned fmi2OK, but no state (NULL)"));
        }
        Ok(self.keep(state))
    }

    pub(super) fn restore(&mut self, state: StateHandle) -> Result<(), CallError> {
        let function = "fmi2SetFMUstate";
        let pointer = self.kept(function, state)?;
        // SAFETY: a living instance and a state that it made and that was not freed.
        let status = unsafe { (self.functions().set_fmu_state)(self.component, pointer) };
        self.check(function, status)
    }

    pub(super) fn forget(&mut self, state: StateHandle) {
        if let Some(mut pointer) = self.states.remove(&state.0)
            && self.alive("fmi2FreeFMUstate").is_ok()
        {
            // SAFETY: a state that this instance made, removed from the table, so freed once.
            unsafe { (self.functions().free_fmu_state)(self.component, &mut pointer) };
        }
    }

    pub(super) fn forget_all(&mut self) {
        while let Some((handle, _)) = self.states.first_key_value() {
            self.forget(StateHandle(*handle));
        }
    }

    pub(super) fn serialise(&mut self, state: StateHandle) -> Result<Vec<u8>, CallError> {
        let function = "fmi2SerializeFMUstate";
        self.able(function, self.parts.description.capabilities.can_serialise_state, "canSerializeFMUstate")?;
        let pointer = self.kept(function, state)?;
        let mut size = 0;
        // SAFETY: a living instance and a state of its own.
        let status =
            unsafe { (self.functions().serialized_fmu_state_size)(self.component, pointer, &mut size) };
        self.check("fmi2SerializedFMUstateSize", status)?;
        if size > LARGEST_STATE {
            let reason = format!("asked for {size} bytes; expected at most {LARGEST_STATE}");
            return Err(CallError::new("fmi2SerializedFMUstateSize", reason));
        }
        let mut bytes = vec![0_u8; size];
        let mut room = Guarded::default();
        let buffer = room.lay_out(&bytes).cast::<fmi2Byte>();
        // SAFETY: as above; the buffer has the size that the FMU asked for.
        let status = unsafe { (self.functions().serialize_fmu_state)(self.component, pointer, buffer, size) };
        match room.written() {
            Ok(written) => bytes.copy_from_slice(written),
            Err(found) => return Err(self.trespassed(function, size, found)),
        }
        self.check(function, status)?;
        Ok(bytes)
    }

    pub(super) fn deserialise(&mut self, bytes: &[u8]) -> Result<StateHandle, CallError> {
        let function = "fmi2DeSerializeFMUstate";
        self.able(function, self.parts.description.capabilities.can_serialise_state, "canSerializeFMUstate")?;
        let mut state: fmi2FMUstate = ptr::null_mut();
        // SAFETY: a living instance; the bytes live through the call.
        let status = unsafe {
            let buffer = bytes.as_ptr().cast::<fmi2Byte>();
            (self.functions().deserialize_fmu_state)(self.component, buffer, bytes.len(), &mut state)
        };
        self.check(function, status)?;
        self.made(function, state)
    }
}

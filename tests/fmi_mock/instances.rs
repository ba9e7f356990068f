//! Instances of the mock as an in-process master has them, and their variables by name.
#![allow(dead_code, reason = "each test uses its part")]

use super::fmi_mock::Mock;
use bess_consensus::fmi::{Error, Instance, Interface, Logger};

pub fn mock(n: usize) -> Instance<Mock> {
    Instance::from_model("mock", Mock::with(n), Interface::Structured, Logger::silent()).unwrap()
}

pub fn started(n: usize) -> Instance<Mock> {
    let mut instance = mock(n);
    instance.setup_experiment(0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance
}

pub fn reference(instance: &Instance<Mock>, name: &str) -> u32 {
    instance.registry().reference(name).unwrap_or_else(|| panic!("{name}"))
}

pub fn real(instance: &mut Instance<Mock>, name: &str) -> f64 {
    let mut value = [f64::NAN];
    let reference = reference(instance, name);
    instance.get_real(&[reference], &mut value).unwrap();
    value[0]
}

pub fn integer(instance: &mut Instance<Mock>, name: &str) -> i32 {
    let mut value = [-1];
    let reference = reference(instance, name);
    instance.get_integer(&[reference], &mut value).unwrap();
    value[0]
}

pub fn set(instance: &mut Instance<Mock>, name: &str, value: f64) -> Result<(), Error> {
    let reference = reference(instance, name);
    instance.set_real(&[reference], &[value])
}

pub fn set_fault(instance: &mut Instance<Mock>, fault: i32) {
    let reference = reference(instance, "fault");
    instance.set_integer(&[reference], &[fault]).unwrap();
}

/// Everything that can be observed, down to the bits.
pub fn bytes(instance: &Instance<Mock>) -> Vec<u8> {
    instance.serialize(&instance.snapshot().unwrap()).unwrap()
}

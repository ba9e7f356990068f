//! A step and its gets and sets allocate nothing. In a file of its own, because the allocator is the
//! whole program's.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![allow(clippy::undocumented_unsafe_blocks)]

mod fmi_mock;

use bess_consensus::fmi::{Instance, Interface, Logger};
use fmi_mock::{Mock, STEP_LOGS};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn started(n: usize) -> Instance<Mock> {
    let mut instance =
        Instance::from_model("mock", Mock::with(n), Interface::Structured, Logger::silent()).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance
}

#[test]
fn a_step_with_its_gets_and_sets_allocates_nothing() {
    let mut instance = started(7);
    let registry = instance.registry();
    let inputs: Vec<u32> = (1..=7).collect();
    let outputs: Vec<u32> = (1..=30).collect();
    let integers = [registry.reference("mode").unwrap(), registry.reference("fault").unwrap()];
    let booleans = [registry.reference("enable").unwrap(), registry.reference("settled").unwrap()];
    let mut values = [0.0; 30];
    let before = COUNT.get();
    for k in 0..100 {
        instance.set_real(&inputs, &[f64::from(k); 7]).unwrap();
        // With logging off, a chatty model costs nothing either.
        instance.set_integer(&integers, &[1, STEP_LOGS]).unwrap();
        instance.set_boolean(&booleans[..1], &[true]).unwrap();
        instance.get_real(&outputs, &mut values).unwrap();
        instance.do_step(f64::from(k) * 0.01, 0.01).unwrap();
        instance.get_real(&outputs, &mut values).unwrap();
        instance.get_integer(&integers, &mut [0; 2]).unwrap();
        instance.get_boolean(&booleans, &mut [0_i32; 2]).unwrap();
    }
    assert_eq!(COUNT.get() - before, 0);
    let _counted = std::hint::black_box(Box::new(before));
    assert!(COUNT.get() > before, "the counter counts");
}

#[test]
fn the_same_with_the_arrays_of_fmi_3_allocates_nothing() {
    let mut instance =
        bess_consensus::fmi::three::Instance::from_model("mock", Mock::with(7), Logger::silent()).unwrap();
    instance.enter_initialization_mode(0.0, None).unwrap();
    instance.exit_initialization_mode().unwrap();
    let of = |name: &str| instance.reference(name).unwrap();
    // Some that follow each other, and some that jump.
    let (inputs, together, apart) = ([of("u")], [of("u"), of("x"), of("y")], [of("y"), of("u"), of("total")]);
    let (integers, booleans) = ([of("mode"), of("fault")], [of("enable"), of("settled")]);
    let mut values = [0.0; 21];
    let mut all = |instance: &mut bess_consensus::fmi::three::Instance<Mock>, k: i32| {
        instance.set_float64(&inputs, &[f64::from(k); 7]).unwrap();
        instance.set_int32(&integers, &[1, STEP_LOGS]).unwrap();
        instance.set_boolean(&booleans[..1], &[true]).unwrap();
        instance.get_float64(&together, &mut values).unwrap();
        instance.do_step(f64::from(k) * 0.01, 0.01).unwrap();
        instance.get_float64(&apart, &mut values[..15]).unwrap();
        instance.get_int32(&integers, &mut [0; 2]).unwrap();
        instance.get_boolean(&booleans, &mut [false; 2]).unwrap();
    };
    // The first call that jumps makes room for all.
    all(&mut instance, 0);
    let before = COUNT.get();
    (1..100).for_each(|k| all(&mut instance, k));
    assert_eq!(COUNT.get() - before, 0);
}

#[test]
fn derivatives_allocate_nothing_but_their_own_room_once() {
    let mut instance = started(7);
    let inputs: Vec<u32> = (1..=7).collect();
    let outputs: Vec<u32> = (8..=22).collect();
    let mut rates = [0.0; 15];
    let mut all = |instance: &mut Instance<Mock>, k: i32| {
        instance.set_real_input_derivatives(&inputs, &[1; 7], &[0.1; 7]).unwrap();
        instance.get_directional_derivative(&outputs, &inputs, &[1.0; 7], &mut rates).unwrap();
        instance.get_real_output_derivatives(&outputs, &[1; 15], &mut rates).unwrap();
        instance.do_step(f64::from(k) * 0.01, 0.01).unwrap();
    };
    all(&mut instance, 0);
    let before = COUNT.get();
    (1..100).for_each(|k| all(&mut instance, k));
    // The mock keeps its states of before each ramp: one array a step.
    assert_eq!(COUNT.get() - before, 99);
}

#[cfg(feature = "host")]
#[test]
fn derivatives_of_both_models_allocate_nothing() {
    use bess_consensus::fmi::{Causality, Model, Variability};
    use bess_consensus::models::{Controller, Grid};
    use bess_consensus::scenario::Resolved;
    fn count<M: Model>(model: M) -> usize {
        let mut instance =
            Instance::from_model("real", model, Interface::Structured, Logger::silent()).unwrap();
        instance.enter_initialization_mode().unwrap();
        if let Some(enable) = instance.registry().reference("enable") {
            instance.set_boolean(&[enable], &[true]).unwrap();
        }
        instance.exit_initialization_mode().unwrap();
        let of = |causality| {
            let groups = instance.registry().groups();
            let groups =
                groups.filter(|(_, g)| (g.causality, g.variability) == (causality, Variability::Continuous));
            groups.flat_map(|(first, g)| first..first + g.len() as u32).collect::<Vec<u32>>()
        };
        let (inputs, outputs) = (of(Causality::Input), of(Causality::Output));
        let (orders, seeds) = (vec![1; inputs.len() + outputs.len()], vec![1e-3; inputs.len()]);
        let mut rates = vec![0.0; outputs.len()];
        let mut all = |k: i32| {
            instance.set_real_input_derivatives(&inputs, &orders[..inputs.len()], &seeds).unwrap();
            instance.get_directional_derivative(&outputs, &inputs, &seeds, &mut rates).unwrap();
            instance.get_real_output_derivatives(&outputs, &orders[..outputs.len()], &mut rates).unwrap();
            instance.do_step(f64::from(k) * 0.01, 0.01).unwrap();
        };
        all(0);
        let before = COUNT.get();
        (1..20).for_each(all);
        COUNT.get() - before
    }
    let resolved = Resolved::load("case4", &serde_json::Map::new()).unwrap();
    assert_eq!(count(Controller::new(Controller::resource(&resolved)).unwrap()), 0);
    assert_eq!(count(Grid::new(Grid::resource(&resolved).unwrap()).unwrap()), 0);
}

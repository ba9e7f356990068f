//! A step and its gets and sets allocate nothing. In a file of its own, because the allocator is the
//! whole program's.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![allow(clippy::undocumented_unsafe_blocks)]

mod fmi_mock;

use bess_consensus::fmi::{Instance, Interface, Logger};
use fmi_mock::{Mock, STEP_LOGS};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::Instant;

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

/// Times, to be read by a person: `cargo test --release --test fmi_allocation -- --ignored --nocapture`.
#[test]
#[ignore = "prints times, asserts nothing"]
fn times() {
    let time = |what: &str, repeat: u32, f: &mut dyn FnMut()| {
        f();
        let best = (0..5)
            .map(|_| {
                let start = Instant::now();
                (0..repeat).for_each(|_| f());
                start.elapsed().as_secs_f64() / f64::from(repeat)
            })
            .fold(f64::INFINITY, f64::min);
        println!("{what}: {:.3} us", best * 1e6);
    };
    let mut small = started(15);
    let references: Vec<u32> = (1..=50).collect();
    let mut values = [0.0; 50];
    time("get 50 reals", 100_000, &mut || small.get_real(&references, &mut values).unwrap());
    time("set 15 reals", 100_000, &mut || small.set_real(&references[..15], &values[..15]).unwrap());
    let mut large = started(60_000);
    let references: Vec<u32> = (1..=180_000).collect();
    let mut values = vec![0.0; 180_000];
    time("get 180000 reals", 20, &mut || large.get_real(&references, &mut values).unwrap());
    time("instance of 240008 variables", 5, &mut || drop(started(60_000)));
    let snapshot = large.snapshot().unwrap();
    let bytes = large.serialize(&snapshot).unwrap();
    println!("serialized: {} bytes", bytes.len());
    time("serialize", 5, &mut || drop(large.serialize(&snapshot).unwrap()));
    time("deserialize", 5, &mut || drop(large.deserialize(&bytes).unwrap()));
    let model = Mock::with(60_000);
    time("model description", 2, &mut || {
        drop(bess_consensus::fmi::model_description::write(&model, Interface::Structured).unwrap());
    });
}

#![cfg(feature = "host")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
//! A step of the master allocates nothing: allocations counted, with every kind of observer. What a run costs in time is
//! measured by `cargo xtask bench`.

mod harness_support;

use bess_consensus::harness::*;
use harness_support::{MS, Mock, S};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    // By thread: the test runner has one of its own, which allocates when it likes.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: hands everything on to the system's allocator and only counts.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Case 1 in size: a controller with 85 outputs, a grid with 175, 28 and 35 connections, all values
/// new in every step.
fn case_1() -> (Vec<Box<dyn Participant>>, Vec<Connection>) {
    let noise = |cells: &mut [f64], t: i64, _: i64| {
        let mut bits = (t as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        for cell in cells {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *cell = 0.9 + (bits >> 11) as f64 / (1_u64 << 57) as f64;
        }
    };
    let part = |name: &str, own: &str, other: &str, outputs: usize, inputs: usize| {
        let mock = Mock::new(name, noise);
        let mock = (0..outputs).fold(mock, |mock, k| mock.output(&format!("{own}[{k}]"), Kind::Real, 1.0));
        (0..inputs).fold(mock, |mock, k| mock.input(&format!("{other}[{k}]"), Kind::Real, 1.0)).boxed()
    };
    let participants = vec![part("controller", "c", "g", 85, 35), part("grid", "g", "c", 175, 28)];
    let connections = connect_equal_names(&participants).unwrap();
    assert_eq!(connections.len(), 63);
    (participants, connections)
}

fn allocations(stop_ns: i64, algorithm: Algorithm, make: &dyn Fn() -> Box<dyn Observer>) -> u64 {
    let (mut participants, connections) = case_1();
    let plan = Plan { stop_ns, step_ns: 10 * MS, algorithm, connections, ..Plan::default() };
    let mut observer = make();
    let before = ALLOCATIONS.get();
    run(&mut participants, &plan, observer.as_mut()).unwrap();
    ALLOCATIONS.get() - before
}

#[test]
fn a_step_allocates_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let observers: [&dyn Fn() -> Box<dyn Observer>; 3] =
        [&|| Box::new(Silent), &|| Box::new(Memory::new(1, |column| column.participant == "grid")), &|| {
            Box::new(Recorder::new(folder.path(), 1))
        }];
    for (number, observer) in observers.into_iter().enumerate() {
        for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel] {
            let (few, many) = (allocations(S, algorithm, observer), allocations(30 * S, algorithm, observer));
            // 2,900 steps more. The recorder may meet its first waits for its thread at different places.
            let spare = if number == 2 { 60 } else { 0 };
            assert!(many <= few + spare, "observer {number}, {algorithm:?}: {few} then {many}");
        }
    }
}

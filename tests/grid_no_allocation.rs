//! A step allocates nothing, with either network method, load steps and tie switching included.
#![cfg(feature = "grid")]
#![allow(
    non_snake_case,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests: the paper's letters; a failure may panic"
)]

use bess_consensus::grid::{Case, Config, GridModel, LoadModel, NetworkMethod, PowerFlowSolver, Start};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: hands everything to the system's allocator; counting touches a const-initialised cell only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(ptr, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_step_allocates_nothing() {
    for network in [NetworkMethod::Kron, NetworkMethod::Sparse] {
        for load_model in [LoadModel::Impedance, LoadModel::ConstantPower] {
            let config = Config { network, load_model, ..Config::case57() };
            let mut model = GridModel::new(&config).unwrap();
            model.initialise().unwrap();
            let mut counted = [0; 3];
            for k in 0..60i64 {
                if k == 20 {
                    (model.inputs_mut().dP_load[11], model.inputs_mut().dQ_load[11]) = (-0.5, -0.5);
                }
                if k == 40 {
                    model.inputs_mut().tie_closed = true;
                }
                let before = COUNT.with(Cell::get);
                model.step(k * 10_000_000, 10_000_000).unwrap();
                model.refresh().unwrap();
                let _ = model.bus_V(5) + model.tie_P() + model.V(0);
                counted[(k / 20) as usize] += COUNT.with(Cell::get) - before;
            }
            println!("{network:?}, {load_model:?}: {counted:?} allocations in 20 steps each");
            assert_eq!(counted, [0; 3], "{network:?}, {load_model:?}");
        }
    }
}

#[test]
fn a_warm_power_flow_allocates_nothing() {
    let mut solver = PowerFlowSolver::new(&Case::built_in("case57").unwrap(), Start::Flat).unwrap();
    let mut counted = Vec::new();
    for k in 0..10 {
        solver.set_load(20, 0.05 + 0.01 * f64::from(k), 0.02).unwrap();
        let before = COUNT.with(Cell::get);
        assert!(solver.solve().unwrap().iterations > 0);
        counted.push(COUNT.with(Cell::get) - before);
    }
    assert_eq!(counted, [0; 10]);
}

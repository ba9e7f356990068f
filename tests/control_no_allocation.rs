//! A step allocates nothing, whatever is switched on. This file has a counting allocator, hence its own
//! process.
#![cfg(feature = "controller")]
#![allow(non_snake_case, clippy::unwrap_used, clippy::panic)]

mod control_support;

use bess_consensus::control::Config;
use bess_consensus::control::config::{Channel, Law, Limits, MeasurementFilter, SocLimits, VoltagePolicy};
use bess_consensus::control::told::{MessageFault, MessageFaultKind};
use control_support::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

fn count() {
    // Without effect while a thread ends.
    let _ = COUNT.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call is handed on to the system's allocator unchanged; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(mut work: impl FnMut()) -> usize {
    let before = COUNT.get();
    work();
    COUNT.get() - before
}

type Change = fn(&mut Config);

#[test]
fn no_step_allocates() {
    let n = 12;
    let cases: [(&str, Change); 8] = [
        ("plain", |_| {}),
        ("outliers and wrong messages", |c| {
            let kind = MessageFaultKind::Freeze;
            c.message_faults =
                vec![MessageFault { agent: 2, told: None, kind, from_s: 1.0, until_s: Some(5.0) }];
            (c.outlier_filter, c.silence_s) = (1, Some(1.0));
        }),
        ("delayed", |c| c.delay_s = 0.5),
        ("lossy", |c| c.channel = Channel { jitter_s: 0.1, loss: 0.2, seed: 1 }),
        ("filtered", |c| {
            c.measurement_filter = MeasurementFilter { P_s: 0.1, V_s: 0.2, ..Default::default() }
        }),
        ("average voltage, fixed time", |c| {
            c.voltage_policy = VoltagePolicy::Average;
            c.law = Law::FixedTime { alpha: 1.0, beta: 1.0 };
        }),
        ("average voltage, delayed and lossy", |c| {
            c.voltage_policy = VoltagePolicy::Average;
            c.delay_s = 0.5;
            c.channel = Channel { jitter_s: 0.1, loss: 0.2, seed: 1 };
        }),
        ("limited", |c| {
            let all = |x: f64| Some(vec![x; 12]);
            c.limits = Limits {
                P_max: all(1.2),
                Q_max: all(0.5),
                S_max: all(1.3),
                omega_set_rate: all(0.01),
                P_set_rate: all(0.1),
                SoC: Some(SocLimits { min: 0.1, max: 0.9, taper: 0.1 }),
                ..Default::default()
            };
            c.lost_link_fade_s = Some(1.0);
            c.exchange_fade_s = 0.2;
            c.no_circulation = true;
        }),
    ];
    assert!(allocations(|| drop(std::hint::black_box(vec![1.0; 3]))) == 2, "the allocator counts");
    for (name, change) in cases {
        let mut random = Random(9);
        let (edges, pins) = random_graph(&mut random, n);
        let mut config = Config::unit(n, explicit(edges, pins));
        change(&mut config);
        let mut controller = enabled(config);
        controller.inputs_mut().available[3] = false;
        controller.refresh(&mut |_| {});
        for mut controller in [controller.clone(), controller] {
            for k in 0..3000 {
                let inputs = controller.inputs_mut();
                for i in 0..n {
                    inputs.P[i] = 1.0 + random.within(-0.5, 0.5);
                    inputs.Q[i] = random.within(0.0, 1.0);
                    inputs.E[i] = random.within(0.0, 1.0);
                }
                inputs.enable = k % 100 != 50;
                let in_step = allocations(|| {
                    controller.refresh(&mut |_| {});
                    controller.step(k * 10_000_000, 10_000_000, &mut |_| {});
                });
                assert_eq!(in_step, 0, "{name}, step {k}");
            }
        }
    }
}

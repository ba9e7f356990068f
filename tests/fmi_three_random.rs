//! Random calls of FMI 3.0's symbols over a mock, valid and wrong ones: a call that is not OK writes one line that begins
//! with its name, leaves the state as it was to the bit and the importer's arrays untouched; one that is OK writes no error.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail")]
#![allow(clippy::undocumented_unsafe_blocks, clippy::multiple_unsafe_ops_per_block)]

#[path = "fmi_mock/component3.rs"]
mod component3;
mod fmi_mock;
#[path = "fmi_mock/importer3.rs"]
mod importer3;

use bess_consensus::fmi::three::bindings::*;
use component3::*;
use fmi_mock::BIAS_FAILS;
use importer3::*;
use std::ptr::null_mut;

/// Marsaglia's xorshift64: the same calls on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, bound: u64) -> u64 {
        (self.next() >> 11) % bound
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len() as u64) as usize]
    }

    /// Mostly true.
    fn mostly(&mut self) -> bool {
        self.below(12) != 0
    }
}

/// What the importer keeps between calls.
struct World {
    fmu: Fmu,
    random: Random,
    states: [fmi3FMUState; 2],
    bytes: Vec<u8>,
    time: f64,
}

const REALS: [f64; 8] = [0.0, 1.0, -1.0, 2.5, 1e-3, f64::NAN, f64::INFINITY, BIAS_FAILS];
/// Elements of the variables as they are at most: whoever asks for more than that gets a refusal, not memory.
const ROOM: usize = 64;

impl World {
    fn references(&mut self) -> Vec<u32> {
        (0..self.random.below(4)).map(|_| self.random.below(19) as u32).collect()
    }

    /// As many elements as a caller would have who knows the sizes; sometimes another number.
    fn count(&mut self, references: &[u32]) -> usize {
        let length = |name: &str| {
            let (vr, mut value) = (reference(name), 0);
            let status = unsafe { fmi3GetUInt64(self.fmu.c, &raw const vr, 1, &raw mut value, 1) };
            if status == OK { value as usize } else { 1 }
        };
        let (n, m) = (length("n"), length("m"));
        self.fmu.lines();
        let of_n = ["u", "x", "y", "x_start"].map(reference);
        let of_m = ["bias", "whose"].map(reference);
        let one = |vr: &u32| match vr {
            vr if of_n.contains(vr) => n,
            vr if of_m.contains(vr) => m,
            _ => 1,
        };
        let exact = references.iter().map(one).sum::<usize>();
        if self.random.mostly() { exact.min(ROOM) } else { (exact + 1).min(ROOM) }
    }

    /// One call: its name and status, and whether an array of the importer has been touched.
    fn call(&mut self) -> (&'static str, fmi3Status, bool) {
        let c = self.fmu.c;
        let (references, choice) = (self.references(), self.random.below(24));
        let count = self.count(&references);
        let u = reference("u");
        let seeds = vec![1.0; self.count(&[u])];
        let (vr, n) = (references.as_ptr(), references.len());
        let vr = if self.random.mostly() { vr } else { std::ptr::null() };
        let reals: Vec<f64> = (0..count)
            .map(
                |_| if self.random.mostly() { self.random.below(9) as f64 } else { self.random.pick(&REALS) },
            )
            .collect();
        let numbers: Vec<u64> = (0..count).map(|_| self.random.below(6)).collect();
        // Faults that are no panics: after one there is nothing left to call.
        let integers: Vec<i32> = numbers.iter().map(|value| [0, 2, 2, 4, 5, 6][*value as usize]).collect();
        let truths: Vec<u8> = numbers.iter().map(|value| *value as u8).collect();
        let (mut read, mut whole, mut counted) = (vec![-77.0; count], vec![-77; count], vec![77; count]);
        let slot = self.random.below(2) as usize;
        let (mut size, mut flags, mut end) = (7, [true; 3], -77.0);
        unsafe {
            let (name, status) = match choice {
                0 | 1 => ("fmi3SetFloat64", fmi3SetFloat64(c, vr, n, reals.as_ptr(), count)),
                2 | 3 => ("fmi3GetFloat64", fmi3GetFloat64(c, vr, n, read.as_mut_ptr(), count)),
                4 => ("fmi3SetInt32", fmi3SetInt32(c, vr, n, integers.as_ptr(), count)),
                5 => ("fmi3GetInt32", fmi3GetInt32(c, vr, n, whole.as_mut_ptr(), count)),
                6 => ("fmi3SetBoolean", fmi3SetBoolean(c, vr, n, truths.as_ptr(), count)),
                7 | 8 => ("fmi3SetUInt64", fmi3SetUInt64(c, vr, n, numbers.as_ptr(), count)),
                9 => ("fmi3GetUInt64", fmi3GetUInt64(c, vr, n, counted.as_mut_ptr(), count)),
                10 => {
                    let sizes = ["n", "m"].map(reference);
                    let values = [self.random.pick(&[1, 2, 3, 1 << 60]), self.random.below(4)];
                    ("fmi3SetUInt64", fmi3SetUInt64(c, sizes.as_ptr(), 2, values.as_ptr(), 2))
                }
                11 => ("fmi3EnterConfigurationMode", fmi3EnterConfigurationMode(c)),
                12 => ("fmi3ExitConfigurationMode", fmi3ExitConfigurationMode(c)),
                13 => {
                    self.time = self.random.pick(&[0.0, 0.0, -1.0, f64::NAN]);
                    let status = fmi3EnterInitializationMode(c, false, 0.0, self.time, false, 0.0);
                    ("fmi3EnterInitializationMode", status)
                }
                14 => ("fmi3ExitInitializationMode", fmi3ExitInitializationMode(c)),
                15 | 16 => {
                    let at = if self.random.mostly() { self.time } else { 3.0 };
                    let [a, b, d] = &mut flags;
                    let status = fmi3DoStep(
                        c,
                        at,
                        self.random.pick(&[0.125, 0.5, 0.0, -1.0]),
                        true,
                        a,
                        b,
                        d,
                        &raw mut end,
                    );
                    if status == OK {
                        self.time = end;
                    }
                    ("fmi3DoStep", status)
                }
                17 => (
                    "fmi3Terminate",
                    if self.random.mostly() { return ("", OK, false) } else { fmi3Terminate(c) },
                ),
                18 => ("fmi3Reset", fmi3Reset(c)),
                19 => ("fmi3GetFMUState", fmi3GetFMUState(c, &raw mut self.states[slot])),
                20 => {
                    let status = fmi3SetFMUState(c, self.states[slot]);
                    let (time, mut now) = (reference("time"), [self.time]);
                    if fmi3GetFloat64(c, &raw const time, 1, now.as_mut_ptr(), 1) == OK {
                        self.time = now[0];
                    } else {
                        self.fmu.record.lines.borrow_mut().pop();
                    }
                    ("fmi3SetFMUState", status)
                }
                21 => {
                    let status = fmi3SerializedFMUStateSize(c, self.states[slot], &raw mut size);
                    if status == OK {
                        self.bytes = vec![0; size];
                        assert_eq!(
                            fmi3SerializeFMUState(c, self.states[slot], self.bytes.as_mut_ptr(), size),
                            OK
                        );
                    }
                    ("fmi3SerializedFMUStateSize", status)
                }
                22 => {
                    if let (false, Some(position)) = (self.random.mostly(), self.bytes.len().checked_sub(1)) {
                        let position = self.random.below(position as u64 + 1) as usize;
                        self.bytes[position] ^= 0x10;
                    }
                    let (bytes, size) = (self.bytes.as_ptr(), self.bytes.len());
                    (
                        "fmi3DeserializeFMUState",
                        fmi3DeserializeFMUState(c, bytes, size, &raw mut self.states[slot]),
                    )
                }
                _ => {
                    let unknowns = ["y", "total"].map(reference);
                    read = vec![-77.0; seeds.len() + 1];
                    let (v, s, ns, r, nr) =
                        (unknowns.as_ptr(), seeds.as_ptr(), seeds.len(), read.as_mut_ptr(), read.len());
                    let status = fmi3GetDirectionalDerivative(c, v, 2, &raw const u, 1, s, ns, r, nr);
                    ("fmi3GetDirectionalDerivative", status)
                }
            };
            let touched = read.iter().any(|value| *value != -77.0)
                || whole.iter().any(|value| *value != -77)
                || counted.iter().any(|value| *value != 77)
                || (end != -77.0 || flags != [true; 3]);
            (name, status, touched)
        }
    }
}

impl Drop for World {
    fn drop(&mut self) {
        for state in &mut self.states {
            assert_eq!(unsafe { fmi3FreeFMUState(self.fmu.c, &raw mut *state) }, OK);
        }
    }
}

#[test]
fn a_refused_call_changes_nothing_whatever_came_before() {
    let mut met = std::collections::BTreeMap::<(&str, fmi3Status), usize>::new();
    for seed in 1..=150_u64 {
        let random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let fmu = Fmu::new();
        let mut world = World { fmu, random, states: [null_mut(); 2], bytes: Vec::new(), time: 0.0 };
        for k in 0..200 {
            let before = world.fmu.state();
            let (name, status, touched) = world.call();
            let lines = world.fmu.lines();
            let here = format!("seed {seed}, call {k}, {name}: {lines:?}");
            *met.entry((name, status)).or_default() += 1;
            match status {
                OK => assert!(lines.iter().all(|line| line.status != ERROR), "{here}"),
                ERROR => {
                    assert!(lines.len() == 1 && lines[0].text.starts_with(&format!("{name}: ")), "{here}");
                    assert!(!touched, "{here}");
                    assert!(world.fmu.state() == before, "{here}");
                }
                other => panic!("status {other}: {here}"),
            }
        }
    }
    // Both answers of each function have been met, but for those that take everything.
    let always = ["fmi3Reset", "fmi3Terminate", "fmi3GetFMUState", ""];
    let names: std::collections::BTreeSet<&str> = met.keys().map(|(name, _)| *name).collect();
    for name in names {
        for status in [OK, ERROR] {
            let expected = status == OK || !always.contains(&name);
            assert!(!expected || met.contains_key(&(name, status)), "{name} has never answered {status}");
        }
    }
}

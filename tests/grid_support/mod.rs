//! What several tests of the grid need: numbers without a library, and grids of any size.
#![allow(dead_code, reason = "each test uses its part")]

use bess_consensus::grid::{Bess, Branch, Bus, Case, CaseSource, Config, Generator};

/// Numbers that are the same on every run: Knuth's linear congruential generator, MMIX.
pub struct Numbers(u64);

impl Numbers {
    /// From a seed.
    pub fn new(seed: u64) -> Self {
        let mut this = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        for _ in 0..4 {
            this.unit();
        }
        this
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [-1, 1).
    pub fn around_zero(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// A whole number below `n`.
    pub fn below(&mut self, n: u32) -> u32 {
        (self.unit() * f64::from(n)) as u32
    }
}

/// A grid of `n` buses: a sparse mesh (each bus tied to one of the ten before it, every third to one
/// more), a load at most buses, a generator with a BESS in its place at every `every`-th. Light enough
/// that its power flow exists.
pub fn mesh(n: usize, every: usize) -> Config {
    let mut numbers = Numbers::new(n as u64);
    let mut case = Case {
        name: format!("mesh{n}"),
        base_mva: 100.0,
        bus: Vec::new(),
        branch: Vec::new(),
        generator: Vec::new(),
    };
    let line = |from: usize, to: usize, numbers: &mut Numbers| Branch {
        from: from as u64 + 1,
        to: to as u64 + 1,
        r: 0.002 + 0.004 * numbers.unit(),
        x: 0.02 + 0.03 * numbers.unit(),
        b: 0.02 * numbers.unit(),
        ratio: if numbers.unit() < 0.1 { 0.95 + 0.1 * numbers.unit() } else { 0.0 },
        shift: 0.0,
        status: 1,
    };
    let mut total = 0.0;
    for k in 0..n {
        let is_source = k % every == 0;
        let pd = if is_source { 0.0 } else { 3.0 * numbers.unit() };
        total += pd;
        let kind = if k == 0 {
            3
        } else if is_source {
            2
        } else {
            1
        };
        case.bus.push(Bus {
            id: k as u64 + 1,
            kind,
            pd,
            qd: 0.3 * pd,
            gs: 0.0,
            bs: 0.0,
            vm: 1.0,
            va: 0.0,
            base_kv: 110.0,
        });
        if k > 0 {
            let back = 1 + numbers.below(10.min(k as u32)) as usize;
            case.branch.push(line(k - back, k, &mut numbers));
            if k % 3 == 0 && k > 1 {
                let back = 1 + numbers.below(10.min(k as u32)) as usize;
                case.branch.push(line(k - back, k, &mut numbers));
            }
        }
    }
    let sources: Vec<usize> = (0..n).step_by(every).collect();
    let share = total / sources.len() as f64;
    let mut bess = Vec::new();
    for (i, &k) in sources.iter().enumerate() {
        let bus = k as u64 + 1;
        case.generator.push(Generator {
            bus,
            pg: share,
            qg: 0.0,
            vg: 1.02,
            qmax: 0.0,
            qmin: 0.0,
            pmax: 0.0,
            pmin: 0.0,
            status: 1,
        });
        bess.push(Bess {
            bus,
            K_P: 0.01,
            K_Q: 0.05,
            X_c: 0.05,
            E_start: 1.0,
            omega_set_start: 1.0 + 1e-4 * ((i % 5) as f64 - 2.0),
            V_set_start: 1.03,
        });
    }
    Config { case: CaseSource::Inline(Box::new(case)), bess, tie: None, ..Config::case57() }
}

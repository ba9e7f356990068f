//! The laws of `discretisation` and `exchange` over many edges side by side, and the loops over arrays that a sweep is
//! made of. Each loop goes over plain slices of one length, because that is what compilers turn into vector code; each
//! element is computed by itself, so that its bits depend on no vector width. Knows neither agents nor graphs.

use super::discretisation::{Flow, SignPower};
use super::exchange::SECONDS_PER_HOUR;
use super::power::power;

/// Values at the lower and at the higher ends of edges.
pub type Ends<'a> = (&'a [f64], &'a [f64]);

/// abs(s(d)) of abs(d). No closure: nothing makes the compiler inline one, and what is not inline is not vector code.
trait Magnitude: Copy {
    fn of(self, m: f64) -> f64;
}

#[derive(Clone, Copy)]
struct Root;
#[derive(Clone, Copy)]
struct Power(f64);
#[derive(Clone, Copy)]
struct Itself;

impl Magnitude for Root {
    #[inline(always)]
    fn of(self, m: f64) -> f64 {
        m.sqrt()
    }
}

impl Magnitude for Power {
    #[inline(always)]
    fn of(self, m: f64) -> f64 {
        power(m, self.0)
    }
}

impl Magnitude for Itself {
    #[inline(always)]
    fn of(self, m: f64) -> f64 {
        m
    }
}

/// The flows along edges with these weights and shares of the cap, as [`Flow::along`], but never of the
/// fixed-time law.
#[inline(always)]
pub fn flows(out: &mut [f64], x: Ends<'_>, weights: &[f64], shares: &[f64], flow: &Flow) {
    let law = (flow.gain, flow.inverse_theta);
    match flow.power {
        SignPower::Root => flows_by(out, x, weights, shares, law, Root),
        SignPower::Power(eta) => flows_by(out, x, weights, shares, law, Power(eta)),
        SignPower::Linear | SignPower::FixedTime { .. } => flows_by(out, x, weights, shares, law, Itself),
    }
}

#[inline(always)]
fn flows_by(
    out: &mut [f64],
    (a, b): Ends<'_>,
    weights: &[f64],
    shares: &[f64],
    (gain, inverse_theta): (f64, f64),
    s: impl Magnitude,
) {
    let n = out.len();
    let (a, b, weights, shares) = (&a[..n], &b[..n], &weights[..n], &shares[..n]);
    for i in 0..n {
        let d = a[i] - b[i];
        let m = d.abs();
        let law = gain * weights[i] * s.of(m);
        let cap = m * shares[i] * inverse_theta;
        out[i] = least(cap, law).copysign(d);
    }
}

/// What the exchange knows of the ends of edges.
#[derive(Clone, Copy)]
pub struct Stores<'a> {
    /// SoC.
    pub soc: Ends<'a>,
    /// C, pu*h.
    pub capacity: Ends<'a>,
    /// 1 + peers.
    pub crowd: Ends<'a>,
    /// P_exchange_max / peers, pu.
    pub limit: Ends<'a>,
}

/// (11): the exchange along edges with these weights, pu, negative from the fuller lower end, and its magnitude
/// before the limits. `law` has 3600 g_E and theta_E in place of 1 / theta.
#[inline(always)]
pub fn exchange(out: &mut [f64], wanted: &mut [f64], of: Stores<'_>, weights: &[f64], law: &Flow) {
    flows_wanted(wanted, of, weights, law);
    let n = out.len();
    let (soc, limit) = (of.soc, of.limit);
    let (soc_a, soc_b, limit_a, limit_b) = (&soc.0[..n], &soc.1[..n], &limit.0[..n], &limit.1[..n]);
    let wanted = &wanted[..n];
    for i in 0..n {
        let most = least(limit_b[i], limit_a[i]);
        out[i] = -least(most, wanted[i]).copysign(soc_a[i] - soc_b[i]);
    }
}

#[inline(always)]
fn flows_wanted(wanted: &mut [f64], of: Stores<'_>, weights: &[f64], law: &Flow) {
    match law.power {
        SignPower::Root => wanted_by(wanted, of, weights, law, Root),
        SignPower::Power(eta) => wanted_by(wanted, of, weights, law, Power(eta)),
        SignPower::Linear | SignPower::FixedTime { .. } => wanted_by(wanted, of, weights, law, Itself),
    }
}

#[inline(always)]
fn wanted_by(wanted: &mut [f64], of: Stores<'_>, weights: &[f64], law: &Flow, s: impl Magnitude) {
    let n = wanted.len();
    let (gain, theta_E_s) = (law.gain, law.inverse_theta);
    let Stores { soc: (soc_a, soc_b), capacity: (C_a, C_b), crowd: (crowd_a, crowd_b), .. } = of;
    let (soc_a, soc_b, weights) = (&soc_a[..n], &soc_b[..n], &weights[..n]);
    let (C_a, C_b, crowd_a, crowd_b) = (&C_a[..n], &C_b[..n], &crowd_a[..n], &crowd_b[..n]);
    for i in 0..n {
        let m = (soc_a[i] - soc_b[i]).abs();
        let law = gain * weights[i] * s.of(m);
        let cap =
            SECONDS_PER_HOUR * least(C_b[i], C_a[i]) * m / (theta_E_s * greatest(crowd_b[i], crowd_a[i]));
        wanted[i] = least(cap, law);
    }
}

/// The smaller of two numbers in the one comparison that processors have: `y` where `x` is not a number.
#[inline(always)]
fn least(x: f64, y: f64) -> f64 {
    if x < y { x } else { y }
}

#[inline(always)]
fn greatest(x: f64, y: f64) -> f64 {
    if x > y { x } else { y }
}

/// out = min(a, b)
#[inline(always)]
pub fn smaller(out: &mut [f64], (a, b): Ends<'_>) {
    let n = out.len();
    let (a, b) = (&a[..n], &b[..n]);
    for i in 0..n {
        out[i] = least(b[i], a[i]);
    }
}

/// Numbers that are loaded before any is stored, so that nobody has to find out whether two slices overlap.
const LANES: usize = 8;

/// out = of(out, x)
#[inline(always)]
fn update(out: &mut [f64], x: &[f64], of: impl Fn(f64, f64) -> f64) {
    let ((out, out_left), (x, x_left)) = (out.as_chunks_mut::<LANES>(), x.as_chunks::<LANES>());
    for (out, x) in out.iter_mut().zip(x) {
        let (was, x) = (*out, *x);
        let mut now = was;
        for lane in 0..LANES {
            now[lane] = of(was[lane], x[lane]);
        }
        *out = now;
    }
    for (out, &x) in out_left.iter_mut().zip(x_left) {
        *out = of(*out, x);
    }
}

/// sum += x
#[inline(always)]
pub fn add(sum: &mut [f64], x: &[f64]) {
    update(sum, x, |sum, x| sum + x);
}

/// sum -= x
#[inline(always)]
pub fn subtract(sum: &mut [f64], x: &[f64]) {
    update(sum, x, |sum, x| sum - x);
}

/// most = max(most, a, b)
#[inline(always)]
pub fn raise(most: &mut [f64], (a, b): Ends<'_>) {
    let n = most.len();
    let (a, b) = (&a[..n], &b[..n]);
    for i in 0..n {
        most[i] = greatest(b[i], greatest(a[i], most[i]));
    }
}

/// out = K (x - x_set)
#[inline(always)]
pub fn droop(out: &mut [f64], K: &[f64], x: &[f64], x_set: &[f64]) {
    let n = out.len();
    let (K, x, x_set) = (&K[..n], &x[..n], &x_set[..n]);
    for i in 0..n {
        out[i] = K[i] * (x[i] - x_set[i]);
    }
}

/// out = x / y
#[inline(always)]
pub fn quotient(out: &mut [f64], x: &[f64], y: &[f64]) {
    let n = out.len();
    let (x, y) = (&x[..n], &y[..n]);
    for i in 0..n {
        out[i] = x[i] / y[i];
    }
}

/// What the number of peers is looked at for: 1 / (1 + peers), 1 + peers, and most / peers.
#[inline(always)]
pub fn crowd((share, crowd): (&mut [f64], &mut [f64]), limit: &mut [f64], peers: &[u32], most: &[f64]) {
    let n = share.len();
    let (crowd, limit, peers, most) = (&mut crowd[..n], &mut limit[..n], &peers[..n], &most[..n]);
    for i in 0..n {
        let peers = f64::from(peers[i]);
        crowd[i] = 1.0 + peers;
        share[i] = 1.0 / (1.0 + peers);
        limit[i] = most[i] / peers;
    }
}

/// out = x + y
#[inline(always)]
pub fn sum(out: &mut [f64], x: &[f64], y: &[f64]) {
    let n = out.len();
    let (x, y) = (&x[..n], &y[..n]);
    for i in 0..n {
        out[i] = x[i] + y[i];
    }
}

/// out += h u, where `live`.
#[inline(always)]
pub fn advance(out: &mut [f64], h: f64, u: &[f64], live: &[bool]) {
    let n = out.len();
    let (u, live) = (&u[..n], &live[..n]);
    for i in 0..n {
        let moved = out[i] + h * u[i];
        out[i] = if live[i] { moved } else { out[i] };
    }
}

/// out = x, where `live`.
#[inline(always)]
pub fn take(out: &mut [f64], x: &[f64], live: &[bool]) {
    if live.iter().fold(true, |all, live| all & live) {
        out.copy_from_slice(&x[..out.len()]);
        return;
    }
    for (out, (&x, &live)) in out.iter_mut().zip(x.iter().zip(live)) {
        if live {
            *out = x;
        }
    }
}

/// u_E = -P_set / (3600 C), where `live`, else 0.
#[inline(always)]
pub fn energy_rate(out: &mut [f64], P_set: &[f64], capacity: &[f64], live: &[bool]) {
    let n = out.len();
    let (P_set, capacity, live) = (&P_set[..n], &capacity[..n], &live[..n]);
    for i in 0..n {
        let rate = -P_set[i] / (SECONDS_PER_HOUR * capacity[i]);
        out[i] = if live[i] { rate } else { 0.0 };
    }
}

/// Whether x > most.
#[inline(always)]
pub fn exceeds(out: &mut [bool], x: &[f64], most: &[f64]) {
    let n = out.len();
    let (x, most) = (&x[..n], &most[..n]);
    for i in 0..n {
        out[i] = x[i] > most[i];
    }
}

//! Memory that the evaluation of the network needs, made once so that a step allocates nothing.
//! Holds nothing that a result may depend on: every use starts by [`Workspace::restart`] or writes
//! before it reads.

use super::lu::Scratch;
use super::reduction::LANES;
use super::trigonometry::sin_cos;
use faer::c64;

/// Memory for evaluating a network; made by [`super::network::Network::workspace`].
#[derive(Clone)]
pub struct Workspace {
    /// Real and imaginary parts of the sources' voltages, pu; to be filled before an evaluation. Then zeros that
    /// fill up the last eight.
    pub e_re: Vec<f64>,
    /// Imaginary part.
    pub e_im: Vec<f64>,
    /// Real and imaginary parts of the currents that the sources send into the network, pu, as long.
    pub i_re: Vec<f64>,
    /// Imaginary part.
    pub i_im: Vec<f64>,
    /// Instantaneous powers of the sources, pu, as long.
    pub p: Vec<f64>,
    /// Reactive, positive inductive.
    pub q: Vec<f64>,
    /// The sources' angles, rad, with their sines and cosines, as long.
    angle: Vec<f64>,
    sin: Vec<f64>,
    cos: Vec<f64>,
    /// Bus voltages, real and imaginary parts, of the dense method.
    pub(super) bus_re: Vec<f64>,
    pub(super) bus_im: Vec<f64>,
    /// Bus voltages, pu; filled by `voltages`.
    pub v: Vec<c64>,
    /// Voltages at the packed rows of the sparse method, pu.
    pub(super) v_active: Vec<c64>,
    /// Voltages at the loads that are not impedances, pu.
    pub(super) v_load: Vec<c64>,
    /// The same without the currents of those loads.
    pub(super) v_open: Vec<c64>,
    /// Currents of those loads, less what the matrix holds of them, pu.
    pub(super) j_load: Vec<c64>,
    /// The next `v_load`, real and imaginary parts.
    pub(super) v_re: Vec<f64>,
    pub(super) v_im: Vec<f64>,
    /// Whether `v_load` is a guess from the same step.
    pub(super) warm: bool,
    pub(super) scratch: Scratch,
}

impl Workspace {
    pub(super) fn new(n: usize, n_bus: usize, n_load: usize, n_active: usize, scratch: Scratch) -> Self {
        let padded = n.next_multiple_of(LANES);
        Self {
            e_re: vec![0.0; padded],
            e_im: vec![0.0; padded],
            i_re: vec![0.0; padded],
            i_im: vec![0.0; padded],
            p: vec![0.0; padded],
            q: vec![0.0; padded],
            angle: vec![0.0; padded],
            sin: vec![0.0; padded],
            cos: vec![0.0; padded],
            bus_re: vec![0.0; n_bus],
            bus_im: vec![0.0; n_bus],
            v: vec![c64::ZERO; n_bus],
            v_active: vec![c64::ZERO; n_active],
            v_load: vec![c64::ZERO; n_load],
            v_open: vec![c64::ZERO; n_load],
            j_load: vec![c64::ZERO; n_load],
            v_re: vec![0.0; n_load],
            v_im: vec![0.0; n_load],
            warm: false,
            scratch,
        }
    }

    /// Forgets the guesses of earlier evaluations, so that results depend on the state alone.
    pub fn restart(&mut self) {
        self.warm = false;
    }

    /// Sets the voltages of all sources: magnitudes `V`, pu, angles `delta`, rad.
    #[inline(always)]
    pub fn set_sources(&mut self, V: impl Iterator<Item = f64>, delta: &[f64]) {
        for (angle, delta) in self.angle.iter_mut().zip(delta) {
            *angle = *delta;
        }
        sin_cos(&self.angle, &mut self.sin, &mut self.cos);
        let directions = self.cos.iter().zip(&self.sin);
        let voltages = self.e_re.iter_mut().zip(&mut self.e_im);
        for (((re, im), (cos, sin)), V) in voltages.zip(directions).zip(V) {
            *re = V * cos;
            *im = V * sin;
        }
    }

    /// Finds the instantaneous powers p and q of the sources, pu, q positive inductive.
    #[inline(always)]
    pub fn find_powers(&mut self) {
        fn lanes(values: &[f64]) -> impl Iterator<Item = &[f64; LANES]> {
            values.as_chunks().0.iter()
        }
        let voltages = lanes(&self.e_re).zip(lanes(&self.e_im));
        let currents = lanes(&self.i_re).zip(lanes(&self.i_im));
        let powers = self.p.as_chunks_mut::<LANES>().0.iter_mut().zip(self.q.as_chunks_mut::<LANES>().0);
        for ((p, q), ((er, ei), (ir, ii))) in powers.zip(voltages.zip(currents)) {
            for lane in 0..LANES {
                p[lane] = er[lane] * ir[lane] + ei[lane] * ii[lane];
                q[lane] = ei[lane] * ir[lane] - er[lane] * ii[lane];
            }
        }
    }
}

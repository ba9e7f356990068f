//! Memory that the evaluation of the network needs, made once so that a step allocates nothing.
//! Holds nothing that a result may depend on: every use starts by [`Workspace::restart`] or writes
//! before it reads.

use super::lu::Scratch;
use faer::c64;

/// Memory for evaluating a network; made by [`super::network::Network::workspace`].
#[derive(Clone)]
pub struct Workspace {
    /// Real and imaginary parts of the sources' voltages, pu; to be filled before an evaluation.
    pub e_re: Vec<f64>,
    /// Imaginary part.
    pub e_im: Vec<f64>,
    /// Real and imaginary parts of the currents that the sources send into the network, pu.
    pub i_re: Vec<f64>,
    /// Imaginary part.
    pub i_im: Vec<f64>,
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
        Self {
            e_re: vec![0.0; n],
            e_im: vec![0.0; n],
            i_re: vec![0.0; n],
            i_im: vec![0.0; n],
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

    /// Sets the voltage of source `i`: magnitude `V`, pu, angle `delta`, rad.
    #[inline]
    pub fn set_source(&mut self, i: usize, V: f64, delta: f64) {
        let (sin, cos) = delta.sin_cos();
        self.e_re[i] = V * cos;
        self.e_im[i] = V * sin;
    }

    /// Instantaneous power (p, q) of source `i`, pu, q positive inductive.
    #[inline]
    pub fn power(&self, i: usize) -> (f64, f64) {
        let (er, ei, ir, ii) = (self.e_re[i], self.e_im[i], self.i_re[i], self.i_im[i]);
        (er * ir + ei * ii, ei * ir - er * ii)
    }
}

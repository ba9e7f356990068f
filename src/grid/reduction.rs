//! The Kron-reduced network: one dense matrix from the sources' voltages to their currents, for small
//! grids. Never factors anything; the network hands it its LU.

use super::error::GridError;
use super::lu::{Lu, Scratch};
use super::plant::Plant;
use super::workspace::Workspace;
use faer::c64;

/// Sources whose currents are found side by side, as vector code wants it however few there are.
pub(super) const LANES: usize = 8;
type Lanes = [f64; LANES];

/// Dense matrices between sources, buses and loads that are not impedances. All column after column.
#[derive(Clone)]
pub struct Reduction {
    n: usize,
    n_bus: usize,
    /// n x n: source currents from source voltages, real and imaginary parts; the columns of the first [`LANES`]
    /// rows, then those of the next. Zero in rows beyond the last.
    g: Vec<Lanes>,
    b: Vec<Lanes>,
    /// Source currents from the main grid, real and imaginary parts.
    tie_re: Vec<Lanes>,
    tie_im: Vec<Lanes>,
    /// n_bus x (n + 1): bus voltages from the sources, the main grid last.
    transfer: Vec<c64>,
    /// The same, real and imaginary parts apart.
    transfer_re: Vec<f64>,
    transfer_im: Vec<f64>,
    /// n_bus x n_load: bus voltages from currents at the loads that are not impedances.
    z_load: Vec<c64>,
    /// n_load x n_load: the rows of `z_load` at those loads, real and imaginary parts.
    r_load: Vec<f64>,
    x_load: Vec<f64>,
    /// n x n_load: source currents from those currents.
    from_load: Vec<c64>,
    scratch: Scratch,
}

impl Reduction {
    /// Memory for the reduction of a plant.
    pub fn new(plant: &Plant, lu: &Lu) -> Self {
        let (n, n_bus, n_load) = (plant.n(), plant.n_bus(), plant.nonlinear.len());
        Self {
            n,
            n_bus,
            g: vec![[0.0; LANES]; n.div_ceil(LANES) * n],
            b: vec![[0.0; LANES]; n.div_ceil(LANES) * n],
            tie_re: vec![[0.0; LANES]; n.div_ceil(LANES)],
            tie_im: vec![[0.0; LANES]; n.div_ceil(LANES)],
            transfer: vec![c64::ZERO; n_bus * (n + 1)],
            transfer_re: vec![0.0; n_bus * (n + 1)],
            transfer_im: vec![0.0; n_bus * (n + 1)],
            z_load: vec![c64::ZERO; n_bus * n_load],
            r_load: vec![0.0; n_load * n_load],
            x_load: vec![0.0; n_load * n_load],
            from_load: vec![c64::ZERO; n * n_load],
            scratch: lu.scratch(),
        }
    }

    /// Makes the matrices from the factored network; `source` and `tie` are the admittances of the
    /// sources and of the closed tie (zero when open).
    pub fn rebuild(&mut self, plant: &Plant, lu: &Lu, source: &[c64], tie: c64) -> Result<(), GridError> {
        let (n, n_bus) = (self.n, self.n_bus);
        self.transfer.fill(c64::ZERO);
        for s in 0..n {
            self.transfer[s * n_bus + plant.bess_bus[s]] = source[s];
        }
        if let Some((bus, _)) = plant.tie {
            self.transfer[n * n_bus + bus] = tie;
        }
        lu.solve(&mut self.transfer, &mut self.scratch);
        for ((w, re), im) in self.transfer.iter().zip(&mut self.transfer_re).zip(&mut self.transfer_im) {
            (*re, *im) = (w.re, w.im);
        }
        for s in 0..n {
            for i in 0..n {
                let own = if i == s { source[i] } else { c64::ZERO };
                let y = own - source[i] * self.transfer[s * n_bus + plant.bess_bus[i]];
                let (column, lane) = (i / LANES * n + s, i % LANES);
                (self.g[column][lane], self.b[column][lane]) = (y.re, y.im);
            }
        }
        for i in 0..n {
            let y = -source[i] * self.transfer[n * n_bus + plant.bess_bus[i]];
            (self.tie_re[i / LANES][i % LANES], self.tie_im[i / LANES][i % LANES]) = (y.re, y.im);
        }
        if !plant.nonlinear.is_empty() {
            self.z_load.fill(c64::ZERO);
            for (k, load) in plant.nonlinear.iter().enumerate() {
                self.z_load[k * n_bus + load.bus] = c64::ONE;
            }
            lu.solve(&mut self.z_load, &mut self.scratch);
            let m = plant.nonlinear.len();
            for k in 0..m {
                for (l, load) in plant.nonlinear.iter().enumerate() {
                    let z = self.z_load[k * n_bus + load.bus];
                    (self.r_load[k * m + l], self.x_load[k * m + l]) = (z.re, z.im);
                }
                for i in 0..n {
                    self.from_load[k * n + i] = -source[i] * self.z_load[k * n_bus + plant.bess_bus[i]];
                }
            }
        }
        let finite = self.g.iter().chain(&self.b).flatten().all(|x| x.is_finite())
            && self.transfer.iter().chain(&self.z_load).all(|z| z.is_finite());
        if finite { Ok(()) } else { Err(GridError::Singular { what: "the network with its present loads" }) }
    }

    /// Source currents from the source voltages in the workspace.
    #[inline(always)]
    pub fn currents(&self, plant: &Plant, ws: &mut Workspace) -> Result<(), GridError> {
        let n = self.n;
        let (e_re, e_im) = (&ws.e_re[..n], &ws.e_im[..n]);
        let rows = ws.i_re.as_chunks_mut().0.iter_mut().zip(ws.i_im.as_chunks_mut().0);
        let columns = self.g.chunks_exact(n).zip(self.b.chunks_exact(n));
        for (((i_re, i_im), (g, b)), (re, im)) in rows.zip(columns).zip(self.tie_re.iter().zip(&self.tie_im))
        {
            let (mut sum_re, mut sum_im): (Lanes, Lanes) = (*re, *im);
            for s in 0..n {
                let (g, b, er, ei) = (&g[s], &b[s], e_re[s], e_im[s]);
                for lane in 0..LANES {
                    sum_re[lane] += g[lane] * er - b[lane] * ei;
                    sum_im[lane] += g[lane] * ei + b[lane] * er;
                }
            }
            (*i_re, *i_im) = (sum_re, sum_im);
        }
        if !plant.nonlinear.is_empty() {
            self.solve_loads(plant, ws)?;
            for k in 0..plant.nonlinear.len() {
                for i in 0..n {
                    let current = self.from_load[k * n + i] * ws.j_load[k];
                    ws.i_re[i] += current.re;
                    ws.i_im[i] += current.im;
                }
            }
        }
        Ok(())
    }

    /// Bus voltages from the source voltages in the workspace, into `ws.v`.
    #[inline(always)]
    pub fn voltages(&self, plant: &Plant, ws: &mut Workspace) -> Result<(), GridError> {
        self.linear_voltages(ws);
        if !plant.nonlinear.is_empty() {
            self.solve_loads(plant, ws)?;
            for (column, &j) in self.z_load.chunks_exact(self.n_bus).zip(&ws.j_load) {
                for (v, z) in ws.v.iter_mut().zip(column) {
                    *v += z * j;
                }
            }
        }
        Ok(())
    }

    /// The same without the currents of loads that are not impedances.
    #[inline(always)]
    pub fn linear_voltages(&self, ws: &mut Workspace) {
        let n_bus = self.n_bus;
        let (v_re, v_im) = (&mut ws.bus_re[..n_bus], &mut ws.bus_im[..n_bus]);
        v_re.copy_from_slice(&self.transfer_re[self.n * n_bus..]);
        v_im.copy_from_slice(&self.transfer_im[self.n * n_bus..]);
        let columns = self.transfer_re.chunks_exact(n_bus).zip(self.transfer_im.chunks_exact(n_bus));
        for ((w_re, w_im), (&re, &im)) in columns.zip(ws.e_re[..self.n].iter().zip(&ws.e_im)) {
            for b in 0..n_bus {
                v_re[b] += w_re[b] * re - w_im[b] * im;
                v_im[b] += w_re[b] * im + w_im[b] * re;
            }
        }
        for ((v, &re), &im) in ws.v.iter_mut().zip(&*v_re).zip(&*v_im) {
            *v = c64::new(re, im);
        }
    }

    /// Fixed point of the loads' voltages and currents: `v = v_open + Z j(v)`.
    fn solve_loads(&self, plant: &Plant, ws: &mut Workspace) -> Result<(), GridError> {
        for (k, load) in plant.nonlinear.iter().enumerate() {
            let mut v = self.transfer[self.n * self.n_bus + load.bus];
            for s in 0..self.n {
                v += self.transfer[s * self.n_bus + load.bus] * c64::new(ws.e_re[s], ws.e_im[s]);
            }
            ws.v_open[k] = v;
        }
        if !std::mem::replace(&mut ws.warm, true) {
            ws.v_load.copy_from_slice(&ws.v_open);
        }
        let m = plant.nonlinear.len();
        let mut change = f64::INFINITY;
        for _ in 0..MAX_LOAD_ITERATIONS {
            plant.load_currents(&ws.v_load, &mut ws.j_load);
            let (v_re, v_im) = (&mut ws.v_re[..m], &mut ws.v_im[..m]);
            for k in 0..m {
                (v_re[k], v_im[k]) = (ws.v_open[k].re, ws.v_open[k].im);
            }
            for ((r, x), j) in self.r_load.chunks_exact(m).zip(self.x_load.chunks_exact(m)).zip(&ws.j_load) {
                for k in 0..m {
                    v_re[k] += r[k] * j.re - x[k] * j.im;
                    v_im[k] += r[k] * j.im + x[k] * j.re;
                }
            }
            change = 0.0;
            for k in 0..m {
                let v = c64::new(v_re[k], v_im[k]);
                change = worse(change, (v - ws.v_load[k]).norm_sqr());
                ws.v_load[k] = v;
            }
            change = change.sqrt();
            if change < LOAD_TOLERANCE_PU {
                return Ok(());
            }
        }
        ws.warm = false;
        Err(GridError::Loads { residual: change })
    }
}

/// Fixed-point iterations for the loads' voltages before giving up.
pub(super) const MAX_LOAD_ITERATIONS: usize = 200;
/// Change of a voltage at which the iteration ends, pu.
pub(super) const LOAD_TOLERANCE_PU: f64 = 1e-13;

/// The larger of two, NaN counting as infinite.
pub(super) fn worse(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

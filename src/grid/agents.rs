//! The paper's agent model, (5)-(6) to the letter: the five states are free integrators driven by the
//! five controls. A second plant, to check the theory with; knows no network.

/// n agents after (5)-(6). Inside, `P` and `Q` are the scaled `K_P (P - P_set)` and `K_Q (Q - Q_set)`
/// of the paper's renaming after (3).
#[derive(Clone, Debug, PartialEq)]
pub struct Agents {
    /// Frequency setpoints omega_i^0, pu.
    pub omega_set: Vec<f64>,
    /// Scaled active powers, pu of frequency.
    pub P_scaled: Vec<f64>,
    /// Energies, pu*h.
    pub E: Vec<f64>,
    /// Voltage setpoints V_i^0, pu.
    pub V_set: Vec<f64>,
    /// Scaled reactive powers, pu of voltage.
    pub Q_scaled: Vec<f64>,
    /// Frequency droop that scales P, pu/pu.
    pub K_P: Vec<f64>,
    /// Voltage droop that scales Q, pu/pu.
    pub K_Q: Vec<f64>,
    /// Active power references, pu.
    pub P_set: Vec<f64>,
    /// Reactive power references, pu.
    pub Q_set: Vec<f64>,
}

/// The five controls (9)-(13), pu/s, u_E in pu*h/s; n each.
#[derive(Clone, Copy, Debug)]
pub struct Controls<'a> {
    /// (12).
    pub omega: &'a [f64],
    /// (9).
    pub P: &'a [f64],
    /// (11).
    pub E: &'a [f64],
    /// (13).
    pub V: &'a [f64],
    /// (10).
    pub Q: &'a [f64],
}

impl Agents {
    /// Agents with outputs `omega`, `V`, scaled powers `P`, `Q` and energies `E`, unit droop and no
    /// power references: raw and scaled powers are the same.
    pub fn from_outputs(omega: &[f64], P: &[f64], E: &[f64], V: &[f64], Q: &[f64]) -> Self {
        let n = omega.len();
        Self {
            omega_set: omega.iter().zip(P).map(|(omega, P)| omega + P).collect(),
            P_scaled: P.to_vec(),
            E: E.to_vec(),
            V_set: V.iter().zip(Q).map(|(V, Q)| V + Q).collect(),
            Q_scaled: Q.to_vec(),
            K_P: vec![1.0; n],
            K_Q: vec![1.0; n],
            P_set: vec![0.0; n],
            Q_set: vec![0.0; n],
        }
    }

    /// Number of agents.
    pub fn n(&self) -> usize {
        self.omega_set.len()
    }

    /// Advances by `h` s with the controls held. This is the exact solution of (5); for all but E it is
    /// one step of explicit Euler.
    pub fn step(&mut self, u: &Controls<'_>, h: f64) {
        for i in 0..self.n() {
            let P_mean = self.P(i) + 0.5 * h * u.P[i] / self.K_P[i];
            self.omega_set[i] += h * u.omega[i];
            self.P_scaled[i] += h * u.P[i];
            self.E[i] += h * (u.E[i] - P_mean / 3600.0);
            self.V_set[i] += h * u.V[i];
            self.Q_scaled[i] += h * u.Q[i];
        }
    }

    /// Frequency, pu; (6).
    pub fn omega(&self, i: usize) -> f64 {
        self.omega_set[i] - self.P_scaled[i]
    }

    /// Voltage, pu; (6).
    pub fn V(&self, i: usize) -> f64 {
        self.V_set[i] - self.Q_scaled[i]
    }

    /// Active power as measured, pu: `P_scaled / K_P + P_set`.
    pub fn P(&self, i: usize) -> f64 {
        self.P_scaled[i] / self.K_P[i] + self.P_set[i]
    }

    /// Reactive power as measured, pu: `Q_scaled / K_Q + Q_set`.
    pub fn Q(&self, i: usize) -> f64 {
        self.Q_scaled[i] / self.K_Q[i] + self.Q_set[i]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_controls_are_integrated_exactly() {
        let start = Agents {
            K_P: vec![0.004],
            P_set: vec![0.5],
            ..Agents::from_outputs(&[0.99], &[0.008], &[0.6], &[1.01], &[0.02])
        };
        let u = Controls { omega: &[1e-3], P: &[4e-4], E: &[-1e-5], V: &[2e-3], Q: &[-1e-3] };
        // One long step and many short ones; P(t) = 2.5 + 0.1 t, so E(10) = 0.6 - 1e-4 - (25 + 5)/3600.
        for pieces in [1, 1000] {
            let mut agents = start.clone();
            for _ in 0..pieces {
                agents.step(&u, 10.0 / f64::from(pieces));
            }
            assert!((agents.P(0) - 3.5).abs() < 1e-12);
            assert!((agents.E[0] - (0.6 - 1e-4 - 30.0 / 3600.0)).abs() < 1e-12);
            assert!((agents.omega(0) - (0.99 + 0.01 - 0.004)).abs() < 1e-12);
            assert!((agents.V(0) - (1.01 + 0.02 + 0.01)).abs() < 1e-12);
        }
    }
}

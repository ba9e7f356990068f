//! The droop-controlled inverter and its battery, one function per equation. Never knows the network.

/// Frequency by droop, (3) with a power reference:
/// `omega = omega_set - K_P (P - P_set)`, pu of nominal.
#[inline]
pub fn omega(omega_set: f64, K_P: f64, P: f64, P_set: f64) -> f64 {
    omega_set - K_P * (P - P_set)
}

/// Voltage by droop, (3) with a power reference: `V = V_set - K_Q (Q - Q_set)`, pu. By (4) and the
/// text below it, this is the magnitude of the source's voltage.
#[inline]
pub fn voltage(V_set: f64, K_Q: f64, Q: f64, Q_set: f64) -> f64 {
    V_set - K_Q * (Q - Q_set)
}

/// Power measurement, (1) and (2): a first-order filter, `dP/dt = omega_c (p - P)`, pu/s; `p` is the
/// instantaneous power, omega_c in rad/s. The same for Q.
#[inline]
pub fn power_filter(p: f64, P: f64, omega_c: f64) -> f64 {
    omega_c * (p - P)
}

/// Angle of the source against a frame at nominal frequency (DESIGN section 2):
/// `d delta/dt = omega_b (omega - 1)`, rad/s.
#[inline]
pub fn angle_rate(omega: f64, omega_b: f64) -> f64 {
    omega_b * (omega - 1.0)
}

/// Battery, the energy row of (5): `dE/dt = -p / 3600`, pu*h per s.
#[inline]
pub fn energy_rate(p: f64) -> f64 {
    -p / 3600.0
}

//! How loads follow the voltage: impedance, constant power, or a ZIP mixture. Constant-power and
//! constant-current parts become impedances below 0.7 pu, as no real load holds its power in a
//! collapsing voltage. Never solves the network.

use super::error::{GridError, not_negative};
use serde::{Deserialize, Serialize};

/// Voltage below which every load is an impedance, pu.
pub const IMPEDANCE_BELOW: f64 = 0.7;

/// Load model of the case's loads; load changes (`dP_load`, `dQ_load`) are admittances always.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "host", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LoadModel {
    /// Constant admittance at the voltage of the power flow.
    #[default]
    Impedance,
    /// Constant power down to 0.7 pu.
    ConstantPower,
    /// Fractions of constant impedance, current and power; they sum to 1.
    Zip {
        /// Constant-impedance fraction.
        Z: f64,
        /// Constant-current fraction.
        I: f64,
        /// Constant-power fraction.
        P: f64,
    },
}

impl LoadModel {
    /// Fractions (Z, I, P).
    pub fn fractions(self) -> (f64, f64, f64) {
        match self {
            Self::Impedance => (1.0, 0.0, 0.0),
            Self::ConstantPower => (0.0, 0.0, 1.0),
            Self::Zip { Z, I, P } => (Z, I, P),
        }
    }

    /// Whether the load current is proportional to the voltage.
    pub fn is_linear(self) -> bool {
        self.fractions().0 == 1.0
    }

    /// Present admittance over the one at the power flow's voltage `v0`, at voltage magnitude `v`, pu.
    pub fn admittance_ratio(self, v: f64, v0: f64) -> f64 {
        let (Z, I, P) = self.fractions();
        let knee = IMPEDANCE_BELOW.min(v0);
        let v = v.max(knee);
        Z + I * (v0 / v) + P * (v0 / v) * (v0 / v)
    }

    /// Slope of [`Self::admittance_ratio`] in the voltage magnitude `v`, 1/pu; at the knee that of the impedance.
    pub fn admittance_slope(self, v: f64, v0: f64) -> f64 {
        let (_, I, P) = self.fractions();
        if v <= IMPEDANCE_BELOW.min(v0) { 0.0 } else { -(I + 2.0 * P * (v0 / v)) * v0 / (v * v) }
    }

    /// The part of the admittance at `v0` that the network matrix holds; the rest is a current, found by
    /// iteration. Z + I/2 is the best: to first order, a constant-power load's current follows the
    /// conjugate of its voltage alone, a constant-current load's half and half.
    pub(crate) fn held_as_admittance(self) -> f64 {
        let (Z, I, _) = self.fractions();
        Z + 0.5 * I
    }

    /// Checks the fractions.
    pub fn validate(self, path: &str) -> Result<(), GridError> {
        let (Z, I, P) = self.fractions();
        for (key, value) in [("Z", Z), ("I", I), ("P", P)] {
            not_negative(|| format!("{path}.zip.{key}"), value)?;
        }
        let sum = Z + I + P;
        if (sum - 1.0).abs() > 1e-9 {
            return Err(GridError::invalid(
                format!("{path}.zip"),
                format!("Z + I + P = {sum}"),
                "a sum of 1",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_follows_the_voltage_as_named() {
        let v0 = 0.98;
        let power = |model: LoadModel, v: f64| model.admittance_ratio(v, v0) * v * v / (v0 * v0);
        let current = LoadModel::Zip { Z: 0.0, I: 1.0, P: 0.0 };
        for v in [0.75, 0.9, 1.05] {
            assert!((power(LoadModel::ConstantPower, v) - 1.0).abs() < 1e-15);
            assert!((power(current, v) - v / v0).abs() < 1e-15);
            assert!((power(LoadModel::Impedance, v) - v * v / (v0 * v0)).abs() < 1e-15);
        }
        // Below the knee: square law from the power at the knee.
        assert!((power(LoadModel::ConstantPower, 0.35) - 0.25).abs() < 1e-15);
    }
}

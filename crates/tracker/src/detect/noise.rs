//! Models the noise of a sample: its variance as a function of its value.
//!
//! Owns: [`Noise`]. Must not: measure it (`learn` does).

use serde::{Deserialize, Serialize};

/// Variance of a sample as a function of its value: `read + shot * max(value - dark, 0)`, raw units squared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Variance at and below the `dark` level: read noise and rounding.
    pub read: f64,
    /// Growth of the variance with the value (shot noise), raw units.
    pub shot: f64,
    /// Level at which only read noise is left: that of the background.
    pub dark: f64,
}

impl Noise {
    /// Variance of a sample whose true value is `value`.
    pub fn variance(&self, value: f64) -> f64 {
        self.read + self.shot * (value - self.dark).max(0.0)
    }
}

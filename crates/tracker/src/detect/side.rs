//! Holds the polarity that was found: markers brighter or darker than their surroundings.
//!
//! Owns: [`Side`]. Must not: find out which side it is (`learn` does).

use serde::{Deserialize, Serialize};

/// Whether markers are brighter or darker than their surroundings, once that is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Brighter.
    Bright,
    /// Darker.
    Dark,
}

impl Side {
    /// 1 for bright, -1 for dark: turns raw values into heights above the background.
    pub fn sign(self) -> f64 {
        match self {
            Side::Bright => 1.0,
            Side::Dark => -1.0,
        }
    }
}

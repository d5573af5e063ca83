//! Holds the typical marker of a recording: radius, blur of its edge, misfit of its disc.
//!
//! Owns: [`Marker`]. Must not: learn it (`learn_marker` does).

use serde::{Deserialize, Serialize};

/// A typical marker.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Radius of the disc, px; as of all lengths, in units of sqrt(area of a pixel).
    pub radius_px: f64,
    /// Half the range that holds most radii, as a part of the radius.
    pub radius_spread: f64,
    /// Standard deviation of the blur of its edge, px; the pixel's own extent is not in it.
    pub blur_px: f64,
    /// Median of the mean square of weighted residuals: 1 where markers are discs and the noise is as learned.
    pub chi2: f64,
    /// Its ninth decile.
    pub chi2_high: f64,
}

/// Root mean square misfit of a disc, as a part of its height.
pub(crate) const LARGEST_MISFIT: f64 = 0.15;

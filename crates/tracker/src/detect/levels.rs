//! Holds the levels of a recording: polarity, background, threshold, noise, limits of area, typical marker.
//!
//! Owns: [`Levels`]. Must not: learn them (`learn` does).

use serde::{Deserialize, Serialize};

use super::learn::background::Background;
use super::marker::Marker;
use super::noise::Noise;
use super::settings::Polarity;
use crate::pixel_aspect::PixelAspect;

/// Contrast, in standard deviations of the background's noise, above which a misfit of one pixel shows.
const HIGH_CONTRAST_SIGMA: f64 = 30.0;

/// The grey levels, noise and marker learned from a recording. Written into the table's metadata.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Levels {
    /// Polarity; `side` in files.
    #[serde(rename = "side")]
    pub polarity: Polarity,
    /// Width and height of the frames, px.
    pub image_px: [u32; 2],
    /// Width to height of a pixel.
    #[serde(default, skip_serializing_if = "PixelAspect::is_square")]
    pub pixel_aspect: PixelAspect,
    /// Significant bits of a sample.
    pub depth_bits: u32,
    /// Background, raw units.
    pub background: Background,
    /// Height above (or below) the background at which a marker begins, raw units; with a threshold given in
    /// raw units, its distance from the background's median.
    pub height: f64,
    /// The threshold the user gave, raw units; replaces background and height.
    pub fixed_threshold: Option<f64>,
    /// Typical height of a marker, raw units.
    pub contrast: f64,
    /// Noise.
    pub noise: Noise,
    /// Value at which samples saturate on the markers' side, raw units; `None` if none do.
    pub saturation: Option<f64>,
    /// Least and greatest area of a blob that may be a marker, px.
    pub area_px: [f64; 2],
    /// Area of a typical marker, px; `None` where areas have no common value.
    pub marker_area_px: Option<f64>,
    /// The usual marker; `None` where markers are no discs.
    pub marker: Option<Marker>,
    /// Frames it was learned from.
    pub frames: usize,
    /// Blobs it was learned from.
    pub blobs: usize,
}

impl Levels {
    /// Whether one wrong pixel of a marker is significant: contrast above 30 sigma of the background's noise.
    pub(crate) fn high_contrast(&self) -> bool {
        self.contrast > HIGH_CONTRAST_SIGMA * self.noise.variance(self.noise.dark).sqrt()
    }

    /// The threshold at a place, raw units: a pixel of a bright marker is at least this, of a dark one at most.
    pub fn threshold(&self, x_px: f64, y_px: f64) -> f64 {
        self.fixed_threshold
            .unwrap_or_else(|| self.background.at(x_px, y_px) + self.polarity.sign() * self.height)
    }
}

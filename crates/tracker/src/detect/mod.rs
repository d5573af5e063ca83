//! From a frame to the centres of its markers.
//!
//! Owns: [`Detection`], [`DetectSettings`], [`Levels`] (what was learned of the recording) and [`Detector`].
//! Must not: know of nodes, bodies or other frames.

mod background;
mod candidates;
mod centre;
mod contours;
mod detector;
mod edge;
mod fit;
mod lanes;
mod lens;
mod levels;
mod marker;
mod mask;
mod normal;
mod pixels;
mod plan;
mod ring;
mod runs;
mod shape;
mod skip;
#[cfg(test)]
mod tests;

pub use detector::Detector;
pub use levels::{Background, Levels, Marker, Noise, Side};
#[cfg(test)]
pub(crate) use pixels::pack;

use crate::rig::{Lens, Region};

/// Facts about a detection that make its centre less trustworthy, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flags(pub u8);

impl Flags {
    /// Pixels at the top (or bottom) of the recording's range.
    pub const SATURATED: u8 = 1;
    /// The blob touches the image's border or the region's.
    pub const BORDER: u8 = 2;
    /// The blob holds more than one marker.
    pub const MERGED: u8 = 4;
    /// The blob is not the whole marker: its centre is biased.
    pub const PARTIAL: u8 = 8;

    /// Whether any of `bits` is set.
    pub fn has(self, bits: u8) -> bool {
        self.0 & bits != 0
    }
}

/// One blob that may be a marker.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Detection {
    /// Centre, px; x right.
    pub x_px: f64,
    /// Centre, px; y down.
    pub y_px: f64,
    /// Standard uncertainty of each coordinate, px.
    pub sigma_px: f32,
    /// Area beyond the threshold, px.
    pub area_px: f32,
    /// Largest difference from the background, raw units of the recording, above 0 for either polarity.
    pub peak: f32,
    /// Longer over shorter principal axis, at least 1.
    pub elongation: f32,
    /// What makes it less trustworthy.
    pub flags: Flags,
}

/// Where the threshold comes from.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Threshold {
    /// Learned from the recording.
    #[default]
    Auto,
    /// Given in raw units of the recording.
    Raw(f64),
}

/// Whether markers are brighter or darker than what surrounds them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Polarity {
    /// Found out from the recording.
    #[default]
    Auto,
    /// Brighter.
    Bright,
    /// Darker.
    Dark,
}

/// How a centre is taken from a blob.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Centroid {
    /// By intensity against the local background.
    #[default]
    Weighted,
    /// The paper's: OpenCV's `findContours` and `moments` (Section 5.2).
    Contour,
}

/// What a user may say about detection. The default says nothing and everything is learned.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct DetectSettings {
    /// Threshold.
    pub threshold: Threshold,
    /// Polarity.
    pub polarity: Polarity,
    /// Centre.
    pub centroid: Centroid,
    /// Least area, px; `None` is learned.
    pub min_area_px: Option<f64>,
    /// Greatest area, px; `None` is learned.
    pub max_area_px: Option<f64>,
    /// Where to look; `None` is the whole image.
    pub region: Option<Region>,
    /// Lens correction of centres; `None` is none.
    pub lens: Option<Lens>,
}

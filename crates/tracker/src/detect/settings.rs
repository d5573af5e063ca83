//! Defines the settings of detection: threshold, polarity, kind of centre, limits of area, region, lens.
//!
//! Owns: [`DetectSettings`], [`Threshold`], [`Polarity`], [`Centroid`]. Must not: learn what a setting leaves open
//! (`learn` does).

use crate::pixel_aspect::PixelAspect;
use crate::rig::{Lens, Region};

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
    /// Width to height of a pixel: a disc is as much narrower in the image.
    #[serde(default, skip_serializing_if = "PixelAspect::is_square")]
    pub pixel_aspect: PixelAspect,
}

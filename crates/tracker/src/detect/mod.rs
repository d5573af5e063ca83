//! Detects markers: from a frame to the centres of its markers.
//!
//! Owns: [`Detection`], [`DetectSettings`], [`Levels`] (what was learned of the recording) and [`Detector`].
//! Must not: know of nodes, bodies or other frames.
//!
//! `learn` finds the levels in sample frames. In each frame `label` finds the blobs beyond the threshold and `centre`
//! their centres; `detector` calls both. `simd` holds the vector arithmetic of all of them.

mod centre;
mod detection;
mod detector;
mod label;
mod learn;
mod lens;
mod levels;
mod marker;
mod noise;
mod pixels;
mod quantile;
mod settings;
mod side;
mod simd;
#[cfg(test)]
mod tests;

pub use detection::{Detection, Flags};
pub use detector::Detector;
pub use learn::background::Background;
pub use levels::Levels;
pub use marker::Marker;
pub use noise::Noise;
#[cfg(test)]
pub(crate) use pixels::pack;
pub use settings::{Centroid, DetectSettings, Polarity, Threshold};
pub use side::Side;

//! From a frame to the centres of its markers.
//!
//! Owns: [`Detection`], [`DetectSettings`], [`Levels`] (what was learned of the recording) and [`Detector`].
//! Must not: know of nodes, bodies or other frames.

mod background;
mod candidates;
mod centre;
mod contours;
mod detection;
mod detector;
mod edge;
mod fit;
mod lanes;
mod learn;
mod learn_marker;
mod lens;
mod levels;
mod marker;
mod mask;
mod noise;
mod normal;
mod pixels;
mod plan;
mod quantile;
mod ring;
mod runs;
mod settings;
mod shape;
mod side;
mod skip;
#[cfg(test)]
mod tests;

pub use background::Background;
pub use detection::{Detection, Flags};
pub use detector::Detector;
pub use levels::Levels;
pub use marker::Marker;
pub use noise::Noise;
#[cfg(test)]
pub(crate) use pixels::pack;
pub use settings::{Centroid, DetectSettings, Polarity, Threshold};
pub use side::Side;

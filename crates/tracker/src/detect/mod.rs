//! Detects markers: from a frame to the centres of its markers.
//!
//! Owns: [`Detection`], [`DetectSettings`], [`Levels`] (what was learned of the recording) and [`Detector`].
//! Must not: know of nodes, bodies or other frames.
//!
//! `learn` finds the levels in sample frames. In each frame `label` finds the blobs beyond the threshold and `centre`
//! their centres; `detector` calls both. `simd` holds the vector arithmetic of all of them.
//!
//! ```
//! use std::sync::Arc;
//!
//! use tracker::detect::{DetectSettings, Detector, Levels};
//! use tracker::frame::FrameSource;
//! use tracker::synth::{SyntheticSource, preset};
//!
//! let mut film = SyntheticSource::new(&preset("clean", 1)?)?;
//! let settings = DetectSettings::default();
//! let levels = Levels::learn(&film.sample(8)?, &settings)?;
//! let mut detector = Detector::new(Arc::new(levels), &settings)?;
//!
//! let (frame, mut markers) = (film.next_frame()?.unwrap(), Vec::new());
//! detector.detect(&frame, &mut markers)?;
//! assert_eq!(markers.len(), 9);
//! assert!(markers.iter().all(|m| m.sigma_px < 0.05), "centres are known to a twentieth of a pixel");
//! # Ok::<(), tracker::error::Error>(())
//! ```

mod centre;
mod detection;
mod detector;
mod label;
mod learn;
#[cfg(feature = "opencv")]
mod lens;
#[cfg(not(feature = "opencv"))]
#[path = "without_lens.rs"]
mod lens;
mod levels;
mod marker;
mod noise;
mod pixels;
mod quantile;
mod settings;
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
pub use settings::{Centroid, DetectSettings, Polarity, PolaritySetting, Threshold};

//! From detections to named nodes: bodies are followed from frame to frame, and found anew after a gap.
//!
//! Owns: [`Tracker`], [`track_recording`], [`TrackSummary`]. Must not: know of pixels, pendulums or metres.

mod beside;
mod bodies;
mod chance;
mod engine;
mod finding;
mod habits;
mod learn;
mod partly;
mod recording;
mod rows;
mod seen;
mod tracker;
mod undecided;

#[cfg(test)]
pub(crate) mod tests;

pub use recording::{TrackSummary, track_recording};
pub use tracker::Tracker;

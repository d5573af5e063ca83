//! From detections to named nodes: bodies are followed from frame to frame, and found anew after a gap.
//!
//! Owns: [`Tracker`], [`track_recording`], [`TrackSummary`]. Must not: know of pixels, pendulums or metres.

mod bodies;
mod body_search;
mod chain;
mod false_matches;
mod frame_tracker;
mod motion_priors;
mod occluded;
mod occlusion_filter;
mod prior_estimator;
mod recording;
mod rows;
mod seen;
mod tentative;
mod tracker;

#[cfg(test)]
pub(crate) mod tests;

pub use recording::{TrackSummary, track_recording};
pub use tracker::Tracker;

//! Keeps the detections of a whole recording while the rig is found and the markers are followed.
//!
//! Owns: [`FrameStamp`], [`DetectionStore`]. A recording is decoded once; its detections are small, yet those of
//! an hour are not: past a bound they go to disk, in blocks, and memory does not grow with the recording.
//! Must not: know what a detection is followed into.

mod block;
mod detection_store;
mod plane_view;
mod spool;
mod stamp;

pub use detection_store::{DetectionStore, MEMORY_BOUND_BYTES};
pub use plane_view::PlaneView;
pub use spool::{Finished, Spool};
pub use stamp::FrameStamp;

//! Finds the rig of a recording in its detections: nodes, bodies, joints, reference picture.
//!
//! Owns: [`discover`], [`Discovery`], [`rig_of_paths`]. Must not: name markers frame by frame (`track` does), or look at pixels.

pub(crate) mod advice;
mod arrange;
mod bodies;
mod circle;
mod continuity;
mod discovery;
mod find;
mod followed;
mod lone;
mod median;
mod reading;
mod sample;
mod signature;
mod trial;

pub use discovery::Discovery;
pub use find::discover;
pub(crate) use followed::{PathRig, rig_of_paths};

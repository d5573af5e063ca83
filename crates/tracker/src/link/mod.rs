//! Links detections of consecutive frames by nearness, as far as nothing competes.
//!
//! Owns: [`Tracklet`], [`Linker`], [`link`]. Must not: know of bodies. What is ambiguous ends a tracklet; nothing is guessed.

mod linker;
mod stretches;
mod tracklet;

pub use linker::Linker;
pub use stretches::link;
pub use tracklet::{Point, Tracklet};

//! Finds bodies from tracklets: markers that are seen at the same time and keep their distance while they move.
//!
//! Owns: [`Evidence`], [`bodies`]. Must not: name markers frame by frame, or search a frame for a shape.

mod absorb;
mod body;
mod evidence;
mod find;
mod hanging;
mod pairs;
mod stitch;

pub use body::FoundBody;
pub use evidence::Evidence;
pub use find::{bodies, camera};

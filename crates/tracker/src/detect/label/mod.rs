//! Labels the blobs of a frame: connected pixels beyond the threshold.

pub(super) mod components;
pub(super) mod mask;
pub(super) mod plan;
mod prefilter;

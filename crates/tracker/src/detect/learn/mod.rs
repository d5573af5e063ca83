//! Learns the levels of a recording: background, polarity and threshold, marker, noise.

pub(super) mod background;
mod candidates;
mod levels;
mod marker;

//! Decides what the frames' times are: the recording's time stamps, or the even grid that they were rounded from.
//!
//! A container keeps whole ticks; Matroska's are 1 ms, so stamps of 600 frames a second are up to 0.5 ms wrong. Whether
//! they lie on a grid is known at the end of a recording, and rows are written after it. Nothing here reads anything.

mod clock;
mod decide;
mod facts;
mod grid;
mod places;
mod rational;
mod steps;
mod strip;
mod words;

pub use clock::Clock;
pub use decide::decide;
pub use facts::{Captured, Doubt, Timing, TimingKind};
pub(crate) use grid::gaps as grid_gaps;
pub use rational::rational;
pub use steps::{Standstill, Steps};
pub use words::{notes, rate_words, times_words};

//! Where frames come from.

pub mod synthetic;

pub use crate::frame::{Ending, FrameSource, SourceInfo};

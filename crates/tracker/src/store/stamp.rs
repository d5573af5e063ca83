//! Holds the stamp of a frame: its index and time, without its pixels.
//!
//! Owns: [`FrameStamp`]. Must not: hold detections.

/// A frame's place in the recording, without its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameStamp {
    /// Index in the recording, from 0.
    pub index: u64,
    /// Time in ticks of the source's time base.
    pub ticks: i64,
    /// Whether its pixels could be decoded.
    pub decoded: bool,
}

//! The detections of a whole recording, kept while the rig is found and the markers are followed.
//!
//! Owns: [`FrameStamp`], [`DetectionStore`]. A recording is decoded once; its detections are small.

use crate::detect::Detection;

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

/// Stamps and detections of consecutive frames, read forwards, backwards or at random.
#[derive(Debug, Default)]
pub struct DetectionStore {
    stamps: Vec<FrameStamp>,
    starts: Vec<usize>,
    detections: Vec<Detection>,
}

impl DetectionStore {
    /// An empty store.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the next frame.
    pub fn push(&mut self, stamp: FrameStamp, detections: &[Detection]) {
        self.stamps.push(stamp);
        self.starts.push(self.detections.len());
        self.detections.extend_from_slice(detections);
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.stamps.len()
    }

    /// Whether there are no frames.
    pub fn is_empty(&self) -> bool {
        self.stamps.is_empty()
    }

    /// Stamp of the `i`-th frame stored.
    pub fn stamp(&self, i: usize) -> FrameStamp {
        self.stamps[i]
    }

    /// Copies the detections of the `i`-th frame stored into `out`, cleared first.
    pub fn read(&self, i: usize, out: &mut Vec<Detection>) {
        let end = self.starts.get(i + 1).copied().unwrap_or(self.detections.len());
        out.clear();
        out.extend_from_slice(&self.detections[self.starts[i]..end]);
    }
}

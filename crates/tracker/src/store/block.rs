//! Holds a run of consecutive frames with their detections, and writes and reads its form on disk.
//!
//! Owns: [`Block`], its bytes. Must not: open a file.

use super::stamp::FrameStamp;
use crate::detect::{Detection, Flags};

/// Frames in a block; all but the last of a store are full.
pub const BLOCK_FRAMES: usize = 256;

const STAMP_BYTES: usize = 8 + 8 + 1 + 4;
const DETECTION_BYTES: usize = 2 * 8 + 4 * 4 + 1;

/// Consecutive frames and their detections.
#[derive(Debug, Default)]
pub struct Block {
    stamps: Vec<FrameStamp>,
    /// For each frame one past its last detection.
    ends: Vec<u32>,
    detections: Vec<Detection>,
}

impl Block {
    /// Frames in it.
    pub fn len(&self) -> usize {
        self.stamps.len()
    }

    /// Adds a frame.
    pub fn push(&mut self, stamp: FrameStamp, detections: &[Detection]) {
        self.stamps.push(stamp);
        self.detections.extend_from_slice(detections);
        self.ends.push(self.detections.len() as u32);
    }

    /// Stamp of its `k`-th frame.
    pub fn stamp(&self, k: usize) -> FrameStamp {
        self.stamps[k]
    }

    /// Detections of its `k`-th frame.
    pub fn detections(&self, k: usize) -> &[Detection] {
        let start = if k == 0 { 0 } else { self.ends[k - 1] as usize };
        &self.detections[start..self.ends[k] as usize]
    }

    /// Bytes it takes.
    pub fn bytes(&self) -> usize {
        self.stamps.len() * STAMP_BYTES + self.detections.len() * DETECTION_BYTES
    }

    /// Appends its form on disk: stamps with counts, then detections, all little-endian.
    pub fn encode(&self, out: &mut Vec<u8>) {
        out.reserve(self.bytes());
        let mut start = 0;
        for (stamp, &end) in self.stamps.iter().zip(&self.ends) {
            out.extend_from_slice(&stamp.index.to_le_bytes());
            out.extend_from_slice(&stamp.ticks.to_le_bytes());
            out.push(u8::from(stamp.decoded));
            out.extend_from_slice(&(end - start).to_le_bytes());
            start = end;
        }
        for d in &self.detections {
            out.extend_from_slice(&d.x_px.to_le_bytes());
            out.extend_from_slice(&d.y_px.to_le_bytes());
            for value in [d.sigma_px, d.area_px, d.peak, d.elongation] {
                out.extend_from_slice(&value.to_le_bytes());
            }
            out.push(d.flags.0);
        }
    }

    /// Reads its form on disk; `None` if `bytes` is not one of `frames` frames.
    pub fn decode(bytes: &[u8], frames: usize) -> Option<Self> {
        let mut block = Self::default();
        let mut rest = bytes;
        let mut total = 0u32;
        for _ in 0..frames {
            let index = u64::from_le_bytes(take(&mut rest)?);
            let ticks = i64::from_le_bytes(take(&mut rest)?);
            let [decoded] = take(&mut rest)?;
            total = total.checked_add(u32::from_le_bytes(take(&mut rest)?))?;
            block.stamps.push(FrameStamp { index, ticks, decoded: decoded != 0 });
            block.ends.push(total);
        }
        if rest.len() != total as usize * DETECTION_BYTES {
            return None;
        }
        block.detections.reserve_exact(total as usize);
        for _ in 0..total {
            block.detections.push(Detection {
                x_px: f64::from_le_bytes(take(&mut rest)?),
                y_px: f64::from_le_bytes(take(&mut rest)?),
                sigma_px: f32::from_le_bytes(take(&mut rest)?),
                area_px: f32::from_le_bytes(take(&mut rest)?),
                peak: f32::from_le_bytes(take(&mut rest)?),
                elongation: f32::from_le_bytes(take(&mut rest)?),
                flags: Flags(u8::from_le_bytes(take(&mut rest)?)),
            });
        }
        Some(block)
    }
}

fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (head, tail) = rest.split_first_chunk::<N>()?;
    *rest = tail;
    Some(*head)
}

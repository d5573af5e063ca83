//! Why frames of a film are left out, where the file itself says it.
//!
//! Owns: [`Reasons`]. Must not: judge.

use std::collections::BTreeMap;

use crate::gaps::{Reason, keep_reason};

/// Packets that are remembered: far more than a decoder has under way.
const REMEMBERED: usize = 4096;

/// Damage of packets, and of the frames made of them, in words.
#[derive(Debug, Default)]
pub(super) struct Reasons {
    /// Of packets, by their number in decoding order: a clause without a full stop.
    of_packets: BTreeMap<u64, String>,
    of_frames: Vec<Reason>,
}

impl Reasons {
    /// Notes the damage of packet `number`.
    pub(super) fn of_packet(&mut self, number: u64, words: Option<String>) {
        self.of_packets.extend(words.map(|words| (number, words)));
        if self.of_packets.len() > REMEMBERED {
            self.of_packets.pop_first();
        }
    }

    /// Frame `index`, of packet `number`, is left out.
    pub(super) fn left_out(&mut self, index: u64, number: u64) {
        if let Some(words) = self.of_packets.remove(&number) {
            keep_reason(&mut self.of_frames, index, words);
        }
    }

    /// Why the first of the frames left out are so.
    pub(super) fn told(&self) -> Vec<Reason> {
        self.of_frames.clone()
    }
}

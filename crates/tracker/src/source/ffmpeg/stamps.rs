//! Computes when frames are shown: from their packets' display times, or, in a stream without, by the decoding times.
//!
//! Owns: [`Stamps`], [`display_times`]. Must not: decode.

use std::collections::VecDeque;

use ffmpeg_next::ffi;

use super::demux::{Demuxer, Packet, Read};
use crate::error::Result;
use crate::source::Input;

/// The times of a stream's frames, in ticks.
pub(super) struct Stamps {
    origin: Origin,
    /// Time of the last picture and the longest step between two.
    last: Option<(i64, i64)>,
}

/// Where display times come from.
enum Origin {
    /// Each packet has one.
    Packets {
        /// The last one and its duration, for a packet without.
        last: Option<(i64, i64)>,
    },
    /// None has: the decoding times, which rise, are given to frames in their order.
    Decoding {
        times: VecDeque<i64>,
        /// Time of the next frame if there are no decoding times either, and ticks from frame to frame.
        next: i64,
        step: i64,
    },
}

impl Stamps {
    /// Times of a stream whose first packets are `unstamped`, with `step` ticks from frame to frame, or not.
    pub(super) fn new(unstamped: bool, step: i64) -> Self {
        let origin = if unstamped {
            Origin::Decoding { times: VecDeque::new(), next: 0, step }
        } else {
            Origin::Packets { last: None }
        };
        Self { origin, last: None }
    }

    /// What the picture of the `number`-th packet will be known by: its time, or, in a stream without display
    /// times, the number.
    pub(super) fn key(&mut self, packet: &ffi::AVPacket, number: i64) -> i64 {
        match &mut self.origin {
            Origin::Packets { last } => {
                let stamp = [packet.pts, packet.dts].into_iter().find(|t| *t != ffi::AV_NOPTS_VALUE);
                let key = stamp.unwrap_or_else(|| last.map_or(0, |(t, d)| t.saturating_add(d.max(1))));
                *last = Some((key, packet.duration));
                key
            }
            Origin::Decoding { times, next, step } => {
                let time = if packet.dts == ffi::AV_NOPTS_VALUE { *next } else { packet.dts.max(*next) };
                times.push_back(time);
                *next = time.saturating_add(*step);
                number
            }
        }
    }

    /// The time of the next frame, which is known by `key`.
    pub(super) fn ticks(&mut self, key: i64) -> i64 {
        let ticks = match &mut self.origin {
            Origin::Packets { .. } => key,
            Origin::Decoding { times, next, .. } => times.pop_front().unwrap_or(*next),
        };
        let longest = self.last.map_or(1, |(last, longest)| longest.max(ticks.saturating_sub(last)));
        self.last = Some((ticks, longest));
        ticks
    }

    /// Whether packets have display times.
    pub(super) fn is_stamped(&self) -> bool {
        matches!(self.origin, Origin::Packets { .. })
    }

    /// Time of the last frame and the longest step between two.
    pub(super) fn last(&self) -> Option<(i64, i64)> {
        self.last
    }
}

/// Packets by which decoding order and display order differ at most.
const REORDER: usize = 16;

/// Display times of the frames of a file in ticks, in order, without decoding, and whether these are all. Reading ends
/// after `most` packets or `most_bytes` of them. Empty if the stream has no times.
///
/// # Errors
/// [`Error::Source`] if the file cannot be read.
pub(crate) fn display_times(
    name: &str,
    input: &Input,
    most: usize,
    most_bytes: u64,
) -> Result<(Vec<i64>, bool)> {
    let (Input::File(url) | Input::Pipe(url) | Input::Address(url)) = input;
    let mut demuxer = Demuxer::open(url, name, Some("file"))?;
    let mut packet = Packet::new(name)?;
    let mut times = Vec::new();
    let mut unstamped = false;
    let mut is_whole = true;
    let mut bytes = 0u64;
    while let Read::Packet = demuxer.read(&mut packet) {
        let fields = packet.get();
        bytes = bytes.saturating_add(u64::try_from(fields.size).unwrap_or(0));
        if packet.has(ffi::AV_PKT_FLAG_DISCARD) {
            continue;
        }
        if times.len() == most || bytes > most_bytes {
            is_whole = false;
            break;
        }
        unstamped |= fields.pts == ffi::AV_NOPTS_VALUE;
        times.push((fields.pts, fields.dts));
    }
    // Decoding times rise as display times do, if there are no others.
    let mut times: Vec<i64> = times.into_iter().map(|(p, d)| if unstamped { d } else { p }).collect();
    if times.contains(&ffi::AV_NOPTS_VALUE) {
        return Ok((Vec::new(), false));
    }
    times.sort_unstable();
    if !is_whole {
        // Frames shown before the last of these may still be to come.
        times.truncate(times.len().saturating_sub(REORDER));
    }
    Ok((times, is_whole))
}

//! Computes when frames are shown: from their packets' display times, or, in a stream without, by the decoding times.
//!
//! Owns: [`Stamps`], [`display_times`], [`Survey`]. Must not: decode.

use std::collections::VecDeque;

use ffmpeg_next::ffi;

use super::demux::{Demuxer, Packet, Read};
use super::describe::{step, stream_base};
use super::lost::Lost;
use crate::error::Result;
use crate::frame::TimeBase;
use crate::source::Input;

/// The times of a stream's frames, in ticks.
pub(super) struct Stamps {
    origin: Origin,
    /// Time of the last picture and the longest step between two.
    last: Option<(i64, i64)>,
}

/// Display times of packets most of which have one.
#[derive(Debug, Default)]
struct Keys {
    /// The greatest so far and the duration of its packet.
    greatest: Option<(i64, i64)>,
    /// Ticks from decoding to display of the last packet that has to wait; 0 before any.
    delay: i64,
}

impl Keys {
    /// The packet's display time. In a stream whose pictures wait for others, its decoding time is an earlier
    /// picture's display time: the wait of the last picture is added to it.
    fn key(&mut self, pts: i64, dts: i64, duration: i64) -> i64 {
        let known = |t: i64| (t != ffi::AV_NOPTS_VALUE).then_some(t);
        let after = self.greatest.map_or(0, |(t, d)| t.saturating_add(d.max(1)));
        let key = match (known(pts), known(dts)) {
            (Some(pts), dts) => {
                if let Some(wait) = dts.map(|d| pts.saturating_sub(d)).filter(|w| *w > 0) {
                    self.delay = wait;
                }
                pts
            }
            (None, Some(dts)) => dts.saturating_add(self.delay),
            (None, None) => after,
        };
        if self.greatest.is_none_or(|(t, _)| key >= t) {
            self.greatest = Some((key, duration));
        }
        key
    }
}

/// Decoding times, each later than the one before; one that lacks is counted from there.
#[derive(Debug)]
struct Counted {
    last: Option<i64>,
    /// Ticks from frame to frame.
    step: i64,
}

impl Counted {
    fn new(step: i64) -> Self {
        Self { last: None, step }
    }

    fn time(&mut self, dts: i64) -> i64 {
        let next = self.last.map_or(0, |last| last.saturating_add(self.step));
        let is_later = dts != ffi::AV_NOPTS_VALUE && self.last.is_none_or(|last| dts > last);
        let time = if is_later { dts } else { next };
        self.last = Some(time);
        time
    }
}

/// Origin of display times.
enum Origin {
    /// Each packet has one.
    Packets(Keys),
    /// None has, or some: the decoding times, which rise, are given to frames in their order.
    Decoding {
        times: VecDeque<i64>,
        counted: Counted,
        /// Decoding times of the packets to come, where the file was looked through.
        known: VecDeque<i64>,
    },
}

impl Stamps {
    /// Times of a stream whose packets are `unstamped`, with `step` ticks from frame to frame, or not.
    pub(super) fn new(unstamped: bool, step: i64) -> Self {
        let origin = if unstamped {
            Origin::Decoding { times: VecDeque::new(), counted: Counted::new(step), known: VecDeque::new() }
        } else {
            Origin::Packets(Keys::default())
        };
        Self { origin, last: None }
    }

    /// The file was looked through before its first packet.
    pub(super) fn surveyed(&mut self, survey: &Survey) {
        if let Origin::Decoding { known, .. } = &mut self.origin {
            *known = survey.decoding_times().into();
        }
    }

    /// The key of the picture of the `number`-th packet: its time, or, in a stream without display times, the number.
    pub(super) fn key(&mut self, packet: &ffi::AVPacket, number: i64) -> i64 {
        match &mut self.origin {
            Origin::Packets(keys) => keys.key(packet.pts, packet.dts, packet.duration),
            Origin::Decoding { times, counted, known } => {
                times.push_back(counted.time(known.pop_front().unwrap_or(packet.dts)));
                number
            }
        }
    }

    /// The time of the packet that will be known by `key`, which is the last one, or near it.
    pub(super) fn time(&self, key: i64) -> i64 {
        match &self.origin {
            Origin::Packets(_) => key,
            Origin::Decoding { counted, .. } => counted.last.unwrap_or(0),
        }
    }

    /// The time of the next frame, which is known by `key`.
    pub(super) fn ticks(&mut self, key: i64) -> i64 {
        let ticks = match &mut self.origin {
            Origin::Packets(_) => key,
            Origin::Decoding { times, counted, .. } => {
                times.pop_front().unwrap_or_else(|| counted.time(ffi::AV_NOPTS_VALUE))
            }
        };
        let longest = self.last.map_or(1, |(last, longest)| longest.max(ticks.saturating_sub(last)));
        self.last = Some((ticks, longest));
        ticks
    }

    /// Whether frames have their times by their order.
    pub(super) fn are_counted(&self) -> bool {
        matches!(self.origin, Origin::Decoding { .. })
    }

    /// Time of the last frame and the longest step between two.
    pub(super) fn last(&self) -> Option<(i64, i64)> {
        self.last
    }
}

/// Packets by which decoding order and display order differ at most.
const REORDER: usize = 16;

/// Packets at a stream's beginning that tell whether it has display times.
const FIRST: usize = 6;

/// Times of a packet: display and decoding time, and duration, ticks.
type Times = (i64, i64, i64);

/// Times of the packets of a file.
pub(super) struct Survey {
    /// In the order of the file.
    packets: Vec<Times>,
    /// Whether these are all.
    is_whole: bool,
    /// Whether display times lack, and decoding times stand for them.
    unstamped: bool,
    /// Whether only some packets have times of their own.
    is_sparse: bool,
    base: TimeBase,
    /// Ticks from frame to frame, by the rate that the container claims.
    step: f64,
}

impl Survey {
    /// Reading ends after `most` packets or `most_bytes` of them.
    pub(super) fn of(name: &str, input: &Input, most: usize, most_bytes: u64) -> Result<Self> {
        let (Input::File(url) | Input::Pipe(url) | Input::Address(url)) = input;
        let mut demuxer = Demuxer::open(url, name, Some("file"))?;
        let mut packet = Packet::new(name)?;
        let mut packets: Vec<Times> = Vec::new();
        let mut is_whole = true;
        let mut bytes = 0u64;
        while let Read::Packet = demuxer.read(&mut packet) {
            let fields = packet.get();
            bytes = bytes.saturating_add(u64::try_from(fields.size).unwrap_or(0));
            if packet.has(ffi::AV_PKT_FLAG_DISCARD) || fields.size <= 0 {
                continue;
            }
            if packets.len() == most || bytes > most_bytes {
                is_whole = false;
                break;
            }
            packets.push((fields.pts, fields.dts, fields.duration));
        }
        // A stream has display times if its first packets have.
        let lacks = |(pts, ..): &Times| *pts == ffi::AV_NOPTS_VALUE;
        let first = || packets.iter().take(FIRST);
        let unstamped = !demuxer.has_display_times()
            || first().any(lacks)
            || demuxer.lacks_display_times(first().map(|(pts, dts, _)| (*pts, *dts)));
        Ok(Self {
            packets,
            is_whole,
            unstamped,
            is_sparse: !demuxer.has_display_times(),
            base: stream_base(&demuxer),
            step: step(&demuxer),
        })
    }

    /// Whether the file says nothing of a packet's time where it should.
    fn is_untimed(&self) -> bool {
        let lacks = |t: i64| t == ffi::AV_NOPTS_VALUE;
        match self.packets.first() {
            Some((_, dts, _)) if self.unstamped => lacks(*dts),
            _ => self.packets.iter().any(|(pts, dts, _)| lacks(*pts) && lacks(*dts)),
        }
    }

    /// Decoding times, each later than the one before.
    fn decoding_times(&self) -> Vec<i64> {
        let mut times: Vec<i64> = self.packets.iter().map(|(_, dts, _)| *dts).collect();
        if self.is_sparse {
            count_back(&mut times, self.step);
        }
        let mut counted = Counted::new(self.step.round() as i64);
        times.into_iter().map(|dts| counted.time(dts)).collect()
    }

    /// Numbers of the packets that come after a gap in the decoding times of an otherwise even film, in their order.
    /// `claims` are rates that the container gives.
    pub(super) fn packets_after_gaps(&self, claims: &[[u64; 2]]) -> Vec<u64> {
        let mut lost = Lost::new(self.base, claims, true);
        for (index, time) in self.decoding_times().into_iter().enumerate() {
            lost.frame(index as u64, time);
        }
        lost.gaps().places.into_iter().filter_map(|g| Some(g.after? + 1)).collect()
    }
}

/// Packets after one by which its time is known: more than the pictures in a block of a program stream.
const LOOKED_AHEAD: usize = 64;
/// Part of the times that must lie whole steps apart for a film to be called evenly spaced.
const EVEN: f64 = 0.8;

/// A block of an MPEG program stream gives the time of the first picture that begins in it, and the library may give it
/// to the picture before or after. No picture is later than one after it less the steps between: times that are too late
/// by steps are put back, times that lack stay so. Nothing is changed in a film that is not evenly spaced.
fn count_back(times: &mut [i64], step: f64) {
    let known: Vec<usize> = (0..times.len()).filter(|i| times[*i] != ffi::AV_NOPTS_VALUE).collect();
    let is_even = |pair: &[usize]| {
        let steps = times[pair[1]].saturating_sub(times[pair[0]]) as f64 / step;
        (steps - steps.round()).abs() * step <= 1.0
    };
    let even = known.windows(2).filter(|pair| is_even(pair)).count();
    if (even as f64) < EVEN * known.len().saturating_sub(1) as f64 {
        return;
    }
    for (k, &i) in known.iter().enumerate() {
        let later = known[k + 1..].iter().take_while(|j| **j <= i + LOOKED_AHEAD);
        let latest = later.map(|&j| times[j] as f64 - (j - i) as f64 * step).fold(f64::INFINITY, f64::min);
        if times[i] as f64 - latest > step / 2.0 {
            times[i] = latest.round() as i64;
        }
    }
}

/// Packets, and bytes of them, whose time stamps are looked at without decoding.
const SURVEYED_FRAMES: usize = 20_000;
const SURVEYED_BYTES: u64 = 256 << 20;

/// Display times of the frames of a file in ticks, in order, without decoding, and whether these are all. Of a stream whose packets
/// have such times only the first are read. Empty if the stream has no times.
///
/// # Errors
/// [`Error::Source`] if the file cannot be read.
pub(super) fn display_times(name: &str, input: &Input, have_times: bool) -> Result<(Vec<i64>, bool)> {
    // A time that is not there is known by those that come after it.
    let (most, most_bytes) =
        if have_times { (SURVEYED_FRAMES, SURVEYED_BYTES) } else { (usize::MAX, u64::MAX) };
    let survey = Survey::of(name, input, most, most_bytes)?;
    if survey.is_untimed() {
        return Ok((Vec::new(), false));
    }
    // Decoding times rise as display times do, if there are no others.
    let mut times = if survey.unstamped {
        survey.decoding_times()
    } else {
        let mut keys = Keys::default();
        survey.packets.iter().map(|(pts, dts, duration)| keys.key(*pts, *dts, *duration)).collect()
    };
    times.sort_unstable();
    if !survey.is_whole {
        // Frames shown before the last of these may still be to come.
        times.truncate(times.len().saturating_sub(REORDER));
    }
    Ok((times, survey.is_whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_without_display_time_waits_as_long_as_the_one_before() {
        const NONE: i64 = ffi::AV_NOPTS_VALUE;
        let mut keys = Keys::default();
        // I P B B, then a P without display time, and one without any.
        let packets = [(3, 0), (6, 3), (4, 4), (5, 5), (NONE, 6), (7, 7), (8, 8), (NONE, NONE)];
        let found: Vec<i64> = packets.iter().map(|(pts, dts)| keys.key(*pts, *dts, 1)).collect();
        assert_eq!(found, [3, 6, 4, 5, 9, 7, 8, 10]);
        // In a stream in which no picture waits, the decoding time is the display time.
        let mut keys = Keys::default();
        assert_eq!([keys.key(0, 0, 1), keys.key(NONE, 1, 1), keys.key(2, 2, 1)], [0, 1, 2]);
    }
}

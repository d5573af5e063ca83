//! Decides how a recording ended: whole, or before what its header declares.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::source::FfmpegSource;
use crate::frame::Ending;
use crate::name::path;

/// Bytes at a file's end in which its mark is looked for: NUT's index of a long film, and more than Ogg's largest page.
const TAIL: u64 = 16 << 20;

/// The last bytes of a file.
fn tail(path: &Path) -> Option<Vec<u8>> {
    let mut file = File::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).ok()?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// Whether an Ogg file ends with a whole page that has the flag of the stream's end.
fn ends_as_ogg(tail: &[u8]) -> bool {
    /// Bytes of the largest page, header and all.
    const LARGEST: usize = 65_307;
    const END: u8 = 4;
    let is_last = |page: &[u8]| {
        let count = page.get(26).map_or(0, |n| usize::from(*n));
        let lengths = page.get(27..27 + count).unwrap_or_default();
        let data: usize = lengths.iter().map(|l| usize::from(*l)).sum();
        page.starts_with(b"OggS\0") && page.len() == 27 + count + data && page[5] & END != 0
    };
    (tail.len().saturating_sub(LARGEST)..tail.len().saturating_sub(26)).any(|at| is_last(&tail[at..]))
}

/// The time of the last frame by a NUT file's index, in ticks; the index ends with its length (8 bytes) and a checksum
/// (4). `None` without an index.
fn last_by_nut(tail: &[u8]) -> Option<i64> {
    const INDEX: [u8; 8] = 0x4E58_DD67_2F23_E64E_u64.to_be_bytes();
    /// Length of a header from which on it has a checksum, bytes.
    const LONG: i64 = 4096;
    let length = tail[tail.len().checked_sub(12)?..].first_chunk()?;
    let start = tail.len().checked_sub(usize::try_from(u64::from_be_bytes(*length)).ok()?)?;
    let mut rest = tail[start..].strip_prefix(&INDEX)?;
    if number(&mut rest)? > LONG {
        rest = rest.get(4..)?;
    }
    number(&mut rest)
}

/// A number of as many bytes as have their highest bit set, and one more.
fn number(rest: &mut &[u8]) -> Option<i64> {
    let end = rest.iter().position(|b| b & 0x80 == 0)?;
    let (bytes, after) = rest.split_at(end + 1);
    *rest = after;
    bytes.iter().try_fold(0i64, |sum, b| sum.checked_mul(128)?.checked_add(i64::from(b & 0x7F)))
}

impl FfmpegSource {
    /// The part of the length declared by the container that is not there, s; `None` if it is all there, but for two of the
    /// longest steps between frames.
    pub(super) fn missing_s(&self) -> Option<f64> {
        let (last, longest) = self.stamps.last()?;
        let missing = self.feed.demuxer.declared_end()?.saturating_sub(last);
        let base = self.feed.demuxer.stream().time_base;
        // A file that is damaged at its end is not given the benefit of the doubt.
        let (some, of) = if self.feed.ends_broken() { (3, 2) } else { (3, 1) };
        (missing > longest.saturating_mul(some) / of)
            .then(|| missing as f64 * f64::from(base.num) / f64::from(base.den))
    }

    /// Whether the file ends before what it declares, as far as that can be told from its packets.
    pub(super) fn is_cut(&self) -> bool {
        self.feed.stop_reason().is_some()
            || self.last_is_cut
            || self.info.declared_frames.is_some_and(|n| self.packets + self.feed.empty() < n)
            || self.missing_s().is_some()
            || self.lacks_end()
            || self.ends_in_an_element()
    }

    /// Whether the picture that came last may have others before it which the file lacks: one of the last of a cut film whose
    /// pictures are reordered and have no times of their own, or one after damage at which reading stopped.
    pub(super) fn is_unplaced(&self) -> bool {
        let delay = usize::try_from(self.feed.demuxer.parameters().video_delay).unwrap_or(0);
        let is_last = delay > 0 && self.stamps.are_counted() && self.order.waiting() <= delay;
        self.draining
            && !self.intra_only
            && (is_last && self.is_cut() || self.feed.is_broken_off() && !self.held.is_empty())
    }

    /// Whether the file is damaged after its last packet, and no length that it declares says that all pictures are there.
    /// A transport stream is cut anywhere by those who record it.
    pub(super) fn ends_in_an_element(&self) -> bool {
        let declares = || self.info.declared_frames.is_some() || self.feed.demuxer.declared_end().is_some();
        let is_certain =
            self.feed.ends_in_pictures() || self.info.container == "matroska,webm" && !declares();
        self.feed.ends_broken() && (!self.feed.declares_length() || is_certain)
    }

    /// Whether the file lacks the mark that its container writes at its end.
    pub(super) fn lacks_end(&self) -> bool {
        if !self.can_reopen {
            return false;
        }
        let is_whole: &dyn Fn(&[u8]) -> bool = match self.info.container.as_str() {
            "ogg" => &ends_as_ogg,
            // Where there are more streams, the index gives the time of any of them.
            "nut" => &|tail| {
                let last =
                    self.stamps.last().map(|(last, _)| last).filter(|_| self.feed.demuxer.streams() == 1);
                last_by_nut(tail).is_some_and(|told| last.is_none_or(|last| last >= told))
            },
            _ => return false,
        };
        tail(&path(&self.info.name)).is_some_and(|bytes| !is_whole(&bytes))
    }

    /// The decoder gives no more: says how the recording ended.
    pub(super) fn finish(&mut self) {
        self.finished = true;
        for lost in self.order.rest() {
            self.hold(lost);
        }
        let declared = self.info.declared_frames;
        let short = declared.is_some_and(|n| self.packets + self.feed.empty() < n);
        let reason = match (self.feed.stop_reason(), declared) {
            (Some(reason), _) => format!("the file cannot be read further ({reason})"),
            (None, Some(n)) if short => {
                format!("the file ends after {} of {n} frames that its header declares", self.packets)
            }
            // Its frames lie end to end, so what is left over is part of one.
            (None, _)
                if self.info.container == "yuv4mpegpipe" && self.feed.demuxer.position() > self.last_byte =>
            {
                "the file ends inside a frame".to_owned()
            }
            _ => match self.missing_s() {
                Some(s) => format!("the file ends {s:.3} s before the length that its header declares"),
                None if self.lacks_end() => "the file lacks the end that its container writes".to_owned(),
                None if self.held.is_empty() && !self.ends_in_an_element() => return,
                // All packets are there by the container's own account: frames that cannot be decoded keep
                // their places to the end.
                None if !self.last_is_cut
                    && !self.ends_in_an_element()
                    && self.next_index + self.ready.len() as u64 > 0
                    && (declared.is_some() || self.feed.demuxer.declared_end().is_some()) =>
                {
                    return self.ready.append(&mut self.held);
                }
                None if self.feed.ends_broken() => {
                    "the file is damaged or cut after its last whole frame".to_owned()
                }
                None => "the last frames cannot be decoded".to_owned(),
            },
        };
        let frames = self.next_index + self.ready.len() as u64;
        let byte =
            self.held.front().map_or(self.last_byte, |h| h.byte).or_else(|| self.feed.demuxer.position());
        self.held.clear();
        self.ending = Ending::Early { frames, byte, reason };
    }
}

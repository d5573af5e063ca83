//! How a recording ended: whole, or before what its header declares.

use super::FfmpegSource;
use crate::frame::Ending;

impl FfmpegSource {
    /// How much of the length that the container declares is not there, s; `None` if it is all there, but for
    /// two of the longest steps between frames.
    fn missing_s(&self) -> Option<f64> {
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
                None if self.held.is_empty() => return,
                // All packets are there by the container's own account: frames that cannot be decoded keep
                // their places to the end.
                None if !self.last_is_cut
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

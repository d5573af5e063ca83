//! Tells where the time of a stream begins.

use ffmpeg_next::ffi;

use super::source::FfmpegSource;

impl FfmpegSource {
    /// The time from which libavformat counts those of other readers of the file, s; `None` where it does not say, or where
    /// it would count otherwise by default.
    pub(crate) fn start_s(&self) -> Option<f64> {
        let demuxer = &self.feed.demuxer;
        let (start, base) = (demuxer.stream().start_time, demuxer.stream().time_base);
        let is_said =
            start != ffi::AV_NOPTS_VALUE && demuxer.has_display_times() && !demuxer.boxes().edits_change_time;
        is_said.then(|| start as f64 * f64::from(base.num) / f64::from(base.den))
    }
}

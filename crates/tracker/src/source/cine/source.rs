//! Reads a Phantom recording: pixels through FFmpeg's demuxer, times from the file's own stamps.
//!
//! Owns: [`CineSource`].

use std::fs::File;
use std::io::Read;
use std::os::unix::fs::FileExt;

use super::header::{Header, TICKS_PER_S};
use crate::error::{Error, Fault, Result};
use crate::frame::{Ending, Frame, FrameSource, RateClaims, RateOrigin, SourceInfo, TimeBase};
use crate::message::Setting;
use crate::source::ffmpeg::FfmpegSource;
use crate::source::{Input, OpenOptions, clock};

/// Most bytes of a header that are read: time stamps and exposures of twenty million frames.
const MOST_HEAD_BYTES: u64 = 256 << 20;
/// The first bytes, and a setup block's greatest length, which is two bytes in the file.
const LEAST_HEAD_BYTES: u64 = 44 + 40 + 65536;

/// The bytes before the table of frames, which hold all that the header says.
fn head(name: &str) -> std::io::Result<Vec<u8>> {
    let file = File::open(crate::name::path(name))?;
    let mut table = [0; 4];
    // A file too short for it is told by the header's reader.
    let end = file.read_exact_at(&mut table, 32).map_or(0, |()| u64::from(u32::from_le_bytes(table)));
    let mut bytes = Vec::new();
    file.take(end.clamp(LEAST_HEAD_BYTES, MOST_HEAD_BYTES)).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// A Phantom recording.
pub struct CineSource {
    inner: FfmpegSource,
    info: SourceInfo,
    /// Ticks of the frames, and the step for those that follow; `None` if times are frame numbers.
    stamps: Option<(Vec<i64>, i64)>,
    frames: u64,
}

impl CineSource {
    /// Opens a CINE file.
    ///
    /// # Errors
    /// [`Error::Source`] if its header or its pixels cannot be read.
    pub(crate) fn open(name: &str, input: &Input, options: &OpenOptions) -> Result<Self> {
        let unreadable = |e: std::io::Error| {
            Error::Source(
                Fault::new(name, format!("the file cannot be read ({e})"))
                    .caused_by(&e)
                    .advice("Check its permissions"),
            )
        };
        let header = Header::parse(&head(name).map_err(unreadable)?, name)?;
        let inner = FfmpegSource::open(name, input, options)?;
        let mut info = inner.info().clone();
        // The header and the stamps say what FFmpeg's demuxer can only guess.
        info.claims = RateClaims::default();
        info.container = "Phantom CINE".into();
        info.declared_frames = Some(header.frames);
        let stamps = match (options.fps, header.stamps()) {
            (Some(_), _) => None,
            (None, Some(stamps)) => {
                info.time_base = TimeBase { numerator: 1, denominator: TICKS_PER_S };
                let rate = TICKS_PER_S as f64 / stamps.step as f64;
                info.rate_hz = Some(rate);
                info.rate_origin = RateOrigin::TimeStamps;
                // A hundredth is far above a clock's error and far below a skipped frame.
                if let Some(header_rate) = header.rate_hz.filter(|h| (h / rate - 1.0).abs() > 0.01) {
                    info.warnings.push(format!(
                        "the header says {header_rate} frames per second, the time stamps {rate:.1}: frames were skipped when it was saved; the stamps are used"
                    ).into());
                }
                if !stamps.replaced.is_empty() {
                    let some: Vec<String> = stamps.replaced.iter().take(5).map(u64::to_string).collect();
                    info.warnings.push(
                        format!(
                            "{} time stamps make no sense and were replaced (frames {}{})",
                            stamps.replaced.len(),
                            some.join(", "),
                            if stamps.replaced.len() > some.len() { ", ..." } else { "" }
                        )
                        .into(),
                    );
                }
                Some((stamps.ticks, stamps.step))
            }
            (None, None) => {
                match header.rate_hz {
                    Some(rate) => {
                        info.time_base = clock::time_base(rate)?;
                        info.rate_origin = RateOrigin::CameraHeader;
                    }
                    None => {
                        info.time_base = TimeBase { numerator: 1, denominator: 1 };
                        info.rate_origin = RateOrigin::Unknown;
                        info.warnings.push("the header gives no rate; give it with " + Setting::Fps);
                    }
                }
                info.rate_hz = header.rate_hz;
                None
            }
        };
        if header.compression == 256 {
            info.warnings.push(
                "10-bit packed samples are the camera's compressed scale, not proportional to light".into(),
            );
        }
        let mut say = |word: &str, value: Option<String>| {
            info.details.extend(value.map(|v| (word.to_owned(), v)));
        };
        say("sensor depth", header.real_bits.map(|b| format!("{b} bit")));
        say("record rate", header.rate_hz.map(|r| format!("{r} Hz")));
        say("exposure", header.exposure_s.map(|s| format!("{s:e} s")));
        say("trigger frame", header.first_frame.checked_neg().map(|i| i.to_string()));
        Ok(Self { inner, info, stamps, frames: 0 })
    }
}

impl FrameSource for CineSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let Some(mut frame) = self.inner.next_frame()? else { return Ok(None) };
        self.frames = frame.index + 1;
        frame.ticks = match &self.stamps {
            Some((ticks, step)) => {
                usize::try_from(frame.index).ok().and_then(|i| ticks.get(i).copied()).unwrap_or_else(|| {
                    let past = (frame.index + 1).saturating_sub(ticks.len() as u64) as i64;
                    ticks.last().copied().unwrap_or(0).saturating_add(step.saturating_mul(past))
                })
            }
            None => frame.index as i64,
        };
        Ok(Some(frame))
    }

    fn ending(&self) -> Ending {
        match (self.inner.ending(), self.info.declared_frames) {
            (Ending::Complete, Some(declared)) if self.inner.is_finished() && self.frames < declared => {
                Ending::Early {
                    frames: self.frames,
                    byte: self.info.size_bytes,
                    reason: format!(
                        "the file ends after {} of {declared} frames that its header declares",
                        self.frames
                    ),
                }
            }
            (ending, _) => ending,
        }
    }

    fn stamps(&mut self) -> Result<Option<(Vec<i64>, bool)>> {
        Ok(self.stamps.as_ref().map(|(ticks, _)| (ticks.clone(), true)))
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        self.inner.sample(count)
    }
}

//! Parses the header of a Phantom CINE file: rate, exposure, and a time stamp for each frame.
//!
//! Owns: [`Header`], [`Stamps`]. Must not: read pixels. All numbers are little-endian; places are checked
//! before they are read, because a header may point anywhere.

use crate::error::{Error, Fault, FaultKind, Place, Result};

/// Ticks of a second in the file's time stamps.
pub const TICKS_PER_S: u64 = 1 << 32;
/// Largest step between time stamps that is believed, in usual steps.
const MAX_STEP: i64 = 1000;

/// Facts of a recording. `None` is unknown.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// Width, px.
    pub width: i32,
    /// Height, px; below 0 if rows go downwards.
    pub height: i32,
    /// Frames in the file.
    pub frames: u64,
    /// Number of the first frame, counted from the trigger.
    pub first_frame: i64,
    /// Rate at which the camera ran; not the saved rate if frames were skipped.
    pub rate_hz: Option<f64>,
    /// Exposure time, s.
    pub exposure_s: Option<f64>,
    /// Bits that the sensor gave.
    pub real_bits: Option<u32>,
    /// 0 as they are, 256 packed 10 bit, 1024 packed 12 bit.
    pub compression: u32,
    /// Time stamps as written, ticks of 2^-32 s since 1970, one for each frame.
    pub stamps: Vec<u64>,
}

/// Time stamps made plausible, ticks of 2^-32 s from the first frame on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stamps {
    /// One for each frame, rising.
    pub ticks: Vec<i64>,
    /// The usual step.
    pub step: i64,
    /// Frames whose stamp made no sense and was replaced by its neighbour's plus the usual step.
    pub replaced: Vec<u64>,
}

fn u16_at(bytes: &[u8], at: u64) -> Option<u16> {
    let at = usize::try_from(at).ok()?;
    Some(u16::from_le_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?))
}

fn u32_at(bytes: &[u8], at: u64) -> Option<u32> {
    let at = usize::try_from(at).ok()?;
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

impl Header {
    /// Reads the header from the file's bytes; `name` is for messages.
    ///
    /// # Errors
    /// [`Error::Source`] naming the byte where something is missing or wrong.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self> {
        let cut = |at: u64| {
            Error::Source(
                Fault::new(name, "the header is cut or points outside the file")
                    .of_kind(FaultKind::Damaged)
                    .at(Place::Byte(at))
                    .advice("Copy the recording again"),
            )
        };
        let word = |at: u64| u32_at(bytes, at).ok_or_else(|| cut(at));
        if bytes.get(..2) != Some(b"CI") {
            return Err(Error::Source(
                Fault::new(name, "not a CINE file").of_kind(FaultKind::Unsupported).at(Place::Byte(0)),
            ));
        }
        let frames = u64::from(word(20)?);
        let first_frame = i64::from(word(16)? as i32);
        let image_header = u64::from(word(24)?);
        let setup = u64::from(word(28)?);
        let offsets = u64::from(word(32)?);
        let width = word(image_header + 4)? as i32;
        let height = word(image_header + 8)? as i32;
        let compression = word(image_header + 16)?;
        if width <= 0 || height == 0 || height == i32::MIN {
            return Err(Error::Source(
                Fault::new(name, format!("a picture of {width} x {height} px"))
                    .of_kind(FaultKind::Damaged)
                    .at(Place::Byte(image_header + 4))
                    .advice("Copy the recording again"),
            ));
        }
        // The setup block grew over the years; only what it says it holds is read.
        let length = u64::from(u16_at(bytes, setup + 142).ok_or_else(|| cut(setup + 142))?);
        let field = |at: u64| (at + 4 <= length).then(|| u32_at(bytes, setup + at)).flatten();
        let rate = field(768).filter(|r| *r > 0).map(f64::from);
        let old_rate = u16_at(bytes, setup).filter(|r| *r > 0).map(f64::from);
        let mut header = Self {
            width,
            height,
            frames,
            first_frame,
            rate_hz: rate.or(old_rate),
            exposure_s: field(772).filter(|e| *e > 0).map(|e| f64::from(e) * 1e-6),
            real_bits: field(896).filter(|b| (1..=16).contains(b)),
            compression,
            stamps: Vec::new(),
        };
        header.read_tagged(bytes, setup + length, offsets);
        Ok(header)
    }

    /// Blocks between the setup and the table of frames: length, type, data.
    fn read_tagged(&mut self, bytes: &[u8], mut at: u64, end: u64) {
        while at + 8 <= end {
            let (Some(size), Some(kind)) = (u32_at(bytes, at), u16_at(bytes, at + 4)) else { return };
            if size < 8 {
                return;
            }
            let next = at + u64::from(size);
            let data = usize::try_from(at + 8).ok().zip(usize::try_from(next.min(end)).ok());
            let Some(data) = data.and_then(|(a, b)| bytes.get(a..b)) else { return };
            let count = usize::try_from(self.frames).unwrap_or(usize::MAX);
            match kind {
                1002 => {
                    let stamp = |c: &[u8]| {
                        let part =
                            |i: usize| u64::from(u32::from_le_bytes([c[i], c[i + 1], c[i + 2], c[i + 3]]));
                        // The lowest two bits are flags.
                        part(4) << 32 | (part(0) & !3)
                    };
                    self.stamps = data.chunks_exact(8).take(count).map(stamp).collect();
                }
                1003 => {
                    let first = data.first_chunk::<4>().map(|c| f64::from(u32::from_le_bytes(*c)));
                    let exposure = first.filter(|e| *e > 0.0).map(|e| e / TICKS_PER_S as f64);
                    self.exposure_s = exposure.or(self.exposure_s);
                }
                _ => {}
            }
            at = next;
        }
    }

    /// The time stamps, made plausible; `None` if there are none or no two of them make sense.
    pub fn stamps(&self) -> Option<Stamps> {
        plausible(&self.stamps)
    }
}

/// Times from the first frame on. A stamp is believed if it follows its neighbour by more than 0 and at most
/// [`MAX_STEP`] times the usual step, which is the median of all that rise; going both ways from the first
/// pair of frames that are the usual step apart.
pub fn plausible(stamps: &[u64]) -> Option<Stamps> {
    let differences: Vec<i64> = stamps.windows(2).map(|w| w[1].wrapping_sub(w[0]) as i64).collect();
    let mut rising: Vec<i64> = differences.iter().copied().filter(|d| *d > 0).collect();
    rising.sort_unstable();
    let step = *rising.get(rising.len() / 2)?;
    let anchor =
        differences.iter().position(|d| *d >= step - step / 2 && *d <= step.saturating_add(step / 2))?;
    let believed = |d: i64| d > 0 && d <= step.saturating_mul(MAX_STEP);
    // Relative to the anchor's stamp, so that sums cannot overflow unseen.
    let mut ticks = vec![0i64; stamps.len()];
    let mut replaced = Vec::new();
    let from_anchor = |i: usize| stamps[i].wrapping_sub(stamps[anchor]) as i64;
    for i in anchor + 1..stamps.len() {
        let own = from_anchor(i);
        let good = own.checked_sub(ticks[i - 1]).is_some_and(believed);
        ticks[i] = if good { own } else { ticks[i - 1].checked_add(step)? };
        if !good {
            replaced.push(i as u64);
        }
    }
    for i in (0..anchor).rev() {
        let own = from_anchor(i);
        let good = ticks[i + 1].checked_sub(own).is_some_and(believed);
        ticks[i] = if good { own } else { ticks[i + 1].checked_sub(step)? };
        if !good {
            replaced.push(i as u64);
        }
    }
    let first = ticks[0];
    for t in &mut ticks {
        *t = t.checked_sub(first)?;
    }
    replaced.sort_unstable();
    Some(Stamps { ticks, step, replaced })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_stamps_stay_and_bad_ones_are_replaced() {
        let good: Vec<u64> = (0..10).map(|i| 5_000_000_000_000 + i * 1000).collect();
        let all = plausible(&good).unwrap();
        assert_eq!((all.step, all.replaced.len(), all.ticks[9]), (1000, 0, 9000));
        for bad in [0usize, 4, 9] {
            for value in [0, 1, u64::MAX, good[bad] + 25_000_000 * TICKS_PER_S] {
                let mut stamps = good.clone();
                stamps[bad] = value;
                let mended = plausible(&stamps).unwrap();
                assert_eq!(mended.replaced, vec![bad as u64], "{bad} {value}");
                assert_eq!(mended.ticks, all.ticks, "{bad} {value}");
            }
        }
    }

    #[test]
    fn skipped_frames_keep_their_times() {
        let stamps = [0, 1000, 2000, 12000, 13000, 14000].map(|t| t + 77_000_000);
        let mended = plausible(&stamps).unwrap();
        assert!(mended.replaced.is_empty());
        assert_eq!(mended.ticks, vec![0, 1000, 2000, 12000, 13000, 14000]);
    }

    #[test]
    fn no_stamps_are_none() {
        assert_eq!(plausible(&[]), None);
        assert_eq!(plausible(&[5]), None);
        assert_eq!(plausible(&[7; 20]), None);
    }
}

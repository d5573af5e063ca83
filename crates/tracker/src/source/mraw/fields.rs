//! Holds the facts of a Photron header, whichever of its two forms it is in.
//!
//! Owns: [`Header`], [`Packing`], the names of the entries. Must not: open files, or know how a form is written.

use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::{PixelFormat, TimeBase};
use crate::message::Message;
use crate::timing::rational;

/// Position of the significant bits of a sample in its 16 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Side {
    /// At the bottom: values as they are.
    #[default]
    Lower,
    /// At the top: values are multiples.
    Higher,
}

/// Facts of a recording, as written by Photron's viewer. `None` is unknown.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// Bits that a pixel takes in the file.
    pub color_bit: u32,
    /// Bits that the sensor gave.
    pub effective_depth: Option<u32>,
    /// Where they lie.
    pub side: Side,
    /// `Mono`, `Raw`, `Bayer`, `Color`...
    pub color_type: Option<String>,
    /// `MRaw`, or another format that the viewer exports.
    pub file_format: Option<String>,
    /// Frames in the file.
    pub total_frames: Option<u64>,
    /// Frames per second at which the camera ran.
    pub record_rate_hz: Option<f64>,
    /// Every how many frames one was saved; at least 1.
    pub save_step: u64,
    /// Number of the first saved frame in the recording.
    pub start_frame: Option<i64>,
    /// Number of the frame at the trigger.
    pub trigger_frame: Option<i64>,
    /// Exposure time, s.
    pub exposure_s: Option<f64>,
    /// Camera.
    pub camera: Option<String>,
    /// Day and time as written.
    pub recorded: Option<String>,
    /// The user's comment.
    pub comment: Option<String>,
    /// Entries that make no sense and were not used.
    pub warnings: Vec<Message>,
}

/// Layout of the frames in the pixel file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packing {
    /// Format of the samples in the file.
    pub format: PixelFormat,
    /// Significant bits of the samples handed out.
    pub depth_bits: u32,
    /// Bits by which samples are moved down when they are handed out; 0 for all but 16-bit with side Higher.
    pub shift: u32,
    /// Bytes of a frame.
    pub frame_bytes: u64,
}

/// Under which names a form of header keeps its facts.
pub(super) struct Names {
    pub width: &'static str,
    pub height: &'static str,
    pub color_bit: &'static str,
    pub depth: &'static str,
    pub side: &'static str,
    pub color_type: &'static str,
    pub file_format: &'static str,
    pub total_frames: &'static str,
    pub record_rate: &'static str,
    pub save_step: &'static str,
    pub start_frame: &'static str,
    /// `None` where frames are numbered from the trigger.
    pub trigger_frame: Option<&'static str>,
    pub exposure_ns: &'static str,
    pub shutter: &'static str,
    /// Exposure in s of what stands under `shutter`.
    pub shutter_s: fn(f64) -> f64,
    pub camera: &'static str,
    pub recorded: [&'static str; 2],
    pub comment: &'static str,
}

impl Header {
    /// The header whose entries `get` finds by their names; `name` is the file's, for messages.
    ///
    /// # Errors
    /// [`Error::Source`] if width, height or bits are missing.
    pub(super) fn of<'a>(
        names: &Names,
        get: impl Fn(&str) -> Option<&'a str>,
        mut warnings: Vec<Message>,
        name: &str,
    ) -> Result<Self> {
        let get = |key: &str| get(key).map(str::trim).filter(|v| !v.is_empty());
        let mut whole = |key: &str| get(key).and_then(|v| number(key, v, &mut warnings));
        let (width, height, bits) = (whole(names.width), whole(names.height), whole(names.color_bit));
        let depth = whole(names.depth);
        let total = whole(names.total_frames);
        let step = whole(names.save_step);
        let start_frame = whole(names.start_frame);
        let trigger_frame = match names.trigger_frame {
            Some(key) => whole(key),
            None => start_frame.map(|_| 0),
        };
        let exposure_ns = whole(names.exposure_ns).filter(|n| *n > 0);
        let mut above_zero = |key: &str| get(key).and_then(|v| fraction(key, v, &mut warnings));
        let record_rate_hz = above_zero(names.record_rate);
        let shutter_s = above_zero(names.shutter).map(names.shutter_s);
        let positive = |value: Option<i64>, key: &str| {
            value.and_then(|v| u32::try_from(v).ok()).filter(|v| *v > 0).ok_or_else(|| missing(name, key))
        };
        let save_step = step.unwrap_or(1);
        if save_step < 1 {
            warnings.push(format!("{}: {save_step} makes no sense; taken as 1", names.save_step).into());
        }
        let higher = get(names.side).is_some_and(|s| s.eq_ignore_ascii_case("higher"));
        let recorded = names.recorded.into_iter().filter_map(get).collect::<Vec<_>>().join(" ");
        Ok(Self {
            width: positive(width, names.width)?,
            height: positive(height, names.height)?,
            color_bit: positive(bits, names.color_bit)?,
            effective_depth: depth.and_then(|d| u32::try_from(d).ok()),
            side: if higher { Side::Higher } else { Side::Lower },
            color_type: get(names.color_type).and_then(short),
            file_format: get(names.file_format).and_then(short),
            total_frames: total.and_then(|n| u64::try_from(n).ok()),
            record_rate_hz,
            save_step: save_step.max(1).unsigned_abs(),
            start_frame,
            trigger_frame,
            exposure_s: exposure_ns.map(|n| n as f64 * 1e-9).or(shutter_s),
            camera: get(names.camera).and_then(short),
            recorded: short(&recorded),
            comment: get(names.comment).and_then(short),
            warnings,
        })
    }

    /// The layout of frames in the pixel file.
    ///
    /// # Errors
    /// [`Error::Source`] for bits that are not read or a frame that no file can hold.
    pub fn packing(&self, name: &str) -> Result<Packing> {
        let format = match self.color_bit {
            8 => PixelFormat::Gray8,
            10 => PixelFormat::Packed10,
            12 => PixelFormat::Packed12,
            16 => PixelFormat::Gray16,
            bits => {
                return Err(Error::Source(
                    Fault::new(
                        name,
                        format!("{bits} bits per pixel are not read, only 8, 10, 12 and 16 are"),
                    )
                    .of_kind(FaultKind::Unsupported)
                    .at(Place::Key("color bit".into()))
                    .advice("Export the recording with one of these"),
                ));
            }
        };
        let bits = u128::from(self.width) * u128::from(self.height) * u128::from(self.color_bit);
        let frame_bytes =
            u64::try_from(bits.div_ceil(8)).ok().filter(|b| i64::try_from(*b).is_ok()).ok_or_else(|| {
                Error::Source(
                    Fault::new(name, format!("a picture of {} x {} px", self.width, self.height))
                        .of_kind(FaultKind::Damaged)
                        .at(Place::Key("image size".into()))
                        .advice("Export the recording again; the header is wrong"),
                )
            })?;
        // An 8-bit file of a 12-bit sensor holds 8 of the 12; a 16-bit file holds them all.
        let effective = self.effective_depth.filter(|d| (1..=self.color_bit).contains(d));
        let (depth_bits, shift) = match (format, effective, self.side) {
            (PixelFormat::Gray16, Some(d), Side::Higher) if d >= 8 => (d, 16 - d),
            (PixelFormat::Gray16, Some(d), Side::Lower) if d >= 8 => (d, 0),
            _ => (self.color_bit, 0),
        };
        Ok(Packing { format, depth_bits, shift, frame_bytes })
    }

    /// Seconds per saved frame: save step over record rate. `None` if the header gives no rate.
    pub fn time_base(&self) -> Option<TimeBase> {
        let rate = self.record_rate_hz.filter(|r| r.is_finite() && *r > 0.0 && *r <= 1e9)?;
        let (p, q) = rational(rate);
        Some(TimeBase { numerator: q.checked_mul(self.save_step.max(1))?, denominator: p })
    }

    /// Index in the file of the frame at the trigger, below 0 if it lies before the first saved one.
    pub fn trigger_index(&self) -> Option<i64> {
        let ahead = self.trigger_frame?.checked_sub(self.start_frame.unwrap_or(0))?;
        ahead.checked_div_euclid(i64::try_from(self.save_step.max(1)).ok()?)
    }
}

/// A whole number of a header, which may be written `75.0`, or a note that it is none.
fn number(key: &str, text: &str, warnings: &mut Vec<Message>) -> Option<i64> {
    let whole = text.parse::<i128>().ok().or_else(|| {
        // Above 2^53 a float no longer counts in ones.
        let value = text.parse::<f64>().ok()?;
        (value.fract() == 0.0 && value.abs() < 9e15).then_some(value as i128)
    });
    let value = whole.and_then(|v| i64::try_from(v).ok());
    if value.is_none() {
        warnings.push(format!("{key}: {text:?} is not a number that makes sense; not used").into());
    }
    value
}

/// A number that may be a fraction such as `1/15371`.
fn fraction(key: &str, text: &str, warnings: &mut Vec<Message>) -> Option<f64> {
    let value = match text.split_once('/') {
        Some((a, b)) => a.trim().parse::<f64>().ok().zip(b.trim().parse::<f64>().ok()).map(|(a, b)| a / b),
        None => text.parse::<f64>().ok(),
    };
    let value = value.filter(|v| v.is_finite() && *v > 0.0);
    if value.is_none() {
        warnings.push(format!("{key}: {text:?} is not a number above 0; not used").into());
    }
    value
}

/// The error for a key without which the pixels cannot be read.
fn missing(name: &str, key: &str) -> Error {
    Error::Source(
        Fault::new(name, "it is not in the header, or not a number")
            .of_kind(FaultKind::Damaged)
            .at(Place::Key(key.into()))
            .advice("Export the recording again; the header is not complete"),
    )
}

/// Text cut to a length that fits a report.
fn short(text: &str) -> Option<String> {
    let text: String = text.trim().chars().filter(|c| !c.is_control()).take(200).collect();
    (!text.is_empty()).then_some(text)
}

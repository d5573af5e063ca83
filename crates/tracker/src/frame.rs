//! Defines the frame, its time, and the trait of whatever frames come from.
//!
//! Owns: [`Frame`], [`PixelFormat`], [`TimeBase`], [`SourceInfo`], [`RateClaims`], [`Ending`], the trait [`FrameSource`].
//! Must not: decode, or look at a pixel's value beyond unpacking it.
//!
//! Image coordinates: x right, y down, pixel centres at integers, the first pixel is (0, 0).

use std::fmt;

use crate::error::{Error, Fault, Result};
use crate::gaps::{Gaps, Reason};
use crate::message::Message;
use crate::pixel_aspect::{AspectOrigin, PixelAspect};
use crate::pixel_damage::PixelDamage;

/// Storage of the samples of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PixelFormat {
    /// One byte per pixel.
    Gray8,
    /// Two bytes per pixel, little-endian, value in the lower bits.
    Gray16,
    /// Four pixels in five bytes, most significant bits first (Photron, Phantom P10).
    /// Packing runs on over the ends of rows; see [`Frame::stride`].
    Packed10,
    /// Two pixels in three bytes, most significant bits first (Photron).
    /// Packing runs on over the ends of rows; see [`Frame::stride`].
    Packed12,
}

impl PixelFormat {
    /// Bits that one pixel takes in memory.
    pub fn bits_per_pixel(self) -> u32 {
        match self {
            PixelFormat::Gray8 => 8,
            PixelFormat::Gray16 => 16,
            PixelFormat::Packed10 => 10,
            PixelFormat::Packed12 => 12,
        }
    }
}

/// Seconds per tick as a fraction: a time is `ticks * numerator / denominator`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeBase {
    /// Numerator, above 0.
    pub numerator: u64,
    /// Denominator, above 0.
    pub denominator: u64,
}

impl TimeBase {
    /// The time of `ticks` in s.
    pub fn seconds(self, ticks: i64) -> f64 {
        // The product is exact in i128, so only the last division rounds.
        (i128::from(ticks) * i128::from(self.numerator)) as f64 / self.denominator as f64
    }
}

/// Bytes that a frame lends out: a decoder's buffer, a part of a file, a vector.
pub trait Bytes: Send + Sync {
    /// The bytes, the same at every call; none where there is a fault.
    fn bytes(&self) -> &[u8];

    /// The fault that kept the bytes from being read, for planes that are read when they are first asked for.
    fn fault(&self) -> Option<&Fault> {
        None
    }
}

impl Bytes for Vec<u8> {
    fn bytes(&self) -> &[u8] {
        self
    }
}

/// One frame of a recording: its place, its time, and one plane of brightness.
pub struct Frame {
    /// Index in the recording, from 0, in display order.
    pub index: u64,
    /// Time in ticks of the source's time base.
    pub ticks: i64,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Bytes from the start of one row to the start of the next. For packed formats the frame is one run of
    /// bits, and `stride * 8 == width * bits` holds only if rows end on whole bytes; then `stride` is 0.
    pub stride: usize,
    /// How samples are stored.
    pub format: PixelFormat,
    /// Significant bits of a sample: 8 for 8-bit, 12 for a 12-bit camera stored in 16.
    pub depth_bits: u32,
    /// The plane; `None` for a frame that could not be decoded. It still has its index and time.
    pub plane: Option<Box<dyn Bytes>>,
    /// Blue and red colour differences, a byte a pixel about 128, row by row without gaps; `None` where the recording has no
    /// colour or nobody asked for it.
    pub colour: Option<[Vec<u8>; 2]>,
}

impl Frame {
    /// The bytes of the plane; `None` for a frame that could not be decoded.
    ///
    /// # Errors
    /// [`Error::Source`] where they cannot be read from the recording any more.
    pub fn bytes(&self) -> Result<Option<&[u8]>> {
        let Some(plane) = &self.plane else { return Ok(None) };
        let bytes = plane.bytes();
        plane.fault().map_or(Ok(Some(bytes)), |fault| Err(Error::Source(fault.clone())))
    }

    /// Bytes that its samples take without gaps between rows.
    pub fn size_bytes(&self) -> usize {
        self.width as usize * self.height as usize * self.format.bits_per_pixel() as usize / 8
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Frame")
            .field("index", &self.index)
            .field("ticks", &self.ticks)
            .field("size", &(self.width, self.height))
            .field("format", &self.format)
            .field("depth_bits", &self.depth_bits)
            .field("decoded", &self.plane.is_some())
            .finish_non_exhaustive()
    }
}

/// Origin of a recording's rate; the strongest claim first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RateOrigin {
    /// The user said it (`--fps`); it replaces all time stamps.
    User,
    /// Time stamps of the single frames.
    TimeStamps,
    /// The camera's header: record rate / save step.
    CameraHeader,
    /// The camera's own tag of the rate at which it took the frames, in a file that may play slower.
    CaptureTag,
    /// The container's claim, often a player's speed and not the camera's.
    Container,
    /// Nothing gives it; times are frame numbers.
    Unknown,
}

/// Claims of a recording about its rate, beside the time stamps of its frames.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RateClaims {
    /// Rates that the container gives, the likeliest first: frames per second as numerator and denominator, both
    /// above 0.
    pub container: Vec<[u64; 2]>,
    /// The rate at which the camera took the frames, by its own tag.
    pub capture: Option<CaptureClaim>,
    /// The camera's maker and model.
    pub camera: Option<String>,
}

/// A camera's tag of its capture rate.
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureClaim {
    /// The tag's name.
    pub tag: String,
    /// Frames per second, finite and above 0.
    pub rate_hz: f64,
}

/// Facts of a recording that are known before it is read through. `None` is unknown.
#[derive(Debug, Clone)]
pub struct SourceInfo {
    /// The name as the user gave it, `-` for standard input.
    pub name: String,
    /// Container, e.g. `mov,mp4,m4a`, `Photron MRAW`.
    pub container: String,
    /// Codec or packing, e.g. `h264`, `packed 12 bit`.
    pub codec: String,
    /// Width in pixels as handed to detection (after rotation and cropping).
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Width to height of a pixel as handed to detection.
    pub pixel_aspect: PixelAspect,
    /// Where that comes from.
    pub pixel_aspect_origin: AspectOrigin,
    /// Format of the frames handed out.
    pub format: PixelFormat,
    /// Significant bits of a sample.
    pub depth_bits: u32,
    /// Whether damage to its pixels is noticed.
    pub pixel_damage: PixelDamage,
    /// Frames that the header declares.
    pub declared_frames: Option<u64>,
    /// Seconds per tick.
    pub time_base: TimeBase,
    /// Frames per second of recorded time.
    pub rate_hz: Option<f64>,
    /// Where the rate comes from.
    pub rate_origin: RateOrigin,
    /// Other statements of the recording about its rate.
    pub claims: RateClaims,
    /// Whether pixels were converted (no luma plane in the recording), and from what.
    pub converted_from: Option<String>,
    /// Bytes of the file or files, if they are files.
    pub size_bytes: Option<u64>,
    /// Other statements of the recording, word and value: camera, exposure, trigger frame, range of values.
    pub details: Vec<(String, String)>,
    /// Warnings to the user: implausible stamps replaced, gaps in numbering, a size that does not match.
    pub warnings: Vec<Message>,
}

impl SourceInfo {
    /// A frame of the recording without pixels so far. Its rows follow one another without padding; `stride` is 0 where they do
    /// not end on whole bytes.
    pub(crate) fn frame(&self, index: u64, ticks: i64) -> Frame {
        let row_bits = self.width as usize * self.format.bits_per_pixel() as usize;
        Frame {
            index,
            ticks,
            width: self.width,
            height: self.height,
            stride: if row_bits.is_multiple_of(8) { row_bits / 8 } else { 0 },
            format: self.format,
            depth_bits: self.depth_bits,
            plane: None,
            colour: None,
        }
    }
}

/// Ending of a recording, known once [`FrameSource::next_frame`] gave `None`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ending {
    /// All that was declared was read.
    Complete,
    /// Good frames, then damage: everything before it was handed out.
    Early {
        /// Frames handed out.
        frames: u64,
        /// Byte offset of the damage, if known.
        byte: Option<u64>,
        /// The decoder's reason.
        reason: String,
    },
}

/// A recording that is read forward, once. Never sought by frame number.
pub trait FrameSource: Send {
    /// Facts of the recording.
    fn info(&self) -> &SourceInfo;

    /// The next frame in display order, or `None` at the end; then ask [`FrameSource::ending`].
    ///
    /// # Errors
    /// Only where nothing more can be read and nothing was: a damaged frame in the middle comes as a frame
    /// without a plane, a damaged end as `None` with [`Ending::Early`].
    fn next_frame(&mut self) -> Result<Option<Frame>>;

    /// Ending of the recording. Before its end: `Complete`.
    fn ending(&self) -> Ending;

    /// Time stamps of the frames in display order, without decoding any, and whether these are all: of a long
    /// recording only the first are looked at. `None` where they are not to be had so. Does not disturb
    /// [`FrameSource::next_frame`].
    ///
    /// # Errors
    /// Where the recording cannot be read at all.
    fn stamps(&mut self) -> Result<Option<(Vec<i64>, bool)>> {
        Ok(None)
    }

    /// Frames that are not there between those that were handed out so far.
    fn gaps(&self) -> Gaps {
        Gaps::default()
    }

    /// The reasons for which the first of the frames handed out without a plane have none, beyond that they cannot be decoded.
    fn reasons(&self) -> Vec<Reason> {
        Vec::new()
    }

    /// Up to `count` decoded frames spread over the recording, for learning thresholds and noise; their
    /// indices mean nothing. Does not disturb [`FrameSource::next_frame`]. A pipe gives its first frames.
    ///
    /// # Errors
    /// Where the recording cannot be read at all.
    fn sample(&mut self, count: usize) -> Result<Vec<Frame>>;
}

//! Parses the header of a NorPix sequence (`.seq`, StreamPix).
//!
//! Owns: [`Header`], [`Form`], [`is_norpix`]. From public readers (pims' `norpix_reader`, Dollar's `seqReaderPlugin`,
//! `ReadJpegSEQ`): all numbers are little-endian; pixels begin at byte 1024, or at 8192 from version 5 on where they are
//! not compressed; each picture is followed by its time. Must not: read pixels.

use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::PixelFormat;
use crate::source::raw::Stored;

/// Bytes of the header that are read.
pub const HEADER_BYTES: usize = 1024;
/// Version from which on uncompressed pixels begin at another place (StreamPix 6).
const ALIGNED_VERSION: u32 = 5;
const ALIGNED_START: u64 = 8192;

/// Whether a file begins as a sequence does: `0xFEED` and `Norpix seq` in UTF-16.
pub fn is_norpix(first_bytes: &[u8]) -> bool {
    first_bytes.starts_with(b"\xed\xfe\0\0N\0o\0r\0p\0i\0x\0")
}

/// Storage of the pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// As samples, all of the same size.
    Raw {
        /// How they lie in the file.
        stored: Stored,
        /// How they are handed out.
        format: PixelFormat,
        /// Significant bits of a sample.
        depth_bits: u32,
        /// Bytes from one row to the next, as handed out.
        stride: usize,
    },
    /// As JPEG pictures, each with its length before it.
    Jpeg,
}

/// Facts of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// How pictures are stored.
    pub form: Form,
    /// Whether the sensor has a colour mosaic.
    pub mosaic: bool,
    /// Frames that the header declares; 0 where the recording was not closed.
    pub declared: u64,
    /// Bytes of a picture.
    pub image_bytes: u64,
    /// Bytes from one picture to the next, where they are not compressed.
    pub step_bytes: u64,
    /// Where the first picture begins.
    pub start: u64,
    /// Whether times have microseconds; else milliseconds.
    pub has_microseconds: bool,
    /// The rate that the recorder was set to, frames per second.
    pub rate_hz: Option<f64>,
    /// The user's own description.
    pub description: Option<String>,
    /// The header's version.
    pub version: u32,
}

/// The name of an image format that is not read, by its number.
fn format_name(number: u32) -> &'static str {
    match number {
        1 | 2 => "PNG pictures",
        123..=125 | 135 | 136 | 905 | 906 => "packed colours",
        131..=134 => "packed samples",
        300 => "colours in planes",
        600 | 610 | 700 | 800 | 900 => "YUV",
        _ => "an unknown format",
    }
}

fn compression_name(number: u32) -> &'static str {
    match number {
        2 | 5 => "run lengths",
        3 | 6 => "Huffman's code",
        4 | 7 => "LZ",
        8 => "H.264",
        9 => "wavelets",
        _ => "an unknown method",
    }
}

impl Header {
    /// Reads the first [`HEADER_BYTES`] of a file; `name` is for messages.
    ///
    /// # Errors
    /// [`Error::Source`] naming the byte where something is missing, wrong, or not read here.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self> {
        let fault = |at: usize, problem: String, kind: FaultKind| {
            let advice = if kind == FaultKind::Damaged { COPY } else { EXPORT };
            Error::Source(Fault::new(name, problem).of_kind(kind).at(Place::Byte(at as u64)).advice(advice))
        };
        let bytes: &[u8; HEADER_BYTES] = bytes.first_chunk().ok_or_else(|| {
            fault(bytes.len(), format!("the header is cut; it has {HEADER_BYTES} bytes"), FaultKind::Damaged)
        })?;
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let (version, width, height) = (word(28), word(548), word(552));
        let (bits, real_bits, image_bytes, number) = (word(556), word(560), u64::from(word(564)), word(568));
        let (declared, step_bytes, compression) = (u64::from(word(572)), u64::from(word(580)), word(620));
        let rate = f64::from_le_bytes([584, 585, 586, 587, 588, 589, 590, 591].map(|at| bytes[at]));
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || pixels > 1 << 40 {
            return Err(fault(548, format!("a picture of {width} x {height} px"), FaultKind::Damaged));
        }
        let is_jpeg = compression == 1 || matches!(number, 102 | 103 | 201);
        if compression > 1 {
            let problem =
                format!("pictures are compressed by {}, which is not read", compression_name(compression));
            return Err(fault(620, problem, FaultKind::Unsupported));
        }
        let form = if is_jpeg {
            Form::Jpeg
        } else {
            raw(number, bits, real_bits, [u64::from(width), u64::from(height)], image_bytes)
                .map_err(|problem| fault(556, problem, FaultKind::Unsupported))?
        };
        let has_microseconds = version >= ALIGNED_VERSION;
        let aligned = has_microseconds && !is_jpeg;
        let header = Self {
            width,
            height,
            form,
            mosaic: matches!(number, 101 | 103 | 113 | 115),
            declared,
            image_bytes,
            step_bytes,
            start: if aligned { ALIGNED_START } else { HEADER_BYTES as u64 },
            has_microseconds,
            rate_hz: (rate.is_finite() && rate > 0.0 && rate <= 1e9).then_some(rate),
            description: text(&bytes[36..548]),
            version,
        };
        if !is_jpeg && step_bytes < image_bytes + header.stamp_bytes() {
            let problem = format!(
                "{step_bytes} bytes from picture to picture do not hold {image_bytes} bytes of samples and a time"
            );
            return Err(fault(580, problem, FaultKind::Damaged));
        }
        Ok(header)
    }

    /// Bytes of a picture's time.
    pub fn stamp_bytes(&self) -> u64 {
        if self.has_microseconds { 8 } else { 6 }
    }

    /// A time in microseconds since 1970.
    pub fn stamp_us(&self, bytes: [u8; 8]) -> u64 {
        let [a, b, c, d, e, f, g, h] = bytes;
        let us = if self.has_microseconds { u64::from(u16::from_le_bytes([g, h])) } else { 0 };
        u64::from(u32::from_le_bytes([a, b, c, d])) * 1_000_000
            + u64::from(u16::from_le_bytes([e, f])) * 1000
            + us
    }
}

const COPY: &str = "Copy the recording again";
const EXPORT: &str = "Export it from StreamPix as uncompressed AVI or as TIFF files";

/// The layout of uncompressed samples of an image format; an error is a clause.
fn raw(
    number: u32,
    bits: u32,
    real_bits: u32,
    [width, height]: [u64; 2],
    image_bytes: u64,
) -> Result<Form, String> {
    let (stored, format, depth_bits, sample_bytes) = match (number, bits) {
        (100 | 101 | 112..=115, 8) => (Stored::Plain, PixelFormat::Gray8, 8, 1),
        (100 | 101 | 112..=115, 16) => {
            let depth = if (9..=16).contains(&real_bits) { real_bits } else { 16 };
            let (shift, big_endian) = (if number >= 112 { 16 - depth } else { 0 }, number >= 114);
            let stored = match (shift, big_endian) {
                (0, false) => Stored::Plain,
                _ => Stored::Words { big_endian, shift, inverted: false },
            };
            (stored, PixelFormat::Gray16, depth, 2)
        }
        (200, 24) | (400, 24) => {
            (Stored::Colour { bytes: 3, red_first: number == 400 }, PixelFormat::Gray8, 8, 3)
        }
        (500, 32) => (Stored::Colour { bytes: 4, red_first: false }, PixelFormat::Gray8, 8, 4),
        (100 | 101 | 112..=115 | 200 | 400 | 500, _) => {
            return Err(format!("pixels of {bits} bits in image format {number} are not read"));
        }
        _ => {
            return Err(format!(
                "pictures are {} (image format {number}), which is not read",
                format_name(number)
            ));
        }
    };
    let row = width * sample_bytes;
    let needed = row * height;
    let is_colour = matches!(stored, Stored::Colour { .. });
    if image_bytes < needed || is_colour && image_bytes != needed {
        return Err(format!(
            "{width} x {height} px of {bits} bits need {needed} bytes, and a picture has {image_bytes}"
        ));
    }
    // Rows may be longer than what they show.
    let stride = if image_bytes.is_multiple_of(height) { image_bytes / height } else { row };
    let stride = if is_colour { width } else { stride };
    Ok(Form::Raw { stored, format, depth_bits, stride: stride as usize })
}

/// UTF-16 or, in older files, single bytes, up to the first zero.
fn text(bytes: &[u8]) -> Option<String> {
    let words: Vec<u16> =
        bytes.as_chunks::<2>().0.iter().map(|p| u16::from_le_bytes(*p)).take_while(|w| *w != 0).collect();
    let text = match bytes {
        [a, b, ..] if *a != 0 && *b != 0 => {
            String::from_utf8_lossy(bytes).split('\0').next().map(str::to_owned)
        }
        _ => Some(String::from_utf16_lossy(&words)),
    };
    text.map(|t| t.trim().to_owned()).filter(|t| !t.is_empty())
}

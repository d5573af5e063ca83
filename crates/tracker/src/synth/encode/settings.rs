//! Defines how films and images are encoded, and what is said where they cannot be.

use std::io::ErrorKind;

use crate::error::{Error, Fault};
use crate::frame::TimeBase;
use crate::message::Setting;
use crate::pixel_aspect::PixelAspect;
use crate::setting_words::words;

/// Codec of a video file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Codec {
    /// H.264 by libx264, 8 bit, lossy: small, and plays everywhere.
    H264,
    /// FFV1, 8 to 16 bit, without loss.
    Ffv1,
    /// JPEG pictures in a row, 8 bit, lossy.
    Mjpeg,
    /// Uncompressed gray, 8 bit.
    Raw,
}

words!(Codec, Setting::Codec, [
    "h264" => Codec::H264,
    "ffv1" => Codec::Ffv1,
    "mjpeg" => Codec::Mjpeg,
    "raw" => Codec::Raw,
]);

/// Settings of a writer: frames and file.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoSettings {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// Significant bits per sample; above 8, frames have two bytes per sample, little-endian.
    pub depth_bits: u32,
    /// Width to height of a pixel.
    pub pixel_aspect: PixelAspect,
    /// Seconds per frame.
    pub time_base: TimeBase,
    /// Codec.
    pub codec: Codec,
    /// H.264: constant rate factor, 0 (no loss) to 51; MJPEG: quantiser, 1 (best) to 31. `None` is 12 and 2.
    pub quality: Option<u32>,
    /// H.264: x264's preset; `None` is `medium`.
    pub x264_preset: Option<String>,
    /// H.264: a plane of brightness and nothing else. Smaller, but some players need colour planes, which otherwise
    /// are there and empty.
    pub gray_only: bool,
}

/// Kinds of image files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageKind {
    /// PNG, 8 or 16 bit.
    Png,
    /// TIFF, 8 or 16 bit.
    Tiff,
    /// BMP, 8 bit.
    Bmp,
}

pub(super) fn fault(name: &str, problem: String, advice: &str) -> Error {
    Error::Film(Fault::new(name, problem).advice(advice))
}

/// A file that cannot be written.
pub(in crate::synth) fn cannot_write(name: &str, e: &std::io::Error) -> Error {
    let advice = match e.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "Free some space",
        ErrorKind::InvalidFilename => "Choose a shorter name",
        _ => "Check that the folder exists and may be written to",
    };
    fault(name, format!("it cannot be written ({e})"), advice)
}

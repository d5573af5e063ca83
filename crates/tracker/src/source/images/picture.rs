//! Holds a decoded picture and turns it into a frame.
//!
//! Owns: [`Picture`]. Must not: decode.

use crate::error::Result;
use crate::frame::{Frame, PixelFormat, RateOrigin, SourceInfo, TimeBase};
use crate::message::{Message, Setting};
use crate::source::{OpenOptions, clock};

/// A decoded picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// 8, or 9 to 16 for little-endian pairs.
    pub depth_bits: u32,
    /// Samples, row by row without gaps.
    pub samples: Vec<u8>,
    /// What the samples were before they were made brightness, if they were anything else.
    pub converted_from: Option<String>,
}

/// Time base, rate and its origin for pictures, which have no times of their own.
pub(super) fn rate(
    options: &OpenOptions,
    warnings: &mut Vec<Message>,
) -> Result<(TimeBase, Option<f64>, RateOrigin)> {
    match options.fps {
        Some(fps) => Ok((clock::time_base(fps)?, Some(fps), RateOrigin::User)),
        None => {
            warnings.push("pictures have no rate; times are frame numbers. Give it with " + Setting::Fps);
            Ok((TimeBase { numerator: 1, denominator: 1 }, None, RateOrigin::Unknown))
        }
    }
}

pub(super) fn format(depth_bits: u32) -> PixelFormat {
    if depth_bits > 8 { PixelFormat::Gray16 } else { PixelFormat::Gray8 }
}

/// The frame of a picture, if its size and depth are the recording's.
pub(super) fn frame(info: &SourceInfo, index: u64, picture: Option<Picture>) -> Frame {
    let bytes = if info.depth_bits > 8 { 2 } else { 1 };
    let fits = |p: &Picture| {
        (p.width, p.height, p.depth_bits) == (info.width, info.height, info.depth_bits)
            && p.samples.len() >= p.width as usize * p.height as usize * bytes
    };
    Frame {
        index,
        ticks: index as i64,
        width: info.width,
        height: info.height,
        stride: info.width as usize * bytes,
        format: info.format,
        depth_bits: info.depth_bits,
        plane: picture.filter(fits).map(|p| Box::new(p.samples) as _),
    }
}

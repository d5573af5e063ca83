//! Holds a decoded picture and turns it into a frame.
//!
//! Owns: [`Picture`], [`Alike`]. Must not: decode.

use super::pixel_size::{self, PixelSize};
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::{Frame, PixelFormat, RateOrigin, SourceInfo, TimeBase};
use crate::message::{Message, Setting};
use crate::pixel_aspect::PixelAspect;
use crate::source::orientation::Orientation;
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
    /// The samples' form before they were made brightness, if they were anything else.
    pub converted_from: Option<String>,
    /// How it was turned, as its file says.
    pub(crate) orientation: Orientation,
    /// How large its pixels are, once it is turned, as its file says.
    pub(crate) pixel_size: Option<PixelSize>,
}

impl Picture {
    /// As a file says that it is to be looked at.
    #[must_use]
    pub(super) fn shown(self, orientation: Orientation, pixel_size: Option<PixelSize>) -> Self {
        let sample_bytes = if self.depth_bits > 8 { 2 } else { 1 };
        let (width, height) = (self.width as usize, self.height as usize);
        if self.samples.len() < width * height * sample_bytes {
            return self;
        }
        let (samples, _) = orientation.apply(self.samples, width, height, sample_bytes);
        let (width, height) = orientation.size(self.width, self.height);
        let pixel_size = pixel_size.map(|size| if orientation.transposed { size.turned() } else { size });
        Self { width, height, samples, orientation, pixel_size, ..self }
    }
}

/// Facts that all pictures of a recording must share, or markers would jump.
#[derive(Debug, Clone, Copy)]
pub(super) struct Alike {
    pub orientation: Orientation,
    /// Width to height of a pixel; `None` where the user says it.
    pub aspect: Option<PixelAspect>,
}

impl Alike {
    /// # Errors
    /// [`Error::Source`] if the picture of frame `index` is to be turned otherwise than the others, or has other pixels.
    pub(super) fn check(&self, name: &str, index: u64, picture: &Picture) -> Result<()> {
        let fault = |problem: String| {
            Fault::new(name, problem).of_kind(FaultKind::Unsupported).at(Place::Frame(index))
        };
        if picture.orientation != self.orientation {
            let [own, others] = [picture.orientation, self.orientation].map(Orientation::words_or_none);
            return Err(Error::Source(
                fault(format!("its tag Orientation says {own}, that of the others {others}"))
                    .advice("Write the same tag into all pictures, or none"),
            ));
        }
        let own = pixel_size::aspect(picture.pixel_size, &mut Vec::new());
        match self.aspect {
            Some(others) if !others.agrees(own) => Err(Error::Source(
                fault(format!("its pixels are {own} (width:height), those of the others {others}"))
                    .advice("Say what is true of all with " + Setting::PixelAspect),
            )),
            _ => Ok(()),
        }
    }
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

/// The difference, in words, of a picture that stands for no frame from the recording's.
pub(super) fn other_kind(name: &str, odd: &Picture, info: &SourceInfo) -> String {
    let own = (odd.width, odd.height, odd.depth_bits);
    other_size(name, own, (info.width, info.height, info.depth_bits))
}

/// The difference, in words, of a picture from most: each width and height in px and depth in bits.
pub(super) fn other_size(name: &str, own: (u32, u32, u32), usual: (u32, u32, u32)) -> String {
    let words = |(width, height, bits): (u32, u32, u32)| {
        let depth = if own.2 == usual.2 { String::new() } else { format!(" of {bits} bits") };
        format!("{width} x {height} px{depth}")
    };
    format!("{name} is {}, the others are {}", words(own), words(usual))
}

/// The frame of a picture, if its size and depth are the recording's.
pub(super) fn frame(info: &SourceInfo, index: u64, picture: Option<Picture>) -> Frame {
    let bytes = if info.depth_bits > 8 { 2 } else { 1 };
    let fits = |p: &Picture| {
        (p.width, p.height, p.depth_bits) == (info.width, info.height, info.depth_bits)
            && p.samples.len() >= p.width as usize * p.height as usize * bytes
    };
    let plane = picture.filter(fits).map(|p| Box::new(p.samples) as _);
    Frame { plane, ..info.frame(index, index as i64) }
}

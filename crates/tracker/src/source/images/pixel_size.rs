//! Computes the pixel aspect from the resolutions that a picture file says.
//!
//! Owns: [`PixelSize`], [`of_png`], [`of_tiff`], [`aspect`]. Must not: read samples.

use std::io::{Read, Seek};

use tiff::decoder::Decoder;
use tiff::decoder::ifd::Value;
use tiff::tags::Tag;

use crate::message::{Message, Setting};
use crate::pixel_aspect::PixelAspect;

/// Width and height of a pixel, in units of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PixelSize {
    sides: [u64; 2],
    /// Whether they may as well be the other way round.
    doubtful: bool,
}

impl PixelSize {
    /// Of the picture turned by a quarter.
    pub(super) fn turned(self) -> Self {
        let [width, height] = self.sides;
        Self { sides: [height, width], ..self }
    }
}

/// Width to height of a pixel by what a picture says of it, where that can be believed.
pub(super) fn aspect(said: Option<PixelSize>, warnings: &mut Vec<Message>) -> PixelAspect {
    let Some(PixelSize { sides: [w, h], doubtful }) = said else { return PixelAspect::SQUARE };
    let aspect = PixelAspect::said(w, h, warnings);
    if !doubtful || aspect.is_square() {
        return aspect;
    }
    let said = format!(
        "it says without a unit that its pixels are {aspect} (width:height), and FFmpeg writes that the other way round \
         ({}): they are taken for square. Give what is true with ",
        aspect.turned()
    );
    warnings.push(Message::from(said) + Setting::PixelAspect);
    PixelAspect::SQUARE
}

/// By the resolutions of a page, which are pixels for one length.
pub(super) fn of_tiff<R: Read + Seek>(decoder: &mut Decoder<R>) -> Option<PixelSize> {
    let mut resolution = |tag| match decoder.find_tag(tag) {
        Ok(Some(Value::Rational(n, d))) => Some([u64::from(n), u64::from(d)]),
        _ => None,
    };
    let ([xn, xd], [yn, yd]) = (resolution(Tag::XResolution)?, resolution(Tag::YResolution)?);
    // Products of 32 bits fit into 64.
    Some(PixelSize { sides: [yn * xd, xn * yd], doubtful: false })
}

/// Chunks of a PNG file before its pixels that are looked at, at most.
const CHUNKS: usize = 64;

/// By the chunk `pHYs` of a PNG file, which has pixels for one length and then its unit. Without one only their ratio
/// counts, for which FFmpeg writes width and height of a pixel.
pub(super) fn of_png(bytes: &[u8]) -> Option<PixelSize> {
    let number = |at: usize| bytes.get(at..)?.first_chunk().map(|b| u32::from_be_bytes(*b));
    let mut at = bytes.starts_with(b"\x89PNG\r\n\x1a\n").then_some(8)?;
    for _ in 0..CHUNKS {
        let data = at + 8;
        match bytes.get(at + 4..data)? {
            b"pHYs" => {
                let sides = [number(data + 4)?.into(), number(data)?.into()];
                return Some(PixelSize { sides, doubtful: *bytes.get(data + 8)? == 0 });
            }
            b"IDAT" => return None,
            // A checksum follows each chunk.
            _ => at = data.checked_add(number(at)? as usize)?.checked_add(4)?,
        }
    }
    None
}

//! Computes the pixel aspect from the resolutions that a picture file says.
//!
//! Owns: [`of_file`], [`of_tiff`], [`aspect`]. Must not: read samples.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use tiff::decoder::Decoder;
use tiff::decoder::ifd::Value;
use tiff::tags::Tag;

use crate::message::{Message, Setting};
use crate::pixel_aspect::PixelAspect;

/// Width and height of a pixel, in units of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PixelSize {
    sides: [u64; 2],
    /// Whether they may as well be the other way round.
    doubtful: bool,
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

/// What a TIFF or PNG file says.
pub(super) fn of_file(path: &Path) -> Option<PixelSize> {
    let mut file = File::open(path).ok()?;
    let mut start = [0; 8];
    file.read_exact(&mut start).ok()?;
    if &start == b"\x89PNG\r\n\x1a\n" {
        return of_png(&mut file);
    }
    file.seek(SeekFrom::Start(0)).ok()?;
    of_tiff(&mut Decoder::new(BufReader::new(file)).ok()?)
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

/// By the chunk `pHYs` of a PNG file behind its first eight bytes, which has pixels for one length and then its unit.
/// Without one only their ratio counts, for which FFmpeg writes width and height of a pixel.
fn of_png(file: &mut File) -> Option<PixelSize> {
    let number = |b: &[u8]| b.first_chunk().map_or(0, |b| u32::from_be_bytes(*b));
    for _ in 0..CHUNKS {
        let mut head = [0; 8];
        file.read_exact(&mut head).ok()?;
        match &head[4..] {
            b"pHYs" => {
                let mut value = [0; 9];
                file.read_exact(&mut value).ok()?;
                let sides = [number(&value[4..]).into(), number(&value).into()];
                return Some(PixelSize { sides, doubtful: value[8] == 0 });
            }
            b"IDAT" => return None,
            // A checksum follows each chunk.
            _ => file.seek(SeekFrom::Current(i64::from(number(&head)) + 4)).ok()?,
        };
    }
    None
}

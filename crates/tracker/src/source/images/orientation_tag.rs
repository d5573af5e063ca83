//! Reads how a picture file says that it is to be turned: the tag Orientation of TIFF, and of EXIF in JPEG, PNG and WebP.
//!
//! Owns: [`told`], [`of_file`], [`of_tiff`], [`is_turned`]. Must not: turn anything.

use std::io::{Cursor, Read, Seek};
use std::path::Path;

use tiff::decoder::Decoder;
use tiff::tags::Tag;

use crate::source::orientation::Orientation;

/// The tag's number.
const ORIENTATION: usize = 0x0112;
/// Kind of a number of 16 bits in a directory of tags.
const SHORT: usize = 3;
/// Bytes of an entry of such a directory.
const ENTRY_BYTES: usize = 12;

/// The orientation that the bytes of a picture file state; `None` if none.
pub(crate) fn told(bytes: &[u8]) -> Option<Orientation> {
    match bytes {
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => {
            Decoder::new(Cursor::new(bytes)).ok().and_then(|mut decoder| tag_of_page(&mut decoder))
        }
        _ => by_exif(bytes),
    }
}

/// The orientation in the EXIF block of a JPEG, PNG or WebP file.
fn by_exif(bytes: &[u8]) -> Option<Orientation> {
    let block = match bytes {
        [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => in_png(bytes),
        [0xff, 0xd8, ..] => in_jpeg(bytes),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => in_webp(bytes),
        _ => None,
    };
    block.and_then(tag).and_then(Orientation::from_tag)
}

/// The orientation that the bytes of a JPEG or PNG file state.
pub(super) fn of_file(bytes: &[u8]) -> Orientation {
    by_exif(bytes).unwrap_or_default()
}

/// Whether a JPEG or PNG file says that it is to be turned; not where it cannot be read.
pub(crate) fn is_turned(path: &Path) -> bool {
    std::fs::read(path).is_ok_and(|bytes| of_file(&bytes) != Orientation::default())
}

/// The orientation of the page at which a decoder stands.
pub(super) fn of_tiff<R: Read + Seek>(decoder: &mut Decoder<R>) -> Orientation {
    tag_of_page(decoder).unwrap_or_default()
}

fn tag_of_page<R: Read + Seek>(decoder: &mut Decoder<R>) -> Option<Orientation> {
    let number = decoder.find_tag_unsigned::<u32>(Tag::Orientation).ok().flatten();
    number.and_then(Orientation::from_tag)
}

/// A number of up to four bytes.
fn number(bytes: &[u8], at: usize, length: usize, big_endian: bool) -> Option<usize> {
    let bytes = bytes.get(at..at.checked_add(length)?)?;
    let join = |value: usize, byte: &u8| value << 8 | usize::from(*byte);
    Some(if big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) })
}

/// The chunk `eXIf`, which may lie before the pixels or behind them.
fn in_png(bytes: &[u8]) -> Option<&[u8]> {
    let mut at = 8;
    loop {
        let length = number(bytes, at, 4, true)?;
        let data = at.checked_add(8)?;
        let end = data.checked_add(length)?;
        if bytes.get(at + 4..data)? == b"eXIf" {
            return bytes.get(data..end);
        }
        // A checksum follows each chunk.
        at = end.checked_add(4)?;
    }
}

/// The chunk `EXIF`, behind the pixels. Some writers begin it as JPEG does.
fn in_webp(bytes: &[u8]) -> Option<&[u8]> {
    let mut at = 12;
    loop {
        let length = number(bytes, at + 4, 4, false)?;
        let data = at.checked_add(8)?;
        let end = data.checked_add(length)?;
        if bytes.get(at..at + 4)? == b"EXIF" {
            let block = bytes.get(data..end)?;
            return Some(block.strip_prefix(b"Exif\0\0").unwrap_or(block));
        }
        at = end.checked_add(length % 2)?;
    }
}

/// The segment APP1 that holds EXIF, before the pixels.
fn in_jpeg(bytes: &[u8]) -> Option<&[u8]> {
    let mut at = 2;
    loop {
        let [0xff, kind] = bytes.get(at..at + 2)? else { return None };
        // Filling before a segment; the pixels.
        if *kind == 0xff {
            at += 1;
            continue;
        }
        if *kind == 0xda {
            return None;
        }
        let end = (at + 2).checked_add(number(bytes, at + 2, 2, true)?)?;
        let data = bytes.get(at + 4..end)?;
        if let (0xe1, Some(block)) = (*kind, data.strip_prefix(b"Exif\0\0")) {
            return Some(block);
        }
        at = end;
    }
}

/// The tag in the first directory of an EXIF block, which begins as a TIFF file does.
fn tag(block: &[u8]) -> Option<u32> {
    let big_endian = match block.get(..4)? {
        b"II*\0" => false,
        b"MM\0*" => true,
        _ => return None,
    };
    let number = |at: usize, length: usize| number(block, at, length, big_endian);
    let first = number(4, 4)?;
    let mut entries = (0..number(first, 2)?).map(|k| first + 2 + ENTRY_BYTES * k);
    let entry = entries.find(|at| number(*at, 2) == Some(ORIENTATION))?;
    let length = if number(entry + 2, 2)? == SHORT { 2 } else { 4 };
    u32::try_from(number(entry + 8, length)?).ok()
}

//! Finds pictures that lie one after another behind the only page of a TIFF file, as a program declares them: ImageJ (always above 4 GB),
//! MetaMorph, tifffile.
//!
//! Owns: [`Declared`], [`declared`], [`Planes`]. Must not: read pixels.

use std::io::{Read, Seek};

use tiff::decoder::Decoder;
use tiff::tags::Tag;

use super::tiff_layout::Layout;
use crate::source::raw::Stored;

/// MetaMorph's table of times and heights, an entry for each picture.
const METAMORPH_TABLE: u16 = 33629;

/// Number of pictures that a file says it holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Declared {
    /// More than 1.
    pub pictures: u64,
    /// Who wrote that.
    pub by: &'static str,
    /// How often one moment is there: for each channel, for each slice.
    channels: u64,
    slices: u64,
    frames: u64,
}

impl Declared {
    /// The warning of the order of the pictures, if they are not simply one for each moment.
    pub fn order(&self) -> Option<String> {
        (self.channels > 1 || self.slices > 1 && self.frames > 1).then(|| {
            format!(
                "{} channels, {} slices and {} frames: all {} pictures are read as frames, in the file's order (channels \
                 first, then slices). Save one channel and slice as a stack of its own",
                self.channels, self.slices, self.frames, self.pictures
            )
        })
    }
}

/// Whether more pictures lie behind the only page of a file of `size` bytes.
pub(super) fn are_behind<R: Read + Seek>(decoder: &mut Decoder<R>, size: u64) -> bool {
    let Ok(layout) = Layout::of(decoder) else { return false };
    let declared = declared(decoder, &layout);
    declared.is_some_and(|d| Planes::new(&layout, d.pictures, size).is_ok_and(|p| p.whole > 1))
}

/// The number of pictures that the page at which a decoder stands declares, if more than one.
pub(super) fn declared<R: Read + Seek>(decoder: &mut Decoder<R>, layout: &Layout) -> Option<Declared> {
    let simple =
        |pictures: u64, by: &'static str| Declared { pictures, by, channels: 1, slices: 1, frames: pictures };
    let table = decoder.image_ifd().directory().get(Tag::Unknown(METAMORPH_TABLE)).map(|e| e.count());
    let by_metamorph = table.map(|n| simple(n, "MetaMorph's table"));
    let mut text = || decoder.get_tag_ascii_string(Tag::ImageDescription).ok();
    let found = by_metamorph.or_else(|| {
        let text = text()?;
        if let Some(shape) = by_tifffile(&text, layout) {
            return Some(simple(shape, "tifffile's description"));
        }
        by_imagej(&text)
    });
    found.filter(|d| d.pictures > 1)
}

fn by_imagej(text: &str) -> Option<Declared> {
    if !text.starts_with("ImageJ=") {
        return None;
    }
    let number = |key: &str| {
        let value = text.lines().find_map(|l| l.trim_end_matches('\0').strip_prefix(key)?.strip_prefix('='));
        value.and_then(|v| v.trim().parse::<u64>().ok())
    };
    let [channels, slices, frames] = ["channels", "slices", "frames"].map(|k| number(k).unwrap_or(1).max(1));
    let pictures = number("images")?;
    Some(Declared { pictures, by: "ImageJ's description", channels, slices, frames })
}

/// tifffile's `{"shape": [100, 512, 512]}`: rows and columns last, or before the samples of a pixel.
fn by_tifffile(text: &str, layout: &Layout) -> Option<u64> {
    let value: serde_json::Value = serde_json::from_str(text.trim_end_matches('\0')).ok()?;
    let shape: Vec<u64> =
        value.get("shape")?.as_array()?.iter().map(|n| n.as_u64()).collect::<Option<_>>()?;
    let size = [u64::from(layout.height), u64::from(layout.width)];
    let before = shape.strip_suffix(&size[..]).or_else(|| {
        let with_samples = shape.strip_suffix(&[u64::from(layout.samples)][..])?;
        with_samples.strip_suffix(&size[..])
    })?;
    // Samples that lie apart from each other are a dimension too, but no pictures.
    let apart = if layout.planar { before.strip_suffix(&[u64::from(layout.samples)][..])? } else { before };
    apart.iter().try_fold(1u64, |n, k| n.checked_mul(*k))
}

/// Pictures of equal size, one after another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Planes {
    /// How they lie in the file.
    pub stored: Stored,
    /// Bits of a sample.
    pub depth_bits: u32,
    /// Bytes of a picture in the file.
    pub bytes: usize,
    /// Whole ones in the file, of those declared.
    pub whole: u64,
    start: u64,
}

impl Planes {
    /// `pictures` of them in a file of `size` bytes whose only page is laid out so; an error is a clause.
    pub fn new(layout: &Layout, pictures: u64, size: u64) -> Result<Self, String> {
        let stored = match layout.bits {
            8 if layout.is_gray() && layout.is_inverted() => Stored::Inverted,
            8 if layout.is_gray() => Stored::Plain,
            16 if layout.is_gray() => {
                Stored::Words { big_endian: layout.big_endian, shift: 0, inverted: layout.is_inverted() }
            }
            _ if layout.is_rgb8() => Stored::Colour { bytes: layout.samples as usize, red_first: true },
            _ => return Err("its pictures are neither gray of 8 or 16 bits nor RGB of 8".into()),
        };
        if !layout.is_plain() {
            return Err("it is compressed or in tiles, so that nothing says where the others are".into());
        }
        let pixels = u64::from(layout.width) * u64::from(layout.height);
        let bytes = layout
            .pixel_bytes()
            .and_then(|n| pixels.checked_mul(n))
            .filter(|n| *n > 0 && isize::try_from(*n).is_ok());
        let bytes = bytes.ok_or_else(|| format!("{} x {} px is too large", layout.width, layout.height))?;
        let start = *layout.places.first().ok_or("it does not say where its samples are")?;
        let whole = (size.saturating_sub(start) / bytes).min(pictures);
        if whole == 0 {
            return Err("not one of them is whole".into());
        }
        Ok(Self { stored, depth_bits: layout.bits, bytes: bytes as usize, whole, start })
    }

    /// The place at which a picture begins in the file, bytes.
    pub fn place(&self, index: u64) -> u64 {
        self.start + index * self.bytes as u64
    }

    /// The form of the samples before they were made brightness, if it was another.
    pub fn converted_from(&self) -> Option<String> {
        matches!(self.stored, Stored::Colour { .. }).then(|| "RGB(8)".to_owned())
    }
}

//! One page of a TIFF file: what its directory says of its samples, and their brightness.
//!
//! Owns: [`Layout`], [`page`], [`is_reduced`]. The library reads samples of 8 and 16 bits, whatever their compression;
//! uncompressed samples of other sizes and palettes are read here. Must not: guess a scale: what has none (floating point,
//! signed) is refused. Errors are clauses without a full stop.

use std::io::{Read, Seek, SeekFrom};

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::{ByteOrder, Tag};

use super::picture::Picture;
use crate::source::raw::brightness;

/// What the directory of a page says of its samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Layout {
    pub width: u32,
    pub height: u32,
    /// Bits of a sample.
    pub bits: u32,
    /// Samples of a pixel.
    pub samples: u32,
    /// Each kind of sample lies by itself.
    pub planar: bool,
    pub tiled: bool,
    pub big_endian: bool,
    /// The TIFF standard's number.
    pub compression: u32,
    /// The TIFF standard's number.
    pub photometric: u32,
    /// 1 unsigned, 2 signed, 3 floating point.
    sample_format: u32,
    /// What the first sample beside brightness or colour is: 1 and 2 opacity, 0 unknown; none if there is none.
    extra: Option<u32>,
    /// Rows of a strip, or of a tile.
    rows: u32,
    /// Where strips or tiles are in the file, and how long.
    pub places: Vec<u64>,
    pub lengths: Vec<u64>,
}

const WHITE_IS_ZERO: u32 = 0;
const BLACK_IS_ZERO: u32 = 1;
const RGB: u32 = 2;
const PALETTE: u32 = 3;
const YCBCR: u32 = 6;

const UNCOMPRESSED: u32 = 1;
const JPEG: u32 = 7;

/// The compressions that the library reads.
const READ: [u32; 7] = [UNCOMPRESSED, 4, 5, JPEG, 8, 32946, 32773];

/// A compression's name.
fn compression(number: u32) -> String {
    match number {
        2..=4 => "CCITT fax".into(),
        5 => "LZW".into(),
        6 => "JPEG of the old style".into(),
        JPEG => "JPEG".into(),
        8 | 32946 => "Deflate".into(),
        32773 => "PackBits".into(),
        33003 | 33005 | 34712 => "JPEG 2000".into(),
        34887 => "LERC".into(),
        34925 => "LZMA".into(),
        50000 => "Zstandard".into(),
        50001 => "WebP".into(),
        50002 | 52546 => "JPEG XL".into(),
        n => format!("a method of number {n}"),
    }
}

/// What a picture's samples stand for.
fn meaning(photometric: u32) -> String {
    match photometric {
        4 => "a mask".into(),
        5 => "the inks of CMYK".into(),
        8..=10 => "a colour of L*a*b*".into(),
        32803 => "a sensor's colour mosaic".into(),
        32844 | 32845 => "logarithms of light".into(),
        34892 => "a camera's raw samples".into(),
        n => format!("something of number {n}"),
    }
}

impl Layout {
    /// What the directory of the page at which the decoder stands says.
    pub fn of<R: Read + Seek>(decoder: &mut Decoder<R>) -> Result<Self, String> {
        let (width, height) = decoder.dimensions().map_err(|e| e.to_string())?;
        let tiled = decoder.find_tag(Tag::TileOffsets).map_err(|e| e.to_string())?.is_some();
        let mut word = |tag: Tag, usual: u32| {
            let found = decoder.find_tag_unsigned_vec::<u32>(tag).map_err(|e| e.to_string())?;
            Ok::<_, String>(found.and_then(|v| v.first().copied()).unwrap_or(usual))
        };
        let mut layout = Self {
            width,
            height,
            bits: word(Tag::BitsPerSample, 1)?,
            samples: word(Tag::SamplesPerPixel, 1)?,
            planar: word(Tag::PlanarConfiguration, 1)? == 2,
            tiled,
            big_endian: false,
            compression: word(Tag::Compression, UNCOMPRESSED)?,
            photometric: word(Tag::PhotometricInterpretation, BLACK_IS_ZERO)?,
            sample_format: word(Tag::SampleFormat, 1)?,
            extra: Some(word(Tag::ExtraSamples, u32::MAX)?).filter(|e| *e != u32::MAX),
            rows: word(if tiled { Tag::TileLength } else { Tag::RowsPerStrip }, u32::MAX)?,
            places: Vec::new(),
            lengths: Vec::new(),
        };
        if word(Tag::FillOrder, 1)? == 2 && layout.bits < 8 {
            return Err("the bits of its bytes are in reverse order".into());
        }
        let mut list = |tag: Tag| {
            Ok::<_, String>(
                decoder.find_tag_unsigned_vec::<u64>(tag).map_err(|e| e.to_string())?.unwrap_or_default(),
            )
        };
        let tags = if tiled {
            [Tag::TileOffsets, Tag::TileByteCounts]
        } else {
            [Tag::StripOffsets, Tag::StripByteCounts]
        };
        (layout.places, layout.lengths) = (list(tags[0])?, list(tags[1])?);
        layout.big_endian = decoder.byte_order() == ByteOrder::BigEndian;
        Ok(layout)
    }

    /// Bytes of a pixel, where it is a whole number of them.
    pub fn pixel_bytes(&self) -> Option<u64> {
        (self.bits.is_multiple_of(8)).then(|| u64::from(self.bits / 8) * u64::from(self.samples))
    }

    /// Whether its samples lie in the file as they are, one row after another without a gap.
    pub fn is_plain(&self) -> bool {
        let strips = self.places.iter().zip(&self.lengths).zip(self.places.iter().skip(1));
        self.compression == UNCOMPRESSED
            && !self.tiled
            && (!self.planar || self.samples == 1)
            && strips.into_iter().all(|((at, length), next)| at.checked_add(*length) == Some(*next))
    }

    /// Whether the samples are brightness without anything beside them.
    pub fn is_gray(&self) -> bool {
        self.samples == 1 && self.photometric <= BLACK_IS_ZERO
    }

    /// Whether 0 is white.
    pub fn is_inverted(&self) -> bool {
        self.photometric == WHITE_IS_ZERO
    }

    /// Whether the samples are red, green and blue bytes side by side.
    pub fn is_rgb8(&self) -> bool {
        self.photometric == RGB && self.bits == 8 && self.samples >= 3 && !self.planar
    }

    /// What cannot be read, in words.
    pub fn judge(&self) -> Result<(), String> {
        let bits = self.bits;
        match self.sample_format {
            2 => {
                return Err(format!(
                    "its samples are signed numbers of {bits} bits, whose zero is not black"
                ));
            }
            3 => {
                return Err(format!(
                    "its samples are floating-point numbers of {bits} bits, which have no fixed scale"
                ));
            }
            5 | 6 => return Err("its samples are complex numbers".into()),
            _ => {}
        }
        if bits > 16 || self.photometric == PALETTE && bits > 8 {
            return Err(format!("its samples have {bits} bits, and up to 16 are read (8 of a palette)"));
        }
        if !READ.contains(&self.compression) || self.compression == 4 && bits > 1 {
            return Err(format!("it is compressed by {}, which is not read", compression(self.compression)));
        }
        match (self.photometric, self.samples) {
            (WHITE_IS_ZERO | BLACK_IS_ZERO, 1) | (RGB, 3 | 4) | (PALETTE, 1) => {}
            (BLACK_IS_ZERO, 2) if matches!(self.extra, Some(1 | 2)) => {}
            (YCBCR, 3) if self.compression == JPEG => {}
            (WHITE_IS_ZERO | BLACK_IS_ZERO | RGB | PALETTE, n) => {
                return Err(format!("a pixel has {n} samples of which it does not say what they are"));
            }
            (YCBCR, _) => return Err("its colours are thinned out (YCbCr) and not compressed by JPEG".into()),
            (other, _) => {
                return Err(format!("its samples stand for {}, not for brightness", meaning(other)));
            }
        }
        let odd = !matches!(bits, 8 | 16);
        if (odd || self.photometric == PALETTE)
            && !self.is_own()
            && !(matches!(bits, 1 | 2 | 4) && self.is_gray())
        {
            let what =
                if odd { format!("its samples of {bits} bits") } else { "its palette's numbers".into() };
            return Err(if self.compression != UNCOMPRESSED {
                format!(
                    "{what} are compressed by {}; these are read uncompressed",
                    compression(self.compression)
                )
            } else {
                format!("{what} lie in tiles or with others; these are read in strips, one sample a pixel")
            });
        }
        Ok(())
    }

    /// Whether it is read here and not by the library.
    fn is_own(&self) -> bool {
        let odd = !matches!(self.bits, 8 | 16) || self.photometric == PALETTE;
        odd && self.compression == UNCOMPRESSED && !self.tiled && self.samples == 1
    }
}

/// Whether the page at which a decoder stands is a smaller copy of another.
pub(super) fn is_reduced<R: Read + Seek>(decoder: &mut Decoder<R>) -> bool {
    matches!(decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType), Ok(Some(kind)) if kind & 1 == 1)
}

/// Reads the page at which a TIFF decoder stands.
pub(super) fn page<R: Read + Seek>(decoder: &mut Decoder<R>) -> Result<Picture, String> {
    let layout = Layout::of(decoder)?;
    layout.judge()?;
    if layout.is_own() { own(decoder, &layout) } else { by_library(decoder, &layout) }
}

/// Uncompressed strips of one sample a pixel: rows begin on whole bytes, the most significant bit comes first.
fn own<R: Read + Seek>(decoder: &mut Decoder<R>, layout: &Layout) -> Result<Picture, String> {
    let bits = layout.bits;
    let palette = (layout.photometric == PALETTE).then(|| palette(decoder, bits)).transpose()?;
    let (width, row_bytes) = (layout.width as usize, (u64::from(layout.width) * u64::from(bits)).div_ceil(8));
    // Some cameras' programs put samples of 10, 12 or 14 bits into words of 16 and still say what they hold.
    let total: u64 = layout.lengths.iter().fold(0, |sum, n| sum.saturating_add(*n));
    let in_words = bits > 8 && u128::from(total) >= 2 * u128::from(layout.width) * u128::from(layout.height);
    let row_bytes = if in_words { 2 * u64::from(layout.width) } else { row_bytes };
    let top = (1u32 << bits) - 1;
    let mut samples = Vec::new();
    let mut bytes = Vec::new();
    let mut left = layout.height;
    for at in &layout.places {
        let rows = left.min(layout.rows);
        left -= rows;
        bytes.clear();
        let reader = decoder.inner();
        reader.seek(SeekFrom::Start(*at)).map_err(|e| e.to_string())?;
        let length = row_bytes * u64::from(rows);
        reader.take(length).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
        if bytes.len() as u64 != length {
            return Err("it is cut".into());
        }
        for row in bytes.chunks_exact(row_bytes as usize) {
            let value = |x: usize| {
                if in_words {
                    let pair = [row[2 * x], row[2 * x + 1]];
                    let word =
                        if layout.big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) };
                    return u32::from(word).min(top);
                }
                let first = x * bits as usize;
                // Three bytes hold any sample of up to 16 bits.
                let three = (0..3)
                    .fold(0u32, |v, k| v << 8 | u32::from(row.get(first / 8 + k).copied().unwrap_or(0)));
                three >> (24 - first % 8 - bits as usize) & top
            };
            for x in 0..width {
                let value = value(x);
                let value = if layout.is_inverted() { top - value } else { value };
                match &palette {
                    Some(table) => samples.push(table[value as usize]),
                    None if bits <= 8 => samples.push((value * 255 / top) as u8),
                    None => samples.extend((value as u16).to_le_bytes()),
                }
            }
        }
    }
    if left > 0 {
        return Err("it is cut".into());
    }
    let what = match palette {
        Some(_) => Some("palette".to_owned()),
        None => (bits < 8).then(|| format!("{bits} bit, spread over 8")),
    };
    Ok(Picture {
        width: layout.width,
        height: layout.height,
        depth_bits: bits.max(8),
        samples,
        converted_from: what,
    })
}

/// The brightness of each of a palette's colours.
fn palette<R: Read + Seek>(decoder: &mut Decoder<R>, bits: u32) -> Result<Vec<u8>, String> {
    let count = 1usize << bits;
    let map =
        decoder.find_tag_unsigned_vec::<u16>(Tag::ColorMap).map_err(|e| e.to_string())?.unwrap_or_default();
    if map.len() != 3 * count {
        return Err(format!("its palette has {} numbers, not {}", map.len(), 3 * count));
    }
    // All reds, then all greens, then all blues, of 16 bits each.
    Ok((0..count).map(|i| (brightness([map[i], map[count + i], map[2 * count + i]]) >> 8) as u8).collect())
}

fn by_library<R: Read + Seek>(decoder: &mut Decoder<R>, layout: &Layout) -> Result<Picture, String> {
    let color = decoder.colortype().map_err(|e| e.to_string())?;
    let channels = layout.samples as usize;
    let count = (layout.width as usize)
        .checked_mul(layout.height as usize)
        .filter(|n| n.checked_mul(channels).is_some())
        .ok_or_else(|| format!("{} x {} px is too large", layout.width, layout.height))?;
    // RGB is weighted; of gray with an opacity, and of brightness with two colours, the first counts.
    let weighted = matches!(color, ColorType::RGB(_) | ColorType::RGBA(_));
    let converted_from = (channels > 1).then(|| match color {
        ColorType::Multiband { .. } => "gray with opacity".to_owned(),
        other => format!("{other:?}"),
    });
    let mut decoded = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut decoded).map_err(|e| e.to_string())?;
    let (step, apart) = if layout.planar { (1, count) } else { (channels, 1) };
    let (depth_bits, samples) = match decoded {
        DecodingResult::U8(v) if layout.bits < 8 => (8, spread(&v, layout)?),
        DecodingResult::U8(v) if v.len() >= count * channels => (
            8,
            match (weighted, channels) {
                (false, 1) => v,
                (false, _) => (0..count).map(|i| v[i * step]).collect(),
                (true, _) => (0..count).map(|i| weigh(&v, i * step, apart) as u8).collect(),
            },
        ),
        DecodingResult::U16(v) if v.len() >= count * channels => {
            let value = |i: usize| if weighted { weigh(&v, i * step, apart) as u16 } else { v[i * step] };
            (16, (0..count).flat_map(|i| value(i).to_le_bytes()).collect())
        }
        _ => return Err("it is cut".to_owned()),
    };
    let converted_from =
        converted_from.or_else(|| (layout.bits < 8).then(|| format!("{} bit, spread over 8", layout.bits)));
    Ok(Picture { width: layout.width, height: layout.height, depth_bits, samples, converted_from })
}

fn weigh<T: Copy + Into<u32>>(v: &[T], at: usize, apart: usize) -> u32 {
    brightness([v[at], v[at + apart], v[at + 2 * apart]])
}

/// Samples of less than 8 bits, rows from whole bytes on, spread over 8 bits.
fn spread(packed: &[u8], layout: &Layout) -> Result<Vec<u8>, String> {
    let (width, bits) = (layout.width as usize, layout.bits as usize);
    let row_bytes = (width * bits).div_ceil(8);
    if packed.len() < row_bytes * layout.height as usize {
        return Err("it is cut".into());
    }
    let top = (1u32 << bits) - 1;
    let rows = packed.chunks_exact(row_bytes).take(layout.height as usize);
    Ok(rows
        .flat_map(|row| {
            (0..width).map(move |x| {
                let value = u32::from(row[x * bits / 8]) >> (8 - x * bits % 8 - bits) & top;
                (value * 255 / top) as u8
            })
        })
        .collect())
}

//! Reads the directory of a TIFF page and decides whether its samples can be read.
//!
//! Owns: [`Layout`], [`is_reduced`]. Must not: read samples, or guess a scale: what has none (floating point, signed) is
//! refused. Errors are clauses without a full stop.

use std::io::{Read, Seek};

use tiff::decoder::Decoder;
use tiff::tags::{ByteOrder, Tag};

/// Layout of the samples of a page, as its directory says.
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
    /// Meaning of the first sample beside brightness or colour: 1 and 2 opacity, 0 unknown; none if there is none.
    extra: Option<u32>,
    /// Rows of a strip, or of a tile.
    pub rows: u32,
    /// Where strips or tiles are in the file, and how long.
    pub places: Vec<u64>,
    pub lengths: Vec<u64>,
}

const WHITE_IS_ZERO: u32 = 0;

const BLACK_IS_ZERO: u32 = 1;

const RGB: u32 = 2;

pub(super) const PALETTE: u32 = 3;

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

/// The meaning of a picture's samples.
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
    /// The layout by the directory of the page at which the decoder stands.
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

    /// Refuses a layout that is not read, in words.
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
    pub fn is_own(&self) -> bool {
        let odd = !matches!(self.bits, 8 | 16) || self.photometric == PALETTE;
        odd && self.compression == UNCOMPRESSED && !self.tiled && self.samples == 1
    }
}

/// Whether the page at which a decoder stands is a smaller copy of another.
pub(super) fn is_reduced<R: Read + Seek>(decoder: &mut Decoder<R>) -> bool {
    matches!(decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType), Ok(Some(kind)) if kind & 1 == 1)
}
